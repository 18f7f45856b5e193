"""Which beams of a scan see through something: the one definition for all pictures.

Something is what radar or laser beams can enter, such as foliage and smoke.

A beam sees through a material if its ray enters and leaves parts of that material, and
then reads something of another family behind them. Behind them means more than
``BESIDE`` outside of these parts as seen from above: a wall that a bush touches is not
behind the bush. Other beams are stopped by such a material, read what stands in it or
at it, or have nothing of it in their way.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Geometry

from radarsim.geometry import Floats
from radarsim.plotting.palette import Family, family_of
from radarsim.plotting.style import as_words
from radarsim.raycast.rays import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan import Scan

_PASSED = (int(EventKind.LEAVE), int(EventKind.SHEET))
BESIDE: Final = 0.2  # m
_NEAR = 1e-6  # m; what is nearer than this to the reading is the reading


class BeamEnd(IntEnum):
    """How a beam ends; what sees through something is the greatest."""

    NO_RETURN = 0
    BLINDED = 1
    FREE = 2  # reads something, and has nothing in its way that beams can enter
    TOUCHING = 3  # reads what stands in or at something that it has entered
    STOPPED = 4  # reads something that some beams can enter
    SPENT = 5  # reads the place where its power is spent
    THROUGH = 6  # reads something behind what it has entered and left


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How the beams of a scan see.

    Attributes:
        ends: (N,) how each beam ends, a ``BeamEnd``.
        meeting: (N,) whether the beam meets what some beams see through, and comes back
            or is spent.
        materials: What beams see through, are stopped by, are spent in or touch, by
            their end.
    """

    ends: NDArray[np.uint8]
    meeting: NDArray[np.bool_]
    materials: Mapping[BeamEnd, tuple[Material, ...]]


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
    parts = tracer.parts
    events = tracer.trace(scan.cast, events=True).events
    ends = np.full(len(scan.ranges), BeamEnd.NO_RETURN, np.uint8)
    spent_unread = np.zeros(len(scan.ranges), np.bool_)
    found: dict[BeamEnd, dict[str, Material]] = {end: {} for end in BeamEnd}
    shadows: dict[int, Geometry] = {}
    answers = scan.echoes.answers_in_clouds()
    # Events are ordered by their rays, so that each beam has a slice of them.
    edges = np.searchsorted(events["ray"], np.arange(len(scan.ranges) + 1))
    ranges = _echo_ranges(scan)
    for beam, reading in enumerate(ranges.tolist()):
        mine = events[edges[beam] : edges[beam + 1]]
        if reading == 0:
            ends[beam] = BeamEnd.BLINDED
        if not 0 < reading < np.inf:
            spent_unread[beam] = reading > 0 and (mine["kind"] == EventKind.SPENT).any()
            continue
        if beam in answers:
            ends[beam] = BeamEnd.STOPPED
            found[BeamEnd.STOPPED][answers[beam].name] = answers[beam]
            continue
        passed = _parts_passed(mine, reading, parts)
        for part in passed:
            if part not in shadows:
                shadows[part] = _from_above(parts[part])
        place = scan.cast.origins[beam] + reading * scan.cast.directions[beam]
        if passed and not any(_covers(shadows[part], place) for part in passed):
            end, materials = BeamEnd.THROUGH, [parts[part].material for part in passed]
        elif (inside := _read_inside(mine, reading, parts)) is not None:
            nearest = mine[np.argmin(np.abs(mine["t"] - reading))]
            is_spent = nearest["kind"] == EventKind.SPENT
            end, materials = BeamEnd.SPENT if is_spent else BeamEnd.STOPPED, [inside]
        elif met := _materials_met(mine, reading, parts):
            end, materials = BeamEnd.TOUCHING, met
        else:
            end, materials = BeamEnd.FREE, []
        ends[beam] = end
        found[end].update({material.name: material for material in materials})
    families = {family_of(each) for each in found[BeamEnd.THROUGH].values()}
    meeting = _meet(events, ranges, parts, families)
    meeting &= spent_unread | (ends >= BeamEnd.FREE)
    return Sight(ends, meeting, {end: tuple(m.values()) for end, m in found.items()})


def _echo_ranges(scan: Scan) -> Floats:
    """Return the ranges of the echoes that beams read; without one, what they read.

    With a noise of one's own a range may be nearer to an edge of what the beam has left
    than to the wall that it reads.
    """
    ranges, echoes = scan.ranges.copy(), scan.echoes
    if scan.targets is not None:  # a detector reads the spectrum, and no single echo
        return ranges
    errors = np.abs(echoes.ranges - scan.ranges[echoes.beams])
    # The last echo of a beam that is assigned is the nearest one.
    order = np.argsort(-errors, kind="stable")
    order = order[(errors < np.inf)[order] & (ranges[echoes.beams[order]] > 0)]
    ranges[echoes.beams[order]] = echoes.ranges[order]
    return ranges


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
    # By families: a beam that reads one plant behind another is still among plants.
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
) -> list[Material]:
    """Return the materials that a ray is in before its reading."""
    known = _of_parts(events, parts)
    before = known[known["t"] < reading - _NEAR]["part"]
    materials = (parts[part].material for part in np.unique(before).tolist())
    return [each for each in materials if lets_beams_in(each)]


def lets_beams_in(material: Material) -> bool:
    """Return whether radar or laser beams can enter a material."""
    return material.penetrable or material.sheet_loss is not None


def _from_above(part: Part) -> Geometry:
    """Return what a part covers as seen from above, without its hollows, m."""
    hull = shapely.convex_hull(shapely.multipoints(part.vertices[:, :2]))
    # Prepared, since many beams are compared with the same part.
    shapely.prepare(hull)
    return hull


def _covers(area: Geometry, place: Floats) -> bool:
    return bool(shapely.dwithin(area, shapely.Point(place[:2]), BESIDE))
