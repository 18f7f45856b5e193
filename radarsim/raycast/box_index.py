"""The boxes of robots, sorted by the direction in which they are seen from a place.

Theory of operation
===================
Rays start in groups: those of a scan within centimetres of each other, those of all
sonars of a robot within decimetres. Seen from the middle of such a group, a box covers
an interval of directions; widened by the radius of the group, it is the same from
everywhere in it. So the directions of the plane are divided into sectors, and for each
sector the boxes are listed that a ray in it may meet. Of a hundred robots in a hall a
ray then has to try one or two.

Which boxes are tried cannot change what a ray meets, as long as none of those it meets
is missing: intervals are wider than rounding errors by the width of a sector.

A direction is measured by the diamond angle, which runs around a square instead of
around a circle: it is as monotone as the angle, and needs one division.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.raycast.robot_boxes import BOX_ID, FOOTPRINT_RADIUS, X, Y, intersect_box

SECTORS: Final = 512
# A box that covers more sectors is listed once, as one that any ray may meet.
MAX_SPAN: Final = SECTORS // 8
MIN_BOXES: Final = 8  # fewer are tried one by one
MIN_RAYS: Final = 8  # of a group, likewise
GROUP_RADIUS: Final = 0.5  # m
# m by which a group is larger than it has to be: rays go on behind mirrors.
SLACK: Final = 1e-6
MAX_SQUARE: Final = 1e30  # m2, of a distance
MIN_HORIZONTAL: Final = 1e-6  # of a direction; steeper rays may meet any box


class BoxIndex(NamedTuple):
    """Boxes by direction.

    Attributes:
        place: (3,) x and y of the middle of the group of rays, m, and the square of its
            radius; negative while there is none.
        spans: (B, 2) int32, the first sector of each box, and how many it covers; 0 for
            a box that any ray may meet.
        starts: (SECTORS + 2,) int32, where the boxes of each sector start in
            ``members``, and then those that any ray may meet.
        members: (M,) int32, indices of boxes, sector by sector.
    """

    place: Floats
    spans: NDArray[np.int32]
    starts: NDArray[np.int32]
    members: NDArray[np.int32]


@njit_cached
def new_box_index(count: int) -> BoxIndex:
    """Allocate an empty index for a number of boxes."""
    return BoxIndex(
        np.full(3, -1.0),
        np.zeros((count, 2), np.int32),
        np.zeros(SECTORS + 2, np.int32),
        np.zeros(count * MAX_SPAN, np.int32),
    )


@njit_inline
def _sector(x: Any, y: Any) -> Any:
    """Return the sector of a direction; x and y must not both be 0."""
    slope = x / (abs(x) + abs(y))
    turn = 1.0 - slope if y >= 0.0 else 3.0 + slope
    return min(np.int64(turn * (SECTORS / 4)), SECTORS - 1)


@njit_inline
def _set_span(index: Any, i: Any, dx: Any, dy: Any, radius: Any) -> None:
    """Store the sectors that a circle covers, seen from the origin."""
    spans, square = index.spans, dx * dx + dy * dy - radius * radius
    spans[i, 0], spans[i, 1] = SECTORS, 0
    # Not from within, or nearly so; and not where numbers overflow.
    if not 0.01 * radius * radius < square < MAX_SQUARE:
        return
    # Both tangents to the circle, and one sector more on either side.
    tangent = np.sqrt(square)
    first = _sector(dx * tangent + dy * radius, dy * tangent - dx * radius) - 1
    last = _sector(dx * tangent - dy * radius, dy * tangent + dx * radius) + 1
    count = last - first + 1
    if count <= 0:
        count += SECTORS
    if count <= MAX_SPAN:
        spans[i, 0], spans[i, 1] = first, count


@njit_inline
def _index_boxes(index: Any, boxes: Any, radius: Any) -> None:
    """Sort the boxes for rays that start within ``radius`` m of the index' place."""
    starts, spans = index.starts, index.spans
    for sector in range(SECTORS + 2):
        starts[sector] = 0
    for i in range(len(boxes)):
        dx, dy = boxes[i, X] - index.place[0], boxes[i, Y] - index.place[1]
        _set_span(index, i, dx, dy, boxes[i, FOOTPRINT_RADIUS] + radius)
        starts[SECTORS] += spans[i, 1] == 0
        for k in range(spans[i, 1]):
            starts[(spans[i, 0] + k) % SECTORS] += 1
    # From numbers to ends; each box that is listed moves its sector's end to the start.
    for sector in range(SECTORS + 1):
        starts[sector + 1] += starts[sector]
    for i in range(len(boxes)):
        for k in range(max(spans[i, 1], 1)):
            sector = (spans[i, 0] + k) % SECTORS if spans[i, 1] else SECTORS
            starts[sector] -= 1
            index.members[starts[sector]] = i


