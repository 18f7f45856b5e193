"""The loop over rays, as machine code: one after the other, leg by leg.

A leg is walked window by window: what a ray cannot reach need not be listed.
"""

from typing import Any, Final

import numpy as np

from radarsim.jit import njit_cached, njit_inline
from radarsim.raycast.attenuation import (
    BEFORE,
    MIRRORED,
    Outcome,
    RayCosts,
    Stop,
    begin,
    end,
    follow,
    forget,
    is_absorbed,
    new_walk,
    wind,
    write,
)
from radarsim.raycast.crossings import sort_crossings
from radarsim.raycast.intersect import (
    STOPPED_BY_FACE,
    Span,
    look_ahead,
    look_back,
    new_block,
)
from radarsim.raycast.rays import is_valid_ray
from radarsim.raycast.robot_boxes import box_incidence, meet_boxes

HIT: Final = int(Outcome.HIT)
SPENT: Final = int(Outcome.SPENT)
UNKNOWN: Final = -2  # instead of a part: nothing stops the ray where the window ends
# The first window is as long as the way on which the densest volume takes all power,
# times WINDOWED; each one after it is WIDENED times as long.
WINDOWED: Final = 1.4
WIDENED: Final = 4.0
INCLUSIVE: Final = 1e-9  # m; a surface this far out of reach is within
CLEAR: Final = 1e-9  # m; so far before a mirror the next leg of a ray starts


@njit_inline
def _is_in_box(tolls: Any, k: Any, origin: Any, margin: Any) -> Any:
    for axis in range(3):
        if origin[axis] < tolls.low[k, axis] - margin:
            return False
        if origin[axis] > tolls.high[k, axis] + margin:
            return False
    return True


@njit_inline
def _is_near_volume(tolls: Any, roles: Any, origin: Any, margin: Any) -> Any:
    """Say whether a point is in the box of a volume that the ray penetrates."""
    count = tolls.volume.size
    if not _is_in_box(tolls, count, origin, margin):
        return False
    for k in range(count):
        if roles[tolls.volume[k]] and _is_in_box(tolls, k, origin, margin):
            return True
    return False


@njit_inline
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


@njit_inline
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


@njit_inline
def _walk_on(ray: Any, state: Any, work: Any, way: Any, limit: Any, walk: Any) -> Any:
    """Walk a leg of a ray, window by window, from its start to where it ends.

    Args:
        ray: Its number.
        state: At the start of the leg.
        work: The scene's handle, a block, and the list of crossings.
        way: How it takes the parts, what they cost, its line, the first window, and
            the mirrors.
        limit: A ``Stop`` at the latest.
        walk: With the winding numbers at the start.

    Returns:
        The state at the end; a ``Stop`` there; and how many surfaces were met if these
        were too many, else 0.
    """
    roles, toll, line, window, mirrors = way
    span = Span(0.0, limit.t + INCLUSIVE, window)
    while True:
        stop = _find_stop(work, roles, line, span, limit)
        if stop.before > walk.crossings.size:
            return state, stop, stop.before
        stop = _before_mirror(stop, mirrors, work, line)
        state = follow(ray, state, stop, toll, walk)
        if state[3] >= 0 or stop.part != UNKNOWN:
            return state, stop, 0
        # The same line goes on behind the last float that was looked at.
        span = Span(np.nextafter(stop.t, np.inf), span.far, span.window * WIDENED)


