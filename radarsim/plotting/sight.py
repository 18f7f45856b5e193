"""Finds the beams of a scan that see through a material, for use in pictures.

The definition concerns materials that beams can enter, such as foliage and smoke.

A beam sees through a material if its ray enters and leaves parts of that material, and
its reading belongs to an object of another family behind these parts. An object is
behind the parts if it is more than ``BESIDE`` outside of them as seen from above: a
wall that a bush touches is not behind the bush. Other beams are stopped by such a
material, read an object inside or close to it, or do not meet such a material.
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
BESIDE: Final = 0.2  # m; least distance of objects behind a material
_NEAR = 1e-6  # m; an event closer than this to the reading belongs to the reading


class BeamEnd(IntEnum):
    """The ways in which a beam can end."""

    NO_RETURN = 0
    BLINDED = 1
    FREE = 2  # reads an object, without a material in between that beams can enter
    TOUCHING = 3  # reads an object inside or close to a material that it has entered
    STOPPED = 4  # reads a material that beams can enter
    SPENT = 5  # reads the point at which its power is depleted
    THROUGH = 6  # reads an object behind a material that it has entered and left


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How the beams of a scan end, and which materials they meet before.

    Attributes:
        ends: The ``BeamEnd`` of each beam, (N,).
        materials: For each ``BeamEnd``, the materials that cause it: that beams see
            through, are stopped by, are depleted in, or touch.
    """

    ends: NDArray[np.uint8]
    materials: Mapping[BeamEnd, tuple[Material, ...]]


def name_materials(materials: Iterable[Material]) -> str:
    """Return the names of materials as words, or of a family if it has several."""
    words = (
        as_words(names[0]) if len(names) == 1 else family.value
        for family, names in names_by_family(materials).items()
    )
    return " and ".join(words)


def find_sight(scene: Scene, scan: Scan) -> Sight:
    """Find how the beams of a scan end, by tracing their rays again.

    Args:
        scene: The map; robots in it are ignored.
        scan: A scan of that map.
    """
    tracer = tracer_of(scene)
    parts = tracer.parts
    events = tracer.trace(scan.cast, events=True).events
    ends = np.full(len(scan.ranges), BeamEnd.NO_RETURN, np.uint8)
    found: dict[BeamEnd, dict[str, Material]] = {end: {} for end in BeamEnd}
    # Many beams meet the same part, so footprints of parts are cached.
    covers = cache(lambda part: _from_above(parts[part]))
    answers = scan.echoes.answers_in_clouds()
    # Events are sorted by ray, so the events of a beam are a slice.
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
    """Return how a beam with a reading ends, and which materials it meets.

    Args:
        events: The events of the beam's ray.
        reading: Range of the beam, m.
        place: Position of the reading, (3,) m, map frame.
        parts: The parts of the scene.
        covers: Returns the footprint of a part as seen from above.
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
    # Families are compared: a beam whose echo is from another plant behind the first
    # one does not see through foliage.
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
    """Return the exact range of the echo of each reading; without echo, the reading.

    The exact ranges are needed, since with a custom noise model a reading may be closer
    to the edge of a volume than to the wall that it belongs to.
    """
    ranges, echoes = scan.ranges.copy(), scan.echoes
    if scan.targets is not None:  # a detector reads a spectrum instead of an echo
        return ranges
    errors = np.abs(echoes.ranges - scan.ranges[echoes.beams])
    # The echo that is closest to the reading is assigned last, so its range remains.
    order = np.argsort(-errors, kind="stable")
    order = order[(errors < np.inf)[order] & (ranges[echoes.beams[order]] > 0)]
    ranges[echoes.beams[order]] = echoes.ranges[order]
    return ranges


def _from_above(part: Part) -> Geometry:
    """Return the convex hull of a part as seen from above, m."""
    hull = shapely.convex_hull(shapely.multipoints(part.vertices[:, :2]))
    shapely.prepare(hull)
    return hull
