"""Which beams of a scan see through something: the one definition for all pictures.

Something is what radar or laser beams can enter, such as foliage and smoke.

A beam sees through a material if its ray enters and leaves parts of that material, and
then reads something of another family behind them. Behind them means more than
``BESIDE`` outside of these parts as seen from above: a wall that a bush touches is not
behind the bush. Other beams are stopped by such a material, read what stands in it or
at it, or have nothing of it in their way.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Geometry

from radarsim.geometry import Floats
from radarsim.plotting.annotations import as_words
from radarsim.plotting.palette import Family, family_of
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan import Scan

_PASSED = (int(EventKind.LEAVE), int(EventKind.SHEET))
BESIDE: Final = 0.2  # m
_NEAR = 1e-6  # m; what is nearer than this to the reading is the reading


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How the beams of a scan see.

    Attributes:
        through: (N,) whether the beam sees through something.
        stopped: (N,) whether it is stopped by something that some beams can enter.
        meeting: (N,) whether it meets what some beams see through, and ends somewhere.
        touching: (N,) whether it enters something, and reads what stands in or at it.
        materials: The materials that beams see through.
        entered: The materials that beams enter and read something in or at.
        read: (N,) the material that stops a beam of ``stopped`` which reads something;
            None for others.
    """

    through: NDArray[np.bool_]
    stopped: NDArray[np.bool_]
    meeting: NDArray[np.bool_]
    touching: NDArray[np.bool_]
    materials: tuple[Material, ...]
    entered: tuple[Material, ...]
    read: tuple[Material | None, ...]

    @property
    def words(self) -> str:
        """What beams see through: a material, or the family of several."""
        return name_materials(self.materials)


def name_materials(materials: Iterable[Material]) -> str:
    """Return the name of a material as words, or the families of several."""
    names: dict[Family, list[str]] = {}
    for material in materials:
        of_family = names.setdefault(family_of(material), [])
        if material.name not in of_family:
            of_family.append(material.name)
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
    through, stopped, touching = (
        np.zeros(len(scan.ranges), np.bool_) for _ in range(3)
    )
    seen_through: dict[str, Material] = {}
    entered: dict[str, Material] = {}
    shadows: dict[int, Geometry] = {}
    read: list[Material | None] = [None] * len(scan.ranges)
    edges = np.searchsorted(events["ray"], np.arange(len(scan.ranges) + 1))
    for beam, reading in enumerate(scan.ranges.tolist()):
        mine = events[edges[beam] : edges[beam + 1]]
        if not 0 < reading < np.inf:
            stopped[beam] = reading > 0 and (mine["kind"] == EventKind.SPENT).any()
            continue
        passed = _parts_passed(mine, reading, tracer.parts)
        for part in passed:
            if part not in shadows:
                shadows[part] = _from_above(tracer.parts[part])
        place = scan.cast.origins[beam] + reading * scan.cast.directions[beam]
        if passed and not any(_covers(shadows[part], place) for part in passed):
            through[beam] = True
            materials = (tracer.parts[part].material for part in passed)
            seen_through.update({material.name: material for material in materials})
        elif (inside := _read_inside(mine, reading, tracer.parts)) is not None:
            stopped[beam] = True
            read[beam] = inside
        elif met := _materials_met(mine, reading, tracer.parts):
            touching[beam] = True
            entered.update(met)
    families = {family_of(material) for material in seen_through.values()}
    meeting = _meet(events, scan.ranges, tracer.parts, families)
    meeting &= stopped | (np.isfinite(scan.ranges) & (scan.ranges > 0))
    ways = (through, stopped, meeting, touching)
    found = tuple(seen_through.values()), tuple(entered.values())
    return Sight(*ways, *found, tuple(read))


def _parts_passed(
    events: NDArray[np.void], reading: float, parts: Sequence[Part]
) -> list[int]:
    """Return the parts that a ray has left before it reads one of another family."""
    known = _of_parts(events, parts)
    if not len(known):
        return []
    last = known[np.argmin(np.abs(known["t"] - reading))]
    before = known[known["t"] < min(reading, float(last["t"])) - _NEAR]
    left = before[np.isin(before["kind"], _PASSED)]
    passed = list(dict.fromkeys(left["part"].tolist()))
    read = family_of(parts[int(last["part"])].material)
    families = (family_of(parts[part].material) for part in passed)
    return [] if read in families else passed


def _of_parts(events: NDArray[np.void], parts: Sequence[Part]) -> NDArray[np.void]:
    return events[(events["part"] >= 0) & (events["part"] < len(parts))]


def _meet(
    events: NDArray[np.void],
    ranges: Floats,
    parts: Sequence[Part],
    families: set[Family],
) -> NDArray[np.bool_]:
    """Return which rays meet a material of some families up to their readings, (N,)."""
    known = _of_parts(events, parts)
    known = known[known["t"] <= ranges[known["ray"]] + _NEAR]
    wanted = [n for n, part in enumerate(parts) if family_of(part.material) in families]
    meeting = np.zeros(len(ranges), np.bool_)
    meeting[known["ray"][np.isin(known["part"], wanted)]] = True
    return meeting


def _read_inside(
    events: NDArray[np.void], reading: float, parts: Sequence[Part]
) -> Material | None:
    """Return the material that a ray reads, if some beams can enter it."""
    known = _of_parts(events, parts)
    if not len(known):
        return None
    last = known[np.argmin(np.abs(known["t"] - reading))]
    material = parts[int(last["part"])].material
    return material if lets_beams_in(material) else None


def _materials_met(
    events: NDArray[np.void], reading: float, parts: Sequence[Part]
) -> dict[str, Material]:
    """Return the materials that a ray is in before its reading, by their names."""
    known = _of_parts(events, parts)
    before = known[known["t"] < reading - _NEAR]["part"]
    materials = (parts[part].material for part in np.unique(before).tolist())
    return {each.name: each for each in materials if lets_beams_in(each)}


def lets_beams_in(material: Material) -> bool:
    """Return whether radar or laser beams can enter a material."""
    return material.penetrable or material.sheet_loss is not None


def _from_above(part: Part) -> Geometry:
    """Return what a part covers as seen from above, without its hollows, m."""
    hull = shapely.convex_hull(shapely.multipoints(part.vertices[:, :2]))
    shapely.prepare(hull)
    return hull


def _covers(area: Geometry, place: Floats) -> bool:
    return bool(shapely.dwithin(area, shapely.Point(place[:2]), BESIDE))
