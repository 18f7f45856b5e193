"""Rays through a scene: what they meet, sorted and settled.

Theory of operation
===================
One compiled loop takes one ray after the other. ``embree`` lists the surfaces that the
ray meets, ``penetration`` walks the sorted list.

Rule 1: which volumes contain the start of a ray is not deduced from what is ahead, as
an opaque wall may hide the exit. Where the start is in a volume's box, the same line
is looked at backwards, through everything: what was entered there and not left again
is around the ray. As it is the same line, no surface is counted on both sides of the
start, or on none, and the sum of all crossings is zero, also for a ray that starts on
a face or runs along an edge.
Rule 2: robots are upright boxes outside Embree: they move, and the scene stays sealed.
Rule 3: coordinates count from the middle of the scene, so that they are small.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.boxes import NO_BOXES, Boxes, meet_boxes
from radarsim.raycast.compiled import compiled, leaf
from radarsim.raycast.embree import EmbreeScene, Mesh
from radarsim.raycast.nearby import is_anything_opaque
from radarsim.raycast.penetration import (
    CROSSING,
    EVENT,
    EventKind,
    Outcome,
    Stop,
    Toll,
    begin,
    end,
    follow,
    new_walk,
    sort_crossings,
    wind,
)
from radarsim.raycast.query import Span, look_ahead, look_back, new_block
from radarsim.raycast.rays import Event, Rays, Traces, columns_of, is_fit, refuse
from radarsim.raycast.tolls import middle_of, tabulate
from radarsim.scene.scene import Part

FIRST_ROOM: Final = 512  # surfaces on one ray; a call that meets more is made again
NOTHING: Final = int(Outcome.NOTHING)
UNKNOWN: Final = -2  # instead of a part: nothing stops the ray where the window ends
# The first window is as long as the way on which the densest volume takes all power,
# times WINDOWED; each one after it is WIDENED times as long.
WINDOWED: Final = 1.4
WIDENED: Final = 4.0
INCLUSIVE: Final = 1e-9  # m; a surface this far out of reach is within


class Tracer:
    """Casts rays into a sealed scene."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Build the scene.

        Raises:
            EngineError: If Embree cannot take a part, or a penetrable one encloses
                nothing and is no sheet.
        """
        self._middle = middle_of(parts)
        self._tolls = tabulate(parts, self._middle)
        self._scene = EmbreeScene(
            [Mesh(part.vertices - self._middle, part.faces) for part in parts]
        )
        self._room = FIRST_ROOM

    def trace(self, rays: Rays, boxes: Boxes | None = None) -> Traces:
        """Follow rays to where they end.

        Raises:
            EngineError: If a column of the rays is not what it has to be.
        """
        return self._run(rays, boxes, 0)[0]

    def is_open(
        self, point: Floats, radius: float, medium: int, boxes: Boxes | None, own: int
    ) -> bool:
        """Say whether nothing opaque is near a point, for certain.

        Args:
            point: (3,) m, map frame.
            radius: m.
            medium: ``RADAR`` or ``LASER``.
            boxes: Robots, of which ``own`` does not count.
            own: Number of a box; -1 for none.

        Returns:
            False also if something is only a little farther away.
        """
        if boxes is not None and boxes.is_any_near(point, radius, own):
            return False
        scene, roles = self._scene, self._tolls.ahead[medium]
        reach = radius + scene.handle.margin
        point = point - self._middle
        return not is_anything_opaque(
            scene.handle.numbers, scene.asked, roles, point, reach
        )

    def explain(self, rays: Rays, boxes: Boxes | None = None) -> list[list[Event]]:
        """Follow rays and tell everything that each of them met, in order.

        Raises:
            EngineError: If a column of the rays is not what it has to be.
        """
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
        columns = columns_of(rays)
        n = len(rays.origins)
        laid = NO_BOXES if boxes is None else boxes.laid_out(self._middle)
        while True:
            traces = Traces(
                np.zeros(n), np.zeros(n, np.uint8), np.zeros(n, np.int64), np.zeros(n)
            )
            notes = np.zeros(events + 1 if events else 0, EVENT)
            needed = _trace_all(
                (self._scene.handle, self._middle, self._tolls),
                columns,
                laid,
                (np.zeros(self._room, CROSSING), notes),
                (traces.ranges, traces.outcomes, traces.parts, traces.power),
            )
            written = int(notes[-1]["ray"]) if events else 0
            if needed < 0:
                refuse(rays, -1 - int(needed))
            if needed == 0 and written <= events:
                return traces, notes[:written]
            self._room = max(self._room, 2 * int(needed))
            events = max(events, written)


@leaf
def _is_in_box(tolls: Any, k: Any, origin: Any, margin: Any) -> Any:
    for axis in range(3):
        if origin[axis] < tolls.low[k, axis] - margin:
            return False
        if origin[axis] > tolls.high[k, axis] + margin:
            return False
    return True


@leaf
def _is_near_volume(tolls: Any, roles: Any, origin: Any, margin: Any) -> Any:
    """Say whether a point is in the box of a volume that the ray penetrates."""
    count = tolls.volume.size
    if not _is_in_box(tolls, count, origin, margin):
        return False
    for k in range(count):
        if roles[tolls.volume[k]] and _is_in_box(tolls, k, origin, margin):
            return True
    return False


@leaf
def _wind_start(work: Any, roles: Any, origin: Any, direction: Any, walk: Any) -> Any:
    """Set the winding numbers at a ray's start; give how many surfaces are behind."""
    handle, block = work
    count = look_back(handle, block, roles, origin, direction)
    crossings = walk.crossings
    if count <= crossings.size:
        sort_crossings(crossings, count)
        for i in range(count):
            wind(walk, crossings[i].part, crossings[i].turn)
    return count


