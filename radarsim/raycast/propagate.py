"""Follow one ray segment by segment to its end, as machine code.

A segment is traversed window by window, so that in dense foliage Embree does not
collect hundreds of surfaces that the ray never reaches.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.raycast.attenuation import (
    END_HIT,
    END_SPENT,
    MIRRORED,
    SHEET,
    T_START,
    Progress,
    RayCosts,
    RayState,
    SegmentEnd,
    advance_ray,
    end_ray,
    is_absorbed,
    record_event,
    reset_winding,
    start_ray,
    update_winding,
)
from radarsim.raycast.crossings import sort_crossings
from radarsim.raycast.intersect import (
    Interval,
    RayBuffer,
    intersect_backward,
    intersect_forward,
    select_scene,
)
from radarsim.raycast.rays import is_valid_ray
from radarsim.raycast.reflection import (
    ENDS,
    PASSED,
    REFLECTED,
    WayOn,
    end_before_mirror,
    find_way_on,
    go_on,
    incidence_of,
)
from radarsim.raycast.robot_boxes import BoxIndex, intersect_boxes

UNKNOWN: Final = -2  # instead of a part: the ray goes on where the window ends
# The first window is as long as the path on which the densest volume takes all power,
# times FIRST_WINDOW; each one after it is WINDOW_GROWTH times as long.
FIRST_WINDOW: Final = 1.4
WINDOW_GROWTH: Final = 4.0
RANGE_TOLERANCE: Final = 1e-9  # m; a surface this far beyond the range is within


class Workspace(NamedTuple):
    """Memory that serves one ray after the other.

    Attributes:
        buffer: The buffer for queries to Embree.
        state: The state of the ray.
        origin: (3,) m, the start of the segment.
        direction: (3,) the unit vector of the segment.
        box_index: The boxes by direction.
    """

    buffer: RayBuffer
    state: RayState
    origin: Floats
    direction: Floats
    box_index: BoxIndex


class RayStatus(NamedTuple):
    """What distinguishes a ray from others, apart from where it is.

    Attributes:
        row: The ray's row.
        ray_class: The index of its class.
        carrier_id: The robot box that does not stop it; -1 for none.
        reflections: How many more mirrors reflect it.
    """

    row: int
    ray_class: int
    carrier_id: int
    reflections: int


class RayLimits(NamedTuple):
    """A ray to be traced, apart from where it is.

    Attributes:
        i: The number of the ray.
        max_range: m.
        power: The power that it starts with.
        ray_class: The index of its class.
        carrier_id: The robot box that does not stop it; -1 for none.
    """

    i: int
    max_range: float
    power: float
    ray_class: int
    carrier_id: int


class TraceColumns(NamedTuple):
    """The columns of ``Traces`` to be filled; ``incidence`` is empty if not wanted."""

    ranges: Floats
    outcomes: NDArray[np.uint8]
    parts: NDArray[np.int64]
    power: Floats
    incidence: Floats


@njit_inline
def _is_in_bounds(materials: Any, k: Any, origin: Any, margin: Any) -> Any:
    for axis in range(3):
        if origin[axis] < materials.low[k, axis] - margin:
            return False
        if origin[axis] > materials.high[k, axis] + margin:
            return False
    return True


@njit_inline
def _is_near_volume(materials: Any, roles: Any, origin: Any, margin: Any) -> Any:
    """Return whether a point is in the bounds of a volume that the ray penetrates."""
    count = materials.volume.size
    # The last row bounds all volumes: one test is enough for most rays.
    if not _is_in_bounds(materials, count, origin, margin):
        return False
    for k in range(count):
        if roles[materials.volume[k]] and _is_in_bounds(materials, k, origin, margin):
            return True
    return False


@njit_inline
def _find_enclosing(handle: Any, roles: Any, work: Any) -> Any:
    """Set the winding numbers at a ray's origin; return the number of crossings behind.

    If the list has too little room for them, no number is set.
    """
    crossings = work.state.crossings
    count = intersect_backward(handle, work.buffer, roles, work.origin, work.direction)
    if count <= crossings.size:
        # From the farthest to the nearest, so that of the parts that enclose the origin
        # the last entered is listed last.
        sort_crossings(crossings, count)
        for i in range(count):
            update_winding(work.state, crossings[i].part, crossings[i].sign)
    return count


@njit_inline
def _next_opaque(handle: Any, roles: Any, interval: Any, limit: Any, work: Any) -> Any:
    """Find what stops a ray in an interval, and the crossings before it.

    Args:
        handle: The ``SceneHandle`` of the scene.
        roles: (P,) what the ray does with the parts.
        interval: The ``Interval`` to search.
        limit: A ``SegmentEnd`` at the latest.
        work: The workspace; its crossings are replaced.

    Returns:
        A ``SegmentEnd``. Its count exceeds the room for crossings if they did not fit,
        and its part is ``UNKNOWN`` if the ray may go on from there.
    """
    crossings = work.state.crossings
    count, t, part = intersect_forward(
        handle, work.buffer, roles, work.origin, work.direction, interval
    )
    if count > crossings.size:
        return SegmentEnd(count, t, part)
    if part < 0:
        # Either the window ended the search, or the interval did.
        part = UNKNOWN if t < interval.far else limit.part
    # An opaque surface may be found up to RANGE_TOLERANCE beyond the limit.
    last = min(t, limit.t)
    sort_crossings(crossings, count)
    while count > 0 and crossings[count - 1].t > last:
        count -= 1
    return SegmentEnd(count, last, part)


@njit_inline
def _march(ray: Any, progress: Any, limit: Any, scene: Any, work: Any) -> Any:
    """Follow a segment window by window to its end.

    Args:
        ray: The ``RayStatus``.
        progress: The ``Progress`` at the start of the segment.
        limit: A ``SegmentEnd`` at the latest.
        scene: The ``TracedScene``.
        work: The workspace, with the winding numbers at the start.

    Returns:
        The ``Progress`` at the end; the ``SegmentEnd``; and the number of crossings if
        there were too many for the list, else 0.
    """
    materials, k = scene.materials, ray.ray_class
    density, air = materials.density[k], materials.air[k]
    costs = RayCosts(density, materials.sheet_loss[k], air, density.size - 1)
    roles = materials.forward_roles[k]
    # Where nothing takes power, ``max_density`` is 0 and the window is infinite.
    window = FIRST_WINDOW * progress.power / materials.max_density[k]
    interval = Interval(0.0, limit.t + RANGE_TOLERANCE, window)
    while True:
        end = _next_opaque(scene.handle, roles, interval, limit, work)
        if end.crossed > work.state.crossings.size:
            return progress, end, end.crossed
        end = end_before_mirror(ray, end, scene, work)
        progress = advance_ray(ray.row, progress, end, costs, work.state)
        if progress.spent_in >= 0 or end.part != UNKNOWN:
            return progress, end, 0
        # The line continues behind the last float that was searched.
        near = np.nextafter(end.t, np.inf)
        interval = Interval(near, interval.far, interval.window * WINDOW_GROWTH)


@njit_inline
def _start_segment(scene: Any, t: Any, work: Any) -> None:
    """Store where a segment starts, for its events; ``t`` is the distance before it."""
    segment = work.state.segment
    segment[T_START] = t
    if not work.state.events.size:
        return
    for axis in range(3):
        segment[axis] = work.origin[axis] + scene.centre[axis]
        segment[axis + 3] = work.direction[axis]


@njit_inline
def _trace_segment(
    ray: Any, progress: Any, max_range: Any, scene: Any, work: Any
) -> Any:
    """Follow a ray along a straight line to what stops it.

    Args:
        ray: The ``RayStatus``.
        progress: The ``Progress`` at the start of the segment; for the first segment
            only its power is used.
        max_range: The rest of the ray's range, m.
        scene: The ``TracedScene``.
        work: The workspace, with all winding numbers zero.

    Returns:
        As ``_march``.
    """
    handle, materials, state = scene.handle, scene.materials, work.state
    select_scene(handle, work.buffer, work.origin, work.direction, scene.unsliced)
    roles = materials.backward_roles[ray.ray_class]
    if _is_near_volume(materials, roles, work.origin, handle.margin):
        needed = _find_enclosing(handle, roles, work)
        if needed > state.crossings.size:
            return progress, SegmentEnd(0, 0.0, -1), needed
    t, box = intersect_boxes(
        *(work.box_index, scene.boxes, ray.carrier_id),
        *(work.origin, work.direction, max_range),
    )
    # Boxes are numbered after the parts.
    limit = SegmentEnd(0, t, state.winding.size + box if box >= 0 else -1)
    # After a reflection the ray keeps its ``min_power``, and is in nothing anew.
    if state.segment[T_START] == 0.0:
        progress = start_ray(ray.row, progress.power, state)
    return _march(ray, progress, limit, scene, work)


@njit_inline
def _find_way_on(ray: Any, progress: Any, end: Any, scene: Any, work: Any) -> Any:
    """Return the ``WayOn`` from the end of a segment; a ray that is absorbed ends."""
    if progress.spent_in >= 0 or not 0 <= end.part < work.state.winding.size:
        return WayOn(ENDS, 0.0, False)
    on = find_way_on(ray, end.part, scene, work)
    if is_absorbed(progress.power, progress.min_power, on.cost):
        return WayOn(ENDS, on.cost, False)
    return on


@njit_inline
def trace_ray(given: Any, scene: Any, work: Any, traces: Any) -> Any:
    """Trace one ray.

    Args:
        given: The ``RayLimits``.
        scene: The ``TracedScene``.
        work: The workspace, with origin, map frame, and direction of the ray.
        traces: The ``TraceColumns`` to be filled.

    Returns:
        As ``trace_rays``.
    """
    origin, direction, state = work.origin, work.direction, work.state
    i, max_range, power, ray_class, carrier_id = given
    materials = scene.materials
    valid = is_valid_ray(origin, direction, max_range, power)
    if not valid or ray_class >= len(materials.air):
        return -1 - i
    for axis in range(3):
        origin[axis] -= scene.centre[axis]
    reflections = materials.max_reflections[ray_class]
    _start_segment(scene, 0.0, work)
    progress = Progress(0.0, power, 0.0, np.int64(-1))
    while True:
        t = state.segment[T_START]
        ray = RayStatus(i, ray_class, carrier_id, reflections)
        progress, end, needed = _trace_segment(
            ray, progress, max_range - t, scene, work
        )
        if needed:
            # The caller traces all rays again, with room for this many crossings.
            reset_winding(state)
            return needed
        way, cost, is_bounce = _find_way_on(ray, progress, end, scene, work)
        if way == ENDS:
            break
        kind = SHEET if way == PASSED else MIRRORED
        record_event(state, i, progress.t, kind, end.part, progress.power, cost)
        reset_winding(state)
        go_on(way, scene, progress.t, work)
        if way == REFLECTED:
            carrier_id = -1  # in a mirror a robot sees itself
        _start_segment(scene, t + progress.t, work)
        left = progress.power - cost
        progress = Progress(0.0, left, progress.min_power, np.int64(-1))
        reflections -= int(is_bounce)
    ray_end = end_ray(i, progress, end, cost, state)
    _write_trace(traces, i, ray_end)
    if traces.incidence.size:
        traces.incidence[i] = incidence_of(ray_end, scene, work)
    return 0


@njit_inline
def _write_trace(traces: Any, i: Any, end: Any) -> None:
    is_seen = end.outcome in (END_HIT, END_SPENT)
    traces.ranges[i] = end.t if is_seen else np.inf
    traces.outcomes[i] = end.outcome
    traces.parts[i] = end.part
    traces.power[i] = end.power