@njit_inline
def _before_mirror(stop: Any, mirrors: Any, work: Any, line: Any) -> Any:
    """Leave out what is crossed just where a mirror turns a ray round.

    The next leg starts a hair before the mirror, where that is not crossed yet.

    Args:
        stop: Of a leg.
        mirrors: (P,) which parts are mirrors, the triangles, and how often the ray may
            still be mirrored.
        work: The scene's handle, a block, and the list of crossings.
        line: Origin and direction, (3,) each.
    """
    are_mirrors, triangles, bounces = mirrors
    part, count = stop.part, stop.before
    if bounces <= 0 or part < 0 or part >= are_mirrors.size or not are_mirrors[part]:
        return stop
    _, block, crossings = work
    nx, ny, nz = _normal(triangles, block.ours[STOPPED_BY_FACE])
    heading = line[1]
    along = abs(nx * heading[0] + ny * heading[1] + nz * heading[2])
    near = stop.t - CLEAR / max(along, CLEAR)
    while count > 0 and crossings[count - 1].t >= near:
        count -= 1
    return Stop(count, stop.t, part)


@njit_inline
def _normal(triangles: Any, k: Any) -> Any:
    """Give the unit normal of a triangle."""
    ax, ay = triangles[k, 3] - triangles[k, 0], triangles[k, 4] - triangles[k, 1]
    bx, by = triangles[k, 6] - triangles[k, 0], triangles[k, 7] - triangles[k, 1]
    az, bz = triangles[k, 5] - triangles[k, 2], triangles[k, 8] - triangles[k, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


@njit_inline
def _incidence(hit: Any, block: Any, origin: Any, heading: Any, walk: Any) -> Any:
    """Give the cosine between a ray and the normal of what it hit; nan for nothing.

    Args:
        hit: The scene's triangles, the boxes, the number of parts, and the ``RayEnd``.
        block: Of the last look ahead.
        origin: (3,) m, of the last leg.
        heading: (3,) unit vector of the last leg.
        walk: Of the last leg.
    """
    triangles, laid, parts, ending = hit
    if ending.outcome != HIT:
        return np.nan
    if ending.part >= parts:
        t = ending.t - walk.leg[BEFORE]
        return box_incidence(laid, ending.part - parts, origin, heading, t)
    nx, ny, nz = _normal(triangles, block.ours[STOPPED_BY_FACE])
    along = nx * heading[0] + ny * heading[1] + nz * heading[2]
    return min(abs(along), 1.0)


@njit_inline
def _begin_leg(walk: Any, origin: Any, middle: Any, heading: Any, before: Any) -> None:
    """Note where a leg starts, for the events on it."""
    walk.leg[BEFORE] = before
    if not walk.events.size:
        return
    for axis in range(3):
        walk.leg[axis] = origin[axis] + middle[axis]
        walk.leg[axis + 3] = heading[axis]


@njit_inline
def _mirror(triangles: Any, k: Any, t: Any, origin: Any, heading: Any) -> None:
    """Turn a ray round at a triangle; its next leg starts a hair before the mirror."""
    nx, ny, nz = _normal(triangles, k)
    along = nx * heading[0] + ny * heading[1] + nz * heading[2]
    if along > 0.0:  # it comes from behind
        nx, ny, nz, along = -nx, -ny, -nz, -along
    origin[0] += t * heading[0] + CLEAR * nx
    origin[1] += t * heading[1] + CLEAR * ny
    origin[2] += t * heading[2] + CLEAR * nz
    heading[0] -= 2.0 * along * nx
    heading[1] -= 2.0 * along * ny
    heading[2] -= 2.0 * along * nz


@njit_inline
def _follow_leg(ray: Any, state: Any, scene: Any, leg: Any, room: Any) -> Any:
    """Follow a ray up to what stops it.

    Args:
        ray: Its number, its kind, and how often it may still be mirrored.
        state: At the start of the leg; of the first one, only its power.
        scene: As in ``trace_rays``.
        leg: The boxes, the one that the ray does not meet, and the reach that is left.
        room: The block, the walk, the start of the leg, and its unit vector.

    Returns:
        As ``_walk_on``; where too many surfaces were met, the winding numbers are
        forgotten.
    """
    handle, _, tolls, triangles = scene
    i, kind, bounces = ray
    laid, carrier_id, max_range = leg
    block, walk, origin, heading = room
    behind = tolls.behind[kind]
    if _is_near_volume(tolls, behind, origin, handle.margin):
        needed = _wind_start((handle, block), behind, origin, heading, walk)
        if needed > walk.crossings.size:
            return state, Stop(0, 0.0, -1), needed
    last, box = meet_boxes(laid, carrier_id, origin, heading, max_range)
    parts = tolls.density.shape[1]
    limit = Stop(0, last, parts + box if box >= 0 else -1)
    air = tolls.air[kind]
    toll = RayCosts(tolls.density[kind], tolls.sheet_loss[kind], air, parts - 1)
    window = WINDOWED * state[1] / tolls.densest[kind]
    mirrors = (tolls.mirror[kind], triangles, bounces)
    way = (tolls.ahead[kind], toll, (origin, heading), window, mirrors)
    work = (handle, block, walk.crossings)
    if walk.leg[BEFORE] == 0.0:
        state = begin(i, state[1], walk)
    return _walk_on(i, state, work, way, limit, walk)


@njit_inline
def _tell(i: Any, ending: Any, found: Any) -> None:
    """Write down how a ray ended."""
    ranges, outcomes, parts, left, _ = found
    ranges[i] = ending.t if ending.outcome in (HIT, SPENT) else np.inf
    outcomes[i] = ending.outcome
    parts[i] = ending.part
    left[i] = ending.power


@njit_inline
def _trace_one(i: Any, scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
    """Follow one ray; arguments and what is given back as in ``trace_rays``.

    Here, and not in the loop, rows are taken of tables: see ``jit.njit_inline``.
    """
    _, middle, tolls, triangles = scene
    origins, directions, max_range, power, medium, owns = rays
    block, walk, origin, heading = room
    kind, carrier_id, parts = medium[i], owns[i], tolls.density.shape[1]
    fit = is_valid_ray(origins[i], directions[i], max_range[i], power[i])
    if not fit or kind >= len(tolls.air):
        return -1 - i
    for axis in range(3):
        origin[axis] = origins[i, axis] - middle[axis]
        heading[axis] = directions[i, axis]
    _begin_leg(walk, origin, middle, heading, 0.0)
    state = (0.0, power[i], 0.0, np.int64(-1))
    bounces = tolls.max_reflections[kind]
    while True:
        before = walk.leg[BEFORE]
        leg = (laid, carrier_id, max_range[i] - before)
        state, stop, needed = _follow_leg((i, kind, bounces), state, scene, leg, room)
        if needed:
            forget(walk)
            return needed
        part, (at, power_left, least, spent) = stop.part, state
        surface = spent < 0 and 0 <= part < parts
        keeps = tolls.kept[kind, part] if surface else 0.0
        mirrored = surface and bounces > 0 and tolls.mirror[kind, part] > 0
        keeps *= 2.0 if mirrored else 1.0  # the wave meets a mirror out and back
        if not mirrored or is_absorbed(power_left, least, keeps):
            break
        write(walk, i, at, (MIRRORED, part), power_left, keeps)
        forget(walk)
        _mirror(triangles, block.ours[STOPPED_BY_FACE], at, origin, heading)
        _begin_leg(walk, origin, middle, heading, before + at)
        state = (0.0, power_left - keeps, least, np.int64(-1))
        bounces -= 1
        carrier_id = -1  # in a mirror a robot sees itself
    ending = end(i, state, stop, keeps, walk)
    _tell(i, ending, found)
    if found[4].size:
        hit = (triangles, laid, parts, ending)
        found[4][i] = _incidence(hit, block, origin, heading, walk)
    return 0


@njit_cached
def trace_rays(scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
    """Follow rays one after the other.

    Args:
        scene: Its handle, its middle, its tolls, and its triangles.
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
    block = new_block(scene[0], crossings)
    work = (block, walk, np.zeros(3), np.zeros(3))
    for i in range(len(rays[0])):
        code = _trace_one(i, scene, rays, laid, work, found)
        if code:
            return code
    return 0
