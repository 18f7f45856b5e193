"""Follow one ray segment by segment to its end, as machine code.

A segment is traversed window by window, so that in dense foliage Embree does not
collect hundreds of surfaces that the ray never reaches (rows a, d and h of the
benchmarks).

A mirror reflects a ray, unless the ray meets it so nearly head-on that it comes
straight back: then the mirror ends it like any other surface, and answers. The surface
of a pane is a mirror that passes a part. A ray has one way on, and takes the stronger.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_inline
from radarsim.raycast.attenuation import (
    END_HIT,
    END_SPENT,
    MIRRORED,
    SHEET,
    T_START,
    Progress,
    RayCosts,
    RayEnd,
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
    Roles,
    SceneHandle,
    intersect_backward,
    intersect_forward,
    opaque_triangle,
    select_scene,
)
from radarsim.raycast.rays import is_valid_ray
from radarsim.raycast.robot_boxes import BoxGrid, box_incidence, intersect_boxes
from radarsim.raycast.traced_scene import MaterialTable, TracedScene

UNKNOWN: Final = -2  # instead of a part: the ray goes on where the window ends
# The first window is as long as the path on which the densest volume takes all power,
# times FIRST_WINDOW; each one after it is WINDOW_GROWTH times as long.
FIRST_WINDOW: Final = 1.4
WINDOW_GROWTH: Final = 4.0
RANGE_TOLERANCE: Final = 1e-9  # m; a surface this far beyond the range is within
# The side rays of 50 Unreal units start 0.2 m beside their sensor.
NEAR_REACH: Final = 0.5  # m along each axis from a place that are near it
NEAR_SLACK: Final = 1e-6  # m; more than coordinates are rounded by
MIRROR_OFFSET: Final = 1e-9  # m; the next segment starts this far before a mirror
ENDS, REFLECTED, PASSED = 0, 1, 2  # how a ray goes on from an opaque surface


class NearVolumes(NamedTuple):
    """The volumes around a place, which all that starts near it shares.

    Attributes:
        place: (3,) m; infinite before the first.
        length: (1,) the number of volumes.
        rows: (V,) their rows in ``MaterialTable.volume``, of which ``length`` are used.
    """

    place: Floats
    length: NDArray[np.int64]
    rows: NDArray[np.int64]


class Workspace(NamedTuple):
    """Memory that serves one ray after the other.

    Attributes:
        buffer: The buffer for queries to Embree.
        state: The state of the ray.
        origin: (3,) m, the start of the segment.
        direction: (3,) the unit vector of the segment.
        box_grid: The boxes by the cells of a grid.
        near_volumes: The volumes around the last ray's start.
    """

    buffer: RayBuffer
    state: RayState
    origin: Floats
    direction: Floats
    box_grid: BoxGrid
    near_volumes: NearVolumes


class RayStatus(NamedTuple):
    """What distinguishes a ray from others, apart from where it is.

    Attributes:
        row: The ray's row.
        ray_class: The index of its class.
        carrier_id: The robot box that does not stop it; -1 for none.
        reflections: How many more mirrors reflect it.
    """

    row: Int
    ray_class: int
    carrier_id: Int
    reflections: int


class WayOn(NamedTuple):
    """How a ray goes on from an opaque surface.

    Attributes:
        way: ``ENDS``, ``REFLECTED`` or ``PASSED``.
        cost: Power that the surface takes.
        is_bounce: Whether it is one of those of which a ray has a limited number.
    """

    way: int
    cost: float
    is_bounce: bool


class TraceColumns(NamedTuple):
    """The columns of ``Traces`` to be filled; ``incidence`` is empty if not wanted."""

    ranges: Floats
    outcomes: NDArray[np.uint8]
    parts: NDArray[np.int64]
    power: Floats
    incidence: Floats


@njit_inline
def _opaque_normal(scene: TracedScene, work: Workspace) -> tuple[float, float, float]:
    """Return the unit normal of the triangle at which the last segment ended."""
    triangles, k = scene.triangles, opaque_triangle(scene.handle, work.buffer)
    ax, ay = triangles[k, 3] - triangles[k, 0], triangles[k, 4] - triangles[k, 1]
    bx, by = triangles[k, 6] - triangles[k, 0], triangles[k, 7] - triangles[k, 1]
    az, bz = triangles[k, 5] - triangles[k, 2], triangles[k, 8] - triangles[k, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@njit_inline
def _find_way_on(
    ray: RayStatus,
    progress: Progress,
    end: SegmentEnd,
    scene: TracedScene,
    work: Workspace,
) -> WayOn:
    """Return the way on from the end of a segment; a ray that is absorbed ends."""
    part = end.part
    # Robots are numbered after the parts and are no mirrors.
    if progress.spent_in >= 0 or not 0 <= part < work.state.winding.size:
        return WayOn(ENDS, 0.0, False)
    way = _way_on_from(ray, part, scene, work)
    if is_absorbed(progress.power, progress.min_power, way.cost):
        return WayOn(ENDS, way.cost, False)
    return way


@njit_inline
def _way_on_from(
    ray: RayStatus, part: Int, scene: TracedScene, work: Workspace
) -> WayOn:
    """Return the way on from the opaque surface of a part, whatever power is left."""
    materials, direction, ray_class = scene.materials, work.direction, ray.ray_class
    absorbed = materials.absorption[ray_class, part]
    if not materials.mirror[ray_class, part]:
        return WayOn(ENDS, absorbed, False)
    passing = materials.passing[ray_class, part]
    nx, ny, nz = _opaque_normal(scene, work)
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    if along > 0.0 and passing < np.inf:  # a ray inside a pane leaves it
        return WayOn(PASSED, passing, False)
    if ray.reflections <= 0 or abs(along) >= materials.glint[ray_class]:
        return WayOn(ENDS, absorbed, False)
    if passing <= absorbed:  # each half of the loss on either way
        return WayOn(PASSED, passing, True)
    # A reflected wave passes the mirror out and back.
    return WayOn(REFLECTED, 2.0 * absorbed, True)


@njit_inline
def _end_before_mirror(
    ray: RayStatus, end: SegmentEnd, scene: TracedScene, work: Workspace
) -> SegmentEnd:
    """Drop the crossings that coincide with a mirror at the end of a segment.

    The next segment starts a little before the mirror, and would cross them again.
    """
    mirror = scene.materials.mirror[ray.ray_class]
    part, count = end.part, end.crossed
    if ray.reflections <= 0 or part < 0 or part >= mirror.size or not mirror[part]:
        return end
    nx, ny, nz = _opaque_normal(scene, work)
    direction, crossings = work.direction, work.state.crossings
    along = abs(nx * direction[0] + ny * direction[1] + nz * direction[2])
    # Along a slanted ray the offset from the mirror's plane is longer.
    near = end.t - MIRROR_OFFSET / max(along, MIRROR_OFFSET)
    while count > 0 and crossings[count - 1].t >= near:
        count -= 1
    return SegmentEnd(count, end.t, part)


@njit_inline
def _go_on(way: int, scene: TracedScene, t: float, work: Workspace) -> None:
    """Set origin and direction of the segment that follows the last one.

    Args:
        way: ``REFLECTED`` or ``PASSED``.
        scene: The ``TracedScene``.
        t: Length of the last segment, m.
        work: The workspace.
    """
    origin, direction = work.origin, work.direction
    if way == PASSED:
        for axis in range(3):
            origin[axis] += (t + MIRROR_OFFSET) * direction[axis]
        return
    nx, ny, nz = _opaque_normal(scene, work)
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    if along > 0.0:  # the back of the triangle is hit
        nx, ny, nz, along = -nx, -ny, -nz, -along
    # Off the mirror along its normal, not along the ray: a grazing ray would stay
    # within rounding of the surface and meet it again.
    origin[0] += t * direction[0] + MIRROR_OFFSET * nx
    origin[1] += t * direction[1] + MIRROR_OFFSET * ny
    origin[2] += t * direction[2] + MIRROR_OFFSET * nz
    direction[0] -= 2.0 * along * nx
    direction[1] -= 2.0 * along * ny
    direction[2] -= 2.0 * along * nz


@njit_inline
def _incidence_of(end: RayEnd, scene: TracedScene, work: Workspace) -> float:
    """Return the cosine between a ray and the normal of the surface that it hit.

    Args:
        end: The ``RayEnd``; NaN is returned if it is no hit.
        scene: The ``TracedScene``.
        work: The workspace, as the last segment left it.
    """
    if end.outcome != END_HIT:
        return np.nan
    direction, parts = work.direction, work.state.winding.size
    if end.part >= parts:  # a robot
        t = end.t - work.state.segment[T_START]
        return box_incidence(scene.boxes, end.part - parts, work.origin, direction, t)
    nx, ny, nz = _opaque_normal(scene, work)
    along: float = nx * direction[0] + ny * direction[1] + nz * direction[2]
    return min(abs(along), 1.0)


@njit_inline
def _is_in_bounds(
    materials: MaterialTable, k: int, origin: Floats, margin: float
) -> bool:
    for axis in range(3):
        if origin[axis] < materials.low[k, axis] - margin:
            return False
        if origin[axis] > materials.high[k, axis] + margin:
            return False
    return True


@njit_inline
def _list_near_volumes(
    materials: MaterialTable, origin: Floats, margin: float, near: NearVolumes
) -> None:
    """List the volumes in whose bounds points near a place can be."""
    near.length[0] = 0
    for k in range(materials.volume.size):
        if _is_in_bounds(materials, k, origin, margin + NEAR_REACH + NEAR_SLACK):
            near.rows[near.length[0]] = k
            near.length[0] += 1
    for axis in range(3):
        near.place[axis] = origin[axis]


@njit_inline
def _is_near_volume(
    materials: MaterialTable,
    roles: Roles,
    origin: Floats,
    margin: float,
    near: NearVolumes,
) -> bool:
    """Return whether a point is in the bounds of a volume that the ray penetrates."""
    # The last row bounds all volumes: one test is enough for most rays.
    if not _is_in_bounds(materials, materials.volume.size, origin, margin):
        return False
    # A forest has thousands of volumes, but few around a sensor (row a, forest).
    distance = 0.0
    for axis in range(3):
        distance = max(distance, abs(origin[axis] - near.place[axis]))
    if distance > NEAR_REACH:
        _list_near_volumes(materials, origin, margin, near)
    for i in range(near.length[0]):
        k = near.rows[i]
        if roles[materials.volume[k]] and _is_in_bounds(materials, k, origin, margin):
            return True
    return False


@njit_inline
def _find_enclosing(handle: SceneHandle, roles: Roles, work: Workspace) -> Int:
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
def _next_opaque(
    handle: SceneHandle,
    roles: Roles,
    interval: Interval,
    limit: SegmentEnd,
    work: Workspace,
) -> SegmentEnd:
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
    part: Int
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
def _march(
    ray: RayStatus,
    progress: Progress,
    limit: SegmentEnd,
    scene: TracedScene,
    work: Workspace,
) -> tuple[Progress, SegmentEnd, Int]:
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
    # A surface at the very range counts, also if rounding has put it beyond.
    interval = Interval(0.0, limit.t + RANGE_TOLERANCE, window)
    while True:
        end = _next_opaque(scene.handle, roles, interval, limit, work)
        if end.crossed > work.state.crossings.size:
            return progress, end, end.crossed
        end = _end_before_mirror(ray, end, scene, work)
        progress = advance_ray(ray.row, progress, end, costs, work.state)
        if progress.spent_in >= 0 or end.part != UNKNOWN:
            return progress, end, 0
        # The line continues behind the last float that was searched.
        near = np.nextafter(end.t, np.inf)
        interval = Interval(near, interval.far, interval.window * WINDOW_GROWTH)


@njit_inline
def _start_segment(scene: TracedScene, t: float, work: Workspace) -> None:
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
    ray: RayStatus,
    progress: Progress,
    max_range: float,
    scene: TracedScene,
    work: Workspace,
) -> tuple[Progress, SegmentEnd, Int]:
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
    # For each segment anew: a mirror may turn a level ray upwards, or a steep one
    # level.
    select_scene(handle, work.buffer, work.origin, work.direction, scene.unsliced)
    roles = materials.backward_roles[ray.ray_class]
    near = work.near_volumes
    if _is_near_volume(materials, roles, work.origin, handle.margin, near):
        needed = _find_enclosing(handle, roles, work)
        if needed > state.crossings.size:
            return progress, SegmentEnd(0, 0.0, -1), needed
    t, box = intersect_boxes(
        work.box_grid,
        scene.boxes,
        ray.carrier_id,
        work.origin,
        work.direction,
        max_range,
    )
    # Boxes are numbered after the parts.
    limit = SegmentEnd(0, t, state.winding.size + box if box >= 0 else -1)
    # After a reflection the ray keeps its ``min_power``, and is in nothing anew.
    if state.segment[T_START] == 0.0:
        progress = start_ray(ray.row, progress.power, state)
    return _march(ray, progress, limit, scene, work)


@njit_inline
def trace_ray(
    i: Int,
    max_range: float,
    power: float,
    ray_class: int,
    carrier_id: Int,
    scene: TracedScene,
    work: Workspace,
    traces: TraceColumns,
) -> Int:
    """Trace one ray.

    Args:
        i: The number of the ray.
        max_range: m.
        power: The power that it starts with.
        ray_class: The index of its class.
        carrier_id: The robot box that does not stop it; -1 for none.
        scene: The ``TracedScene``.
        work: The workspace, with origin, map frame, and direction of the ray.
        traces: The ``TraceColumns`` to be filled.

    Returns:
        As ``trace_rays``.
    """
    origin, direction, state = work.origin, work.direction, work.state
    materials = scene.materials
    valid = is_valid_ray(origin, direction, max_range, power)
    # Checked where the ray is at hand, and not in a pass of its own over all rays.
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
        _go_on(way, scene, progress.t, work)
        if way == REFLECTED:
            carrier_id = -1  # in a mirror a robot sees itself
        _start_segment(scene, t + progress.t, work)
        left = progress.power - cost
        progress = Progress(0.0, left, progress.min_power, np.int64(-1))
        reflections -= int(is_bounce)
    ray_end = end_ray(i, progress, end, cost, state)
    is_seen = ray_end.outcome in (END_HIT, END_SPENT)
    traces.ranges[i] = ray_end.t if is_seen else np.inf
    traces.outcomes[i] = ray_end.outcome
    traces.parts[i] = ray_end.part
    traces.power[i] = ray_end.power
    if traces.incidence.size:
        traces.incidence[i] = _incidence_of(ray_end, scene, work)
    return 0
