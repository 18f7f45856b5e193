"""Which beams of a scan see through something."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarsim.plotting.annotations import as_words
from radarsim.plotting.palette import Family, family_of
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

_PASSED = (int(EventKind.LEAVE), int(EventKind.SHEET))
_NEAR = 1e-6  # m; what is nearer than this to the reading is the reading


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How the beams of a scan see.

    A beam sees through a material that it has left behind, if it reads something of
    another family farther on: not through one bush at another one.

    Attributes:
        through: (N,) whether the beam sees through something.
        materials: The materials that beams see through.
    """

    through: NDArray[np.bool_]
    materials: tuple[Material, ...]

    @property
    def words(self) -> str:
        """What beams see through: a material, or the family of several."""
        names: dict[Family, list[str]] = {}
        for material in self.materials:
            names.setdefault(family_of(material), []).append(material.name)
        words = (
            as_words(of_family[0]) if len(of_family) == 1 else family.value
            for family, of_family in names.items()
        )
        return " and ".join(words)


def find_sight(scene: Scene, scan: Scan) -> Sight:
    """Find which beams see through something, by tracing their rays again.

    Args:
        scene: The map; robots in it are ignored.
        scan: A scan of that map.
    """
    tracer = tracer_of(scene)
    events = tracer.trace(scan.cast, events=True).events
    materials = [part.material for part in tracer.parts]
    through = np.zeros(len(scan.ranges), np.bool_)
    seen_through: dict[str, Material] = {}
    edges = np.searchsorted(events["ray"], np.arange(len(scan.ranges) + 1))
    for beam, reading in enumerate(scan.ranges.tolist()):
        if 0 < reading < np.inf:
            mine = events[edges[beam] : edges[beam + 1]]
            passed = _materials_passed(mine, reading, materials)
            through[beam] = bool(passed)
            seen_through.update({material.name: material for material in passed})
    return Sight(through, tuple(seen_through.values()))


def _materials_passed(
    events: NDArray[np.void], reading: float, materials: list[Material]
) -> list[Material]:
    """Return the materials that a ray has left before it reads another one."""
    known = events[(events["part"] >= 0) & (events["part"] < len(materials))]
    if not len(known):
        return []
    last = known[np.argmin(np.abs(known["t"] - reading))]
    before = known[known["t"] < min(reading, float(last["t"])) - _NEAR]
    left = before[np.isin(before["kind"], _PASSED)]
    passed = [materials[part] for part in dict.fromkeys(left["part"].tolist())]
    read = family_of(materials[int(last["part"])])
    return [] if read in map(family_of, passed) else passed
