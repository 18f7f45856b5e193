"""Which beams of a scan see through something: the one definition for all pictures.

Something is what radar or laser beams can enter, such as foliage and smoke.

A beam sees through a material if its ray enters and leaves parts of that material, and
then reads something of another family behind them. Behind them means more than
``BESIDE`` outside of these parts as seen from above: a wall that a bush touches is not
behind the bush. Other beams are stopped by such a material, read what stands in it or
at it, or have nothing of it in their way.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Geometry

from radarsim.geometry import Floats
from radarsim.plotting.palette import family_of, names_by_family
from radarsim.plotting.style import as_words
from radarsim.raycast.rays import EventKind
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan import Scan

_PASSED = (int(EventKind.LEAVE), int(EventKind.SHEET))
BESIDE: Final = 0.2  # m
_NEAR = 1e-6  # m; an event nearer than this to the reading is the reading


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
        materials: What beams see through, are stopped by, are spent in or touch, by
            their end.
    """

    ends: NDArray[np.uint8]
    materials: Mapping[BeamEnd, tuple[Material, ...]]


def name_materials(materials: Iterable[Material]) -> str:
    """Return the name of a material as words, or the families of several."""
    words = (
        as_words(names[0]) if len(names) == 1 else family.value
        for family, names in names_by_family(materials).items()
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
    found: dict[BeamEnd, dict[str, Material]] = {end: {} for end in BeamEnd}
    # Cached, since many beams are compared with the same part.
    covers = cache(lambda part: _from_above(parts[part]))
    answers = scan.echoes.answers_in_clouds()
    # Events are ordered by their rays, so that each beam has a slice of them.
    edges = np.searchsorted(events["ray"], np.arange(len(scan.ranges) + 1))
    for beam, reading in enumerate(_echo_ranges(scan).tolist()):
        if reading == 0:
            ends[beam] = BeamEnd.BLINDED
        if not 0 < reading < np.inf:
            continue
        if beam in answers:
            end, materials = BeamEnd.STOPPED, [answers[beam]]
        else:
            place = scan.cast.origins[beam] + reading * scan.cast.directions[beam]
            mine = events[edges[beam] : edges[beam + 1]]
            end, materials = _end_of_beam(mine, reading, place, parts, covers)
        ends[beam] = end
        found[end].update({material.name: material for material in materials})
    return Sight(ends, {end: tuple(m.values()) for end, m in found.items()})


def _end_of_beam(
    events: NDArray[np.void],
    reading: float,
    place: Floats,
    parts: Sequence[Part],
    covers: Callable[[int], Geometry],
) -> tuple[BeamEnd, list[Material]]:
    """Return how a beam with a reading ends, and at or behind which materials.

    Args:
        events: Those of its ray.
        reading: Its range, m.
        place: Where that is, (3,) m, map frame.
        parts: The parts of the scene.
        covers: Returns what a part covers as seen from above.
    """
    known = events[(events["part"] >= 0) & (events["part"] < len(parts))]
    if not len(known):
        return BeamEnd.FREE, []
    last = known[np.argmin(np.abs(known["t"] - reading))]
    read = parts[int(last["part"])].material
    before = known[known["t"] < min(reading, float(last["t"])) - _NEAR]
    left = before["part"][np.isin(before["kind"], _PASSED)]
    passed = list(dict.fromkeys(left.tolist()))
    materials = [parts[part].material for part in passed]
    # By families: a beam that reads one plant behind another is still among plants.
    is_behind = family_of(read) not in map(family_of, materials)
    point = shapely.Point(place[:2])
    near = (shapely.dwithin(covers(part), point, BESIDE) for part in passed)
    if passed and is_behind and not any(near):
        return BeamEnd.THROUGH, materials
    if read.lets_beams_in:
        nearest = events[np.argmin(np.abs(events["t"] - reading))]
        is_spent = nearest["kind"] == EventKind.SPENT
        return BeamEnd.SPENT if is_spent else BeamEnd.STOPPED, [read]
    entered = np.unique(known["part"][known["t"] < reading - _NEAR]).tolist()
    met = [parts[part].material for part in entered]
    met = [material for material in met if material.lets_beams_in]
    return (BeamEnd.TOUCHING if met else BeamEnd.FREE), met


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


def _from_above(part: Part) -> Geometry:
    """Return what a part covers as seen from above, without its hollows, m."""
    hull = shapely.convex_hull(shapely.multipoints(part.vertices[:, :2]))
    shapely.prepare(hull)
    return hull
