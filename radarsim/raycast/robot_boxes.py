"""Upright boxes that stop every ray: robots, which move while the scene is fixed.

For a scan they are sorted by the direction in which they are seen from its sensor.

Theory of operation
===================
Rays start in groups: those of a scan within centimetres of each other, those of all
sonars of a robot within decimetres. Seen from the middle of such a group, a box covers
an interval of directions; widened by the radius of the group, it is the same from
everywhere in it. So the directions of the plane are divided into sectors, and for each
sector the boxes are listed that a ray in it may meet. Of a hundred robots in a hall a
ray then has to try one or two: row j of ``radarsim bench`` has a hundred and more.

Which boxes are tried cannot change what a ray meets, as long as none of those it meets
is missing: intervals are wider than rounding errors by the width of a sector.

A direction is measured by the diamond angle, which runs around a square instead of
around a circle: it is as monotone as the angle, and needs one division.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline

# Columns of a table of boxes: centre, yaw, half sizes, and half the diagonal of the
# footprint.
X, Y, Z, COS, SIN, LENGTH, WIDTH, HEIGHT, FOOTPRINT_RADIUS, BOX_ID = range(10)
NO_BOXES: Final = np.zeros((0, 10))
SECTORS: Final = 256
# A box that covers more sectors is listed once, as one that any ray may meet.
MAX_SPAN: Final = SECTORS // 8
MIN_BOXES: Final = 8  # fewer are tried one by one
MIN_RAYS: Final = 8  # of a group, likewise
GROUP_RADIUS: Final = 0.5  # m
# m by which a group is larger than it has to be: rays go on behind mirrors.
SLACK: Final = 1e-6
MAX_SQUARE: Final = 1e30  # m2, of a distance
MIN_HORIZONTAL: Final = 1e-6  # of a direction; steeper rays may meet any box


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and the id of the box.

    Raises:
        EngineError: If the rows have another shape, or are not finite.
    """

    rows: Floats
    _tables: dict[bytes, Floats] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        rows = np.asarray(self.rows, np.float64)
        if rows.ndim != 2 or rows.shape[1] != 8:
            raise EngineError(f"boxes of shape {rows.shape}, expected (n, 8)")
        if not np.isfinite(rows).all():
            row = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
            raise EngineError(
                f"boxes[{row}] is {rows[row].tolist()}, expected finite numbers"
            )
        object.__setattr__(self, "rows", rows)

    def table(self, centre: Floats) -> Floats:
        """Return the table that kernels read; it is computed once.

        Args:
            centre: (3,) m, the origin of its coordinates.
        """
        key = centre.tobytes()
        if key not in self._tables:
            self._tables[key] = self._tabulate(centre)
        return self._tables[key]

    def _tabulate(self, centre: Floats) -> Floats:
        x, y, yaw, low, high, length, width, box_id = self.rows.T
        table = np.zeros((len(x), 10))
        table[:, X], table[:, Y] = x - centre[0], y - centre[1]
        table[:, Z], table[:, HEIGHT] = (low + high) / 2 - centre[2], (high - low) / 2
        table[:, COS], table[:, SIN] = np.cos(yaw), np.sin(yaw)
        table[:, LENGTH], table[:, WIDTH] = length, width
        table[:, FOOTPRINT_RADIUS] = np.hypot(length, width)
        table[:, BOX_ID] = box_id
        return table


@njit_inline
def _intersect_slab(start: float, slope: float, half: float) -> tuple[float, float]:
    """Return where a ray enters and leaves the slab from -half to half on one axis."""
    if slope == 0.0:
        return (-np.inf, np.inf) if abs(start) <= half else (np.inf, -np.inf)
    first, second = (-half - start) / slope, (half - start) / slope
    return min(first, second), max(first, second)


