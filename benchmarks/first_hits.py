"""First hits by embreex itself, the unit of the benchmarks of rays."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.shapes import Mesh


class FirstHits:
    """First hits of the same rays on the same meshes by embreex itself, in float32.

    Tests compare with it, and benchmarks use it as their unit. Scans draw other rays
    each time, for which a processor guesses worse than for rays that repeat: so several
    draws take turns.
    """

    def __init__(self, meshes: Sequence[Mesh], *draws: tuple[Floats, Floats]) -> None:
        """Build the scene.

        Args:
            meshes: The meshes.
            *draws: Rays, one draw or several: (N, 3) origins, m, and (N, 3) directions.
        """
        self._scene = EmbreeScene()
        for vertices, faces in meshes:
            corners = np.asarray(vertices, np.float32)
            TriangleMesh(self._scene, corners, np.asarray(faces, np.int32))
        rays = [(np.float32(starts), np.float32(ways)) for starts, ways in draws]
        self._draws = itertools.cycle(rays)
        self.everything()  # Embree builds its tree at the first call

    def run(self) -> NDArray[np.int32]:
        """Return the triangle in its mesh that each ray of a draw hits, or -1."""
        found: NDArray[np.int32] = self._scene.run(*next(self._draws))
        return found

    def everything(self) -> dict[str, NDArray[Any]]:
        """Return everything that embreex reports, such as geomID and tfar."""
        rays = next(self._draws)
        found: dict[str, NDArray[Any]] = self._scene.run(*rays, output=1)
        return found