@leaf
def _find_stop(work: Any, roles: Any, line: Any, span: Any, limit: Any) -> Any:
    """Find what stops a ray, after the surfaces that it crosses before.

    Args:
        work: The scene's handle, a block, and the list of crossings.
        roles: (P,) how the ray takes the parts.
        line: Origin and direction, (3,) each.
        span: What is to be looked at.
        limit: A ``Stop`` at the latest.

    Returns:
        A ``Stop``; its count is greater than the list if that has too little room, and
        its part is ``UNKNOWN`` if the ray may go on from there.
    """
    handle, block, crossings = work
    origin, direction = line
    count, t, part = look_ahead(handle, block, roles, origin, direction, span)
    if count > crossings.size:
        return Stop(count, t, part)
    if part < 0:
        part = UNKNOWN if t < span.far else limit.part
    last = min(t, limit.t)
    sort_crossings(crossings, count)
    while count > 0 and crossings[count - 1].t > last:
        count -= 1
    return Stop(count, last, part)


@leaf
def _walk_on(ray: Any, power: Any, work: Any, way: Any, limit: Any, walk: Any) -> Any:
    """Walk a ray, window by window, from its start to where it ends.

    Args:
        ray: Its number.
        power: What it starts with.
        work: The scene's handle, a block, and the list of crossings.
        way: How it takes the parts, what they cost, its line, and the first window.
        limit: A ``Stop`` at the latest.
        walk: With the winding numbers at the start.

    Returns:
        An ``Ending``; and how many surfaces were met if these were too many, else 0.
    """
    roles, toll, line, window = way
    state = begin(ray, power, walk)
    span = Span(0.0, limit.t + INCLUSIVE, window)
    while True:
        stop = _find_stop(work, roles, line, span, limit)
        if stop.before > walk.crossings.size:
            return end(ray, state, limit, walk), stop.before
        state = follow(ray, state, stop, toll, walk)
        if state[3] >= 0 or stop.part != UNKNOWN:
            return end(ray, state, stop, walk), 0
        # The same line goes on behind the last float that was looked at.
        span = Span(np.nextafter(stop.t, np.inf), span.far, span.window * WIDENED)


@leaf
def _trace_one(i: Any, scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
    """Follow one ray; arguments and what is given back as in ``_trace_all``.

    Here, and not in the loop, rows are taken of tables: see ``compiled.leaf``.
    """
    handle, middle, tolls = scene
    origins, directions, reach, power, medium, own = rays
    ranges, outcomes, parts, left = found
    block, walk, origin = room
    kind, direction = medium[i], directions[i]
    if not is_fit(origins[i], direction, reach[i], power[i], kind):
        return -1 - i
    for axis in range(3):
        origin[axis] = origins[i, axis] - middle[axis]
    behind = tolls.behind[kind]
    if _is_near_volume(tolls, behind, origin, handle.margin):
        needed = _wind_start((handle, block), behind, origin, direction, walk)
        if needed > walk.crossings.size:
            return needed
    last, box = meet_boxes(laid, own[i], origin, direction, reach[i])
    limit = Stop(0, last, tolls.density.shape[1] + box if box >= 0 else -1)
    toll = Toll(tolls.density[kind], tolls.sheet_loss[kind])
    window = WINDOWED * power[i] / tolls.densest[kind]
    way = (tolls.ahead[kind], toll, (origin, direction), window)
    work = (handle, block, walk.crossings)
    ending, needed = _walk_on(i, power[i], work, way, limit, walk)
    if needed == 0:
        ranges[i] = np.inf if ending.outcome == NOTHING else ending.t
        outcomes[i] = ending.outcome
        parts[i] = ending.part
        left[i] = ending.power
    return needed


@compiled
def _trace_all(scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
    """Follow rays one after the other.

    Args:
        scene: Its handle, its middle, and its tolls.
        rays: The columns of ``Rays``.
        laid: Boxes, laid out.
        room: For the crossings of one ray, and for events.
        found: The columns of ``Traces``, to be filled.

    Returns:
        0; or how many surfaces a ray meets that meets too many; or of an unfit ray
        -1 minus its number.
    """
    crossings, events = room
    walk = new_walk(scene[2].density.shape[1], crossings, events)
    block, origin = new_block(scene[0], crossings), np.zeros(3)
    for i in range(len(rays[0])):
        code = _trace_one(i, scene, rays, laid, (block, walk, origin), found)
        if code:
            return code
    return 0