@njit_inline
def index_boxes_around(index: Any, scene: Any, origins: Any, first: Any) -> Any:
    """Sort the boxes for the rays from one row on that start close together.

    Args:
        index: From ``new_box_index``.
        scene: The ``TracedScene``.
        origins: (N, 3) m, map frame, the starts of all rays.
        first: The first row.

    Returns:
        The row after the last of these rays.
    """
    x, y = origins[first, 0], origins[first, 1]
    end, widest = first + 1, 0.0
    while end < len(origins):
        square = (origins[end, 0] - x) ** 2 + (origins[end, 1] - y) ** 2
        if not square <= GROUP_RADIUS * GROUP_RADIUS:
            break
        widest = max(widest, square)
        end += 1
    index.place[2] = -1.0
    if len(scene.boxes) >= MIN_BOXES and end - first >= MIN_RAYS:
        index.place[0], index.place[1] = x - scene.centre[0], y - scene.centre[1]
        radius = np.sqrt(widest) + SLACK
        index.place[2] = radius * radius
        # Rounding errors of coordinates are less than the slack by far.
        _index_boxes(index, scene.boxes, radius + SLACK)
    return end


@njit_inline
def _is_indexed(index: Any, origin: Any, direction: Any) -> Any:
    """Return whether the index holds for a ray."""
    dx, dy = origin[0] - index.place[0], origin[1] - index.place[1]
    is_level = abs(direction[0]) + abs(direction[1]) > MIN_HORIZONTAL
    return is_level and dx * dx + dy * dy <= index.place[2]


@njit_inline
def intersect_boxes(
    index: Any, boxes: Any, carrier_id: Any, origin: Any, direction: Any, max_range: Any
) -> Any:
    """Find the nearest surface of all boxes but the carrier's.

    Where boxes touch, the one listed last in the table is met.

    Args:
        index: The boxes' index; it is not used for a ray for which it does not hold.
        boxes: (B, 10), from ``Boxes.table``.
        carrier_id: Id of the box that does not count; -1 for none.
        origin: (3,) m.
        direction: (3,) unit vector.
        max_range: m.

    Returns:
        The distance, m, at most ``max_range``; and the box's id, -1 for none.
    """
    count, first, here, rest = len(boxes), 0, 0, 0
    is_indexed = index.place[2] >= 0.0 and _is_indexed(index, origin, direction)
    if is_indexed:
        sector = _sector(direction[0], direction[1])
        first = index.starts[sector]
        here = index.starts[sector + 1] - first
        rest = index.starts[SECTORS] - here
        count = here + index.starts[SECTORS + 1] - index.starts[SECTORS]
    nearest, found = max_range, -1
    for k in range(count):
        i = k
        if is_indexed:
            i = index.members[first + k if k < here else rest + k]
        if boxes[i, BOX_ID] == carrier_id:
            continue
        t = intersect_box(boxes, i, origin, direction)
        if t >= 0.0 and (t < nearest or (t == nearest and i > found)):
            nearest, found = t, i
    return nearest, np.int64(boxes[found, BOX_ID]) if found >= 0 else np.int64(-1)