@njit_inline
def intersect_box(boxes: Floats, i: Int, origin: Floats, direction: Floats) -> float:
    """Return the distance at which a ray meets a box, m; -1 if it does not.

    A ray that starts in a box hits it from within.
    """
    ex, ey = direction[0], direction[1]
    dx, dy = origin[0] - boxes[i, X], origin[1] - boxes[i, Y]
    # Most boxes are too far beside the ray: reject them by their circles first.
    if abs(ex * dy - ey * dx) > boxes[i, FOOTPRINT_RADIUS]:
        return -1.0
    c, s = boxes[i, COS], boxes[i, SIN]
    ahead = _intersect_slab(c * dx + s * dy, c * ex + s * ey, boxes[i, LENGTH])
    beside = _intersect_slab(c * dy - s * dx, c * ey - s * ex, boxes[i, WIDTH])
    above = _intersect_slab(origin[2] - boxes[i, Z], direction[2], boxes[i, HEIGHT])
    # The ray is in the box where it is in all three slabs.
    near = max(ahead[0], beside[0], above[0])
    far = min(ahead[1], beside[1], above[1])
    t = near if near >= 0.0 else far
    return t if near <= far and t >= 0.0 else -1.0


@njit_inline
def is_box_near(boxes: Floats, carrier_id: Int, point: Floats, radius: float) -> bool:
    """Return whether a box other than the carrier's may be within ``radius`` m."""
    for i in range(len(boxes)):
        dx, dy = point[0] - boxes[i, X], point[1] - boxes[i, Y]
        reach = radius + boxes[i, FOOTPRINT_RADIUS]
        if dx * dx + dy * dy <= reach * reach and boxes[i, BOX_ID] != carrier_id:
            return True
    return False


@njit_inline
def box_incidence(
    boxes: Floats, box_id: Int, origin: Floats, direction: Floats, t: float
) -> float:
    """Return the cosine between a ray and the normal of the box face that it hit.

    Args:
        boxes: (B, 10), from ``Boxes.table``.
        box_id: Id of the box that was hit.
        origin: (3,) m.
        direction: (3,) unit vector.
        t: Distance of the hit, m.
    """
    cosine = 0.0
    for i in range(len(boxes)):
        if boxes[i, BOX_ID] != box_id:
            continue
        c, s = boxes[i, COS], boxes[i, SIN]
        x = origin[0] + t * direction[0] - boxes[i, X]
        y = origin[1] + t * direction[1] - boxes[i, Y]
        z = origin[2] + t * direction[2] - boxes[i, Z]
        # The hit point is on the face to whose plane it is nearest.
        ahead = abs(abs(c * x + s * y) - boxes[i, LENGTH])
        beside = abs(abs(c * y - s * x) - boxes[i, WIDTH])
        above = abs(abs(z) - boxes[i, HEIGHT])
        if ahead <= beside and ahead <= above:
            cosine = abs(c * direction[0] + s * direction[1])
        elif beside <= above:
            cosine = abs(c * direction[1] - s * direction[0])
        else:
            cosine = abs(direction[2])
    return cosine


class BoxIndex(NamedTuple):
    """Boxes by direction.

    Attributes:
        place: (3,) x and y of the middle of the group of rays, m, and the square of its
            radius; negative while there is none.
        heads: (SECTORS + 1,) int32, the first link of each sector's list, and that of
            the list of boxes that any ray may meet; -1 for an empty list.
        links: (L, 2) int32, the index of a box, and the next link; -1 for none.
    """

    place: Floats
    heads: NDArray[np.int32]
    links: NDArray[np.int32]


@njit_cached
def new_box_index(count: int) -> BoxIndex:
    """Allocate an empty index for a number of boxes."""
    links = np.zeros((count * MAX_SPAN, 2), np.int32)
    return BoxIndex(np.full(3, -1.0), np.zeros(SECTORS + 1, np.int32), links)


@njit_inline
def _sector(x: float, y: float) -> Int:
    """Return the sector of a direction; x and y must not both be 0."""
    slope = x / (abs(x) + abs(y))
    turn = 1.0 - slope if y >= 0.0 else 3.0 + slope
    return min(np.int64(turn * (SECTORS / 4)), np.int64(SECTORS - 1))


