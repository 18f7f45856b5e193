"""Rays through a scene: what Embree lists, refined, sorted and settled.

Theory of operation
===================
One compiled loop takes one ray after the other. Embree lists the surfaces that the
ray meets; their distances are computed again in float64 from the planes of the
triangles; ``penetration.settle`` walks the sorted list.

Rule 1: which volumes contain the start of a ray is not deduced from its crossings, as
an opaque wall may hide the exit. Where a volume's box contains the start, probes in
other directions, through penetrable surfaces only, count its winding number.
Rule 2: a ray that would be charged behind its last crossing, up to a wall or to the
end of its reach, is charged only for volumes that contain the middle of that stretch.
Rule 3: robots are upright boxes outside Embree: they move, and the scene stays sealed.
Rule 4: coordinates count from the middle of the scene, so that float32 has the fewest
digits to lose.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radarsim.raycast.boxes import Boxes, meet_boxes
from radarsim.raycast.embree import (
    HIT,
    RAY_END,
    EmbreeScene,
    Mesh,
    intersect,
    new_block,
)
from radarsim.raycast.penetration import (
    EventKind,
    Outcome,
    Stop,
    new_walk,
    new_walk_like,
    settle,
    wind,
)
from radarsim.raycast.rays import Event, Rays, Traces, check_rays
from radarsim.raycast.surfaces import (
    NO_FACES,
    list_crossings,
    middle_of,
    refine,
    tabulate,
    toll_of,
)
from radarsim.scene.scene import Part

PROBE: Final = 2  # the row of what is opaque to probes, behind those of the media
FIRST_ROOM: Final = 512  # surfaces on one ray; a call that meets more is made again
MARGIN: Final = 1e-3  # m; float32 puts a ray's end this near at 1 km
# Directions of probes: no scene that people build has faces or edges along them.
_SLANTS = np.array(
    [[0.3015, 0.2214, 0.9274], [-0.5773, 0.3464, 0.7394], [0.1231, -0.8616, 0.4924]]
)
PROBES: Final = _SLANTS / np.linalg.norm(_SLANTS, axis=1, keepdims=True)


class Tracer:
    """Casts rays into a sealed scene."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Build the scene.

        Raises:
            EngineError: If Embree cannot take a part, or a penetrable one encloses
                nothing and is no sheet.
        """
        self._parts = tuple(parts)
        self._middle = middle_of(parts)
        self._tolls = (toll_of(parts, "density"), toll_of(parts, "laser_density"))
        # The rows outlive every call: compiled code holds bare addresses of them.
        self._opaque = np.array(
            [
                *(~np.isfinite(toll.density) for toll in self._tolls),
                np.zeros(len(parts), np.bool_),
            ],
            np.uint8,
        )
        listed = (self._opaque[:PROBE] == 0).any(axis=0)
        meshes = [
            Mesh(part.vertices - self._middle, part.faces, bool(through))
            for part, through in zip(parts, listed, strict=True)
        ]
        self._scene = EmbreeScene(meshes)
        # Probes go through everything: here nothing is opaque.
        self._probed = EmbreeScene(
            [mesh if mesh.listed else mesh._replace(faces=NO_FACES) for mesh in meshes]
        )
        self._surfaces = tabulate(parts, self._middle, listed)
        x, y, z = self._middle
        self._box_shift = np.array([x, y, 0.0, z, z, 0.0, 0.0, 0.0])
        self._room = FIRST_ROOM

    def trace(self, rays: Rays, boxes: Boxes | None = None) -> Traces:
        """Follow rays to where they end."""
        return self._run(rays, boxes, 0)[0]

    def explain(self, rays: Rays, boxes: Boxes | None = None) -> list[list[Event]]:
        """Follow rays and tell everything that each of them met, in order."""
        events: list[list[Event]] = [[] for _ in range(len(rays.origins))]
        for row in self._run(rays, boxes, FIRST_ROOM)[1]:
            event = Event(
                float(row["t"]),
                EventKind(int(row["kind"])),
                int(row["part"]),
                float(row["power"]),
            )
            events[int(row["ray"])].append(event)
        return events

    def _run(
        self, rays: Rays, boxes: Boxes | None, events: int
    ) -> tuple[Traces, NDArray[np.void]]:
        """Cast; again with more room where there was too little."""
        check_rays(rays)
        n = len(rays.origins)
        rows = (boxes or Boxes.none()).rows - self._box_shift
        while True:
            traces = Traces(
                np.zeros(n), np.zeros(n, np.uint8), np.zeros(n, np.int64), np.zeros(n)
            )
            walk = new_walk(len(self._parts), self._room, events)
            needed = _trace_all(
                (self._scene.handle, self._probed.handle, self._middle),
                (self._surfaces, self._tolls, self._opaque),
                (rays.origins, rays.directions, rays.reach, rays.power, rays.medium),
                (rows, rays.own),
                walk,
                (traces.ranges, traces.outcomes, traces.parts, traces.power),
            )
            written = int(walk.events[-1]["ray"]) if events else 0
            if needed == 0 and written <= events:
                return traces, walk.events[:written]
            self._room = max(self._room, 2 * int(needed))
            events = max(events, written)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _probe(handle: Any, work: Any, surfaces: Any, point: Any, part: Any) -> Any:
    """Count how often a part contains a point: what two of three probes agree on.

    Args:
        handle: Of the scene without opaque parts.
        work: A block, the list that it writes to, and a walk to use.
        surfaces: The tables.
        point: (3,) m.
        part: The part in question.

    Returns:
        The winding number; then 0, or how much room is needed.
    """
    block, hits, walk = work
    answers = np.zeros(3, np.int64)
    for number in range(3):
        direction = PROBES[number]
        count, _, _ = intersect(handle, block, point, direction, 4e3)
        if count > hits.size:
            return 0, count
        n = list_crossings(surfaces, walk, hits, count, (point, direction), np.inf)
        for i in range(n):
            if walk.part[i] == part:
                answers[number] -= walk.turn[i]
        if number == 1 and answers[0] == answers[1]:
            return answers[0], 0
    return (answers[0] if answers[0] == answers[2] else answers[1]), 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _wind_start(
    handle: Any, work: Any, surfaces: Any, origin: Any, opaque: Any, walk: Any
) -> Any:
    """Set the winding numbers at a ray's start; give 0, or how much room is needed."""
    for k in range(surfaces.volume.size):
        part = surfaces.volume[k]
        within = not opaque[part]
        for axis in range(3):
            if not surfaces.low[k, axis] <= origin[axis] <= surfaces.high[k, axis]:
                within = False
        if within:
            number, needed = _probe(handle, work, surfaces, origin, part)
            if needed:
                return needed
            if number != 0:
                wind(walk, part, number)
    return 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _close_tail(
    handle: Any, work: Any, surfaces: Any, ray: Any, stop: Any, walk: Any
) -> Any:
    """Add exits at the last crossing, where the list has none and the ray is outside.

    Returns:
        How many crossings there are; then 0, or how much room is needed.
    """
    origin, direction = ray
    count = stop.count
    for i in range(stop.count):
        walk.winding[walk.part[i]] += walk.turn[i]
    for i in range(stop.count):
        part = walk.part[i]
        number = walk.winding[part]
        if number <= 0 or surfaces.sheet[part]:
            continue
        last = walk.t[stop.count - 1]
        middle = origin + (last + stop.t) / 2 * direction
        found, needed = _probe(handle, work, surfaces, middle, part)
        if needed or count == walk.t.size:
            return count, max(needed, count + 1)
        if found != number:
            walk.t[count], walk.part[count] = last, part
            walk.turn[count], walk.row[count] = found - number, -1
            walk.winding[part] = found
            count += 1
    for i in range(count):
        walk.winding[walk.part[i]] -= walk.turn[i]
    return count, 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _stop(
    handle: Any, work: Any, surfaces: Any, ray: Any, reach: Any, boxes: Any
) -> Any:
    """Find what stops a ray, and list what it crosses before.

    Returns:
        A ``Stop``; then 0, or how much room is needed.
    """
    block, hits, walk = work
    origin, direction = ray
    rows, own = boxes
    end, name = meet_boxes(rows, own, origin, direction, reach)
    part = surfaces.first.size + name if name >= 0 else np.int64(-1)
    count, geometry, triangle = intersect(
        handle, block, origin, direction, end + MARGIN
    )
    if count > hits.size:
        return Stop(np.int64(0), end, part), count
    if geometry >= 0:
        row = surfaces.first[geometry] + triangle
        t, _ = refine(surfaces, row, origin, direction, block.view(np.float32)[RAY_END])
        if t <= end:
            end, part = t, geometry
    count = list_crossings(surfaces, walk, hits, count, ray, end)
    return Stop(count, end, part), np.int64(0)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _trace_all(
    scene: Any, tables: Any, rays: Any, boxes: Any, walk: Any, found: Any
) -> Any:
    """Follow rays one after the other.

    Args:
        scene: Handle, handle of the scene without opaque parts, and its middle.
        tables: Surfaces, tolls and which parts are opaque, by medium.
        rays: The columns of ``Rays`` but for ``own``.
        boxes: The rows of ``Boxes``, and the column ``own``.
        walk: With room for the crossings of one ray.
        found: The columns of ``Traces``, to be filled.

    Returns:
        0, or how many crossings a ray has that has too many for the walk.
    """
    handle, probed, middle = scene
    surfaces, tolls, opaque = tables
    origins, directions, reach, power, medium = rays
    rows, own = boxes
    ranges, outcomes, parts, left = found
    hits = np.zeros(walk.t.size, HIT)
    aside = new_walk_like(walk)
    probe_work = (new_block(opaque[PROBE], hits), hits, aside)
    blocks = (new_block(opaque[0], hits), new_block(opaque[1], hits))
    for i in range(len(origins)):
        kind = medium[i]
        ray = (origins[i] - middle, directions[i])
        work = (blocks[kind], hits, walk)
        stop, needed = _stop(handle, work, surfaces, ray, reach[i], (rows, own[i]))
        if needed:
            return needed
        needed = _wind_start(probed, probe_work, surfaces, ray[0], opaque[kind], walk)
        if needed:
            return needed
        count, needed = _close_tail(probed, probe_work, surfaces, ray, stop, walk)
        if needed:
            return needed
        ending = settle(i, power[i], Stop(count, stop.t, stop.part), tolls[kind], walk)
        ranges[i] = np.inf if ending.outcome == Outcome.NOTHING else ending.t
        outcomes[i] = ending.outcome
        parts[i] = ending.part
        left[i] = ending.power
    return 0
