"""The loop over rays, as machine code: one ray after the other, window by window."""

from typing import Any, Final

import numpy as np

from radarsim.raycast.boxes import box_incidence, meet_boxes
from radarsim.raycast.compiled import compiled, leaf
from radarsim.raycast.penetration import (
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
from radarsim.raycast.query import (
    STOPPED_BY_FACE,
    Span,
    look_ahead,
    look_back,
    new_block,
)
from radarsim.raycast.rays import is_fit

NOTHING: Final = int(Outcome.NOTHING)
HIT: Final = int(Outcome.HIT)
UNKNOWN: Final = -2  # instead of a part: nothing stops the ray where the window ends
# The first window is as long as the way on which the densest volume takes all power,
# times WINDOWED; each one after it is WIDENED times as long.
WINDOWED: Final = 1.4
WIDENED: Final = 4.0
INCLUSIVE: Final = 1e-9  # m; a surface this far out of reach is within


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
def _incidence(hit: Any, block: Any, origin: Any, direction: Any, ending: Any) -> Any:
    """Give the cosine between a ray and the normal of what it hit; nan for nothing.

    Args:
        hit: The scene's triangles, the boxes, and the number of parts.
        block: Of the last look ahead.
        origin: (3,) m.
        direction: (3,) unit vector.
        ending: Of the ray.
    """
    triangles, laid, parts = hit
    if ending.outcome != HIT:
        return np.nan
    if ending.part >= parts:
        return box_incidence(laid, ending.part - parts, origin, direction, ending.t)
    k = block.ours[STOPPED_BY_FACE]
    ax, ay = triangles[k, 3] - triangles[k, 0], triangles[k, 4] - triangles[k, 1]
    bx, by = triangles[k, 6] - triangles[k, 0], triangles[k, 7] - triangles[k, 1]
    az, bz = triangles[k, 5] - triangles[k, 2], triangles[k, 8] - triangles[k, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    along = nx * direction[0] + ny * direction[1] + nz * direction[2]
    return min(abs(along) / np.sqrt(nx * nx + ny * ny + nz * nz), 1.0)


@leaf
def _trace_one(i: Any, scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
    """Follow one ray; arguments and what is given back as in ``follow_all``.

    Here, and not in the loop, rows are taken of tables: see ``compiled.leaf``.
    """
    handle, middle, tolls, triangles = scene
    origins, directions, reach, power, medium, own = rays
    ranges, outcomes, parts, left, incidence = found
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
        if incidence.size:
            hit = (triangles, laid, tolls.density.shape[1])
            incidence[i] = _incidence(hit, block, origin, direction, ending)
    return needed


@compiled
def follow_all(scene: Any, rays: Any, laid: Any, room: Any, found: Any) -> Any:
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
    block, origin = new_block(scene[0], crossings), np.zeros(3)
    for i in range(len(rays[0])):
        code = _trace_one(i, scene, rays, laid, (block, walk, origin), found)
        if code:
            return code
    return 0