@njit_inline
def _span(dx: float, dy: float, radius: float) -> tuple[Int, Int]:
    """Return the first sector that a circle covers, seen from the origin, and how many.

    One that covers too many is in the list after those of the sectors.
    """
    square = dx * dx + dy * dy - radius * radius
    # Not from within, or nearly so; and not where numbers overflow.
    if not 0.01 * radius * radius < square < MAX_SQUARE:
        return SECTORS, 1
    # Both tangents to the circle, and one sector more on either side.
    tangent = np.sqrt(square)
    first = _sector(dx * tangent + dy * radius, dy * tangent - dx * radius) - 1
    last = _sector(dx * tangent - dy * radius, dy * tangent + dx * radius) + 1
    count = last - first + 1
    if count <= 0:
        count += SECTORS
    return (first, count) if count <= MAX_SPAN else (SECTORS, 1)


@njit_inline
def index_boxes(
    index: BoxIndex, boxes: Floats, x: float, y: float, spread: float, rays: Int
) -> None:
    """Sort the boxes for rays that start around a place, if that pays off.

    Args:
        index: From ``new_box_index``.
        boxes: (B, 10), from ``Boxes.table``.
        x: Of the place, m, relative to the scene's centre.
        y: Likewise.
        spread: How far from there the rays start at most, m.
        rays: Their number.
    """
    index.place[2] = -1.0
    if len(boxes) >= MIN_BOXES and rays >= MIN_RAYS:
        index.place[0], index.place[1] = x, y
        radius = spread + SLACK
        index.place[2] = radius * radius
        # Rounding errors of coordinates are less than the slack by far.
        radius += SLACK
        heads, links, link = index.heads, index.links, 0
        # Links are written over from the first on: no memory is allocated for a scan.
        for sector in range(SECTORS + 1):
            heads[sector] = -1
        for i in range(len(boxes)):
            dx, dy = boxes[i, X] - x, boxes[i, Y] - y
            first, count = _span(dx, dy, boxes[i, FOOTPRINT_RADIUS] + radius)
            for k in range(first, first + count):
                sector = k if first == SECTORS else k & (SECTORS - 1)
                links[link, 0], links[link, 1] = i, heads[sector]
                heads[sector] = link
                link += 1


@njit_inline
def index_boxes_around(
    index: BoxIndex, boxes: Floats, origins: Floats, centre: Floats, first: Int
) -> Int:
    """Sort the boxes for the rays from one row on that start close together.

    Args:
        index: From ``new_box_index``.
        boxes: (B, 10), from ``Boxes.table``.
        origins: (N, 3) m, map frame, where the rays start.
        centre: (3,) m, the scene's centre.
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
    x, y = x - centre[0], y - centre[1]
    index_boxes(index, boxes, x, y, np.sqrt(widest), end - first)
    return end


@njit_inline
def _is_indexed(index: BoxIndex, origin: Floats, direction: Floats) -> bool:
    """Return whether the index holds for a ray."""
    dx, dy = origin[0] - index.place[0], origin[1] - index.place[1]
    is_level = abs(direction[0]) + abs(direction[1]) > MIN_HORIZONTAL
    return bool(is_level and dx * dx + dy * dy <= index.place[2])


@njit_inline
def intersect_boxes(
    index: BoxIndex,
    boxes: Floats,
    carrier_id: Int,
    origin: Floats,
    direction: Floats,
    max_range: float,
) -> tuple[float, int]:
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
    is_indexed = index.place[2] >= 0.0 and _is_indexed(index, origin, direction)
    # Follow the list of the ray's sector, and then that of boxes in all directions; or
    # count down all boxes.
    is_last = not is_indexed
    k: Int = len(boxes) - 1
    if is_indexed:
        k = np.int64(index.heads[_sector(direction[0], direction[1])])
    nearest = max_range
    found: Int = -1
    while k >= 0 or not is_last:
        if k < 0:
            is_last, k = True, np.int64(index.heads[SECTORS])
            continue
        i: Int = k
        k -= 1
        if is_indexed:
            k, i = np.int64(index.links[i, 1]), np.int64(index.links[i, 0])
        if boxes[i, BOX_ID] == carrier_id:
            continue
        t = intersect_box(boxes, i, origin, direction)
        if t >= 0.0 and (t < nearest or (t == nearest and i > found)):
            nearest, found = t, i
    return nearest, int(boxes[found, BOX_ID]) if found >= 0 else -1
