"""The triangles of many parts, of which those near a place are sliced fast.

Triangles are sorted by cells of space and cut into blocks of equal size. A slice looks
at the bounds of all blocks, and only then at the triangles of those that it meets: how
long it takes hardly depends on the size of a map.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Part

_BLOCK: Final = 32  # triangles
_CELL: Final = np.array([[0.5], [0.5], [0.2]])  # m


class Area(NamedTuple):
    """A rectangle of the map, m."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float


class SolidMesh:
    """The triangles of the solid ones among some parts."""

    def __init__(self, parts: Iterable[Part]) -> None:
        """Sort the triangles of the solid ones among some parts."""
        solid = [part for part in parts if part.material.solid]
        firsts = np.cumsum([0, *(len(part.vertices) for part in solid)])
        faces = [part.faces + first for part, first in zip(solid, firsts, strict=False)]
        self._vertices = np.concatenate(
            [np.zeros((0, 3)), *(p.vertices for p in solid)]
        )
        self._faces = np.concatenate([np.zeros((0, 3), np.int64), *faces])
        corners = [self._vertices[column].T for column in self._faces.T]
        lows = np.minimum(np.minimum(corners[0], corners[1]), corners[2])
        highs = np.maximum(np.maximum(corners[0], corners[1]), corners[2])
        cells = np.floor((lows + highs) / 2 / _CELL)
        self._order = np.lexsort(cells)
        starts = np.arange(0, len(self._faces), _BLOCK)
        if not len(starts):
            self._lows = self._highs = np.zeros((3, 0))
            return
        self._lows = np.minimum.reduceat(lows[:, self._order], starts, axis=1)
        self._highs = np.maximum.reduceat(highs[:, self._order], starts, axis=1)

    def slice(self, area: Area, height: float) -> Floats:
        """Slice the triangles in an area at one height.

        Args:
            area: The area.
            height: z of the plane, m, map frame.

        Returns:
            Line segments, as of ``slice_mesh``, in the order of the parts and of their
            faces: all that reach into the area, and perhaps others.
        """
        low, high = self._lows, self._highs
        is_met = (low[2] < height) & (height <= high[2])
        is_met &= (low[0] <= area.x_max) & (area.x_min <= high[0])
        is_met &= (low[1] <= area.y_max) & (area.y_min <= high[1])
        places = np.flatnonzero(is_met)[:, None] * _BLOCK + np.arange(_BLOCK)
        numbers = np.sort(self._order[places[places < len(self._order)]])
        corners = self._vertices[self._faces[numbers]].reshape(-1, 3)
        faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        segments = slice_mesh(corners, faces, height)
        ends = segments[:, 0], segments[:, 1]
        low, high = np.minimum(*ends).T, np.maximum(*ends).T
        is_inside = (low[0] <= area.x_max) & (area.x_min <= high[0])
        is_inside &= (low[1] <= area.y_max) & (area.y_min <= high[1])
        inside: Floats = segments[is_inside]
        return inside
