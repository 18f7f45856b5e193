"""Upright boxes that stop every ray: robots, which move while the scene is fixed.

Theory of operation
===================
Seen from above, a grid of square cells covers all boxes. Each cell lists the boxes
whose bounding circles reach into its square. A ray visits the cells on its way one
after the other, and tries the boxes that they list, until it has met one before the end
of a cell. Among a thousand robots in a hall it tries a dozen: row j of the
benchmarks.

Which boxes are tried cannot change what a ray meets, as long as none of those it meets
is missing: circles are wider than rounding errors by far. Where coordinates are so
large that this would not hold, and where there are too few boxes or rays for a grid to
pay off, all boxes are tried.
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
MIN_BOXES: Final = 8  # fewer are in one cell
MIN_RAYS: Final = 16  # of a call, likewise
SLACK: Final = 1e-6  # m by which boxes are listed in cells beside them
# For each box on average; it follows from the size of the cells.
MAX_LINKS: Final = 9
MAX_COORDINATE: Final = 1e5  # m; farther away, rounding errors approach the slack
MIN_SLOPE: Final = 1e-200  # along one axis; a ray with less stays in its cell


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and the id of the box.
        velocities: (B, 2) m/s, along x and y; None if nobody asks for them.

    Raises:
        EngineError: If the rows have another shape, or are not finite.
    """

    rows: Floats
    velocities: Floats | None = None
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

    def find(
        self, ids: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return which of some ids are those of boxes, (K,), and their rows, (K,)."""
        known = self.rows[:, 7].astype(np.int64)
        found = np.flatnonzero(np.isin(ids, known))
        order = np.argsort(known)
        return found, order[np.searchsorted(known, ids[found], sorter=order)]

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


class BoxGrid(NamedTuple):
    """Boxes by the cells of a grid over the x-y plane.

    Attributes:
        x: Of the lower corner, m.
        y: Likewise.
        per_metre: Cells per metre, along both axes.
        columns: The number of cells along x.
        rows: The number of cells along y.
        heads: (columns * rows + 1,) int32, where the list of each cell begins, row by
            row; the last is where the last list ends.
        links: (L,) int32, the lists: indices of boxes; there is more room than needed.
    """

    x: float
    y: float
    per_metre: float
    columns: int
    rows: int
    heads: NDArray[np.int32]
    links: NDArray[np.int32]


@njit_cached
def new_box_grid(boxes: Floats, rays: int) -> BoxGrid:
    """Sort boxes into the cells of a grid; into a single cell if more do not pay off.

    Args:
        boxes: (B, 10), from ``Boxes.table``.
        rays: The number of rays that are going to be traced.
    """
    left, right, low, high, size = _bound(boxes)
    if len(boxes) < MIN_BOXES or rays < MIN_RAYS or size == np.inf:
        left = right = low = high = 0.0
        size = np.inf
    columns, rows = int((right - left) / size) + 1, int((high - low) / size) + 1
    heads = np.zeros(columns * rows + 1, np.int32)
    links = np.zeros(MAX_LINKS * len(boxes), np.int32)
    grid = BoxGrid(left, low, 1.0 / size, columns, rows, heads, links)
    _list_boxes(grid, boxes)
    return grid


@njit_inline
def _bound(boxes: Floats) -> tuple[float, float, float, float, float]:
    """Return the bounds of all boxes along x and y, and the size of the cells, m.

    The size is infinite where coordinates are too large.
    """
    squares = 0.0
    left = low = np.inf
    right = high = -np.inf
    for i in range(len(boxes)):
        # Twice the slack: a ray that misses the grid misses its boxes by one.
        x, y, radius = (
            boxes[i, X],
            boxes[i, Y],
            boxes[i, FOOTPRINT_RADIUS] + 2.0 * SLACK,
        )
        left, right = min(left, x - radius), max(right, x + radius)
        low, high = min(low, y - radius), max(high, y + radius)
        squares += radius * radius
    size = np.inf
    if max(-left, right, -low, high) <= MAX_COORDINATE:
        # As many cells as boxes, and none shorter than the boxes in the mean: in both
        # axes, a circle of radius r reaches into 2 r / size + 2 cells at most.
        area, longest = (right - left) * (high - low), max(right - left, high - low)
        count = len(boxes)
        size = max(np.sqrt(max(area, 4.0 * squares) / count), longest / count)
    return left, right, low, high, size


@njit_inline
def _cell(offset: float, cells: int) -> int:
    """Return the cell, along one axis, at an offset from the corner, in cells."""
    return int(min(max(0.0, offset), cells - 1.0))


@njit_inline
def _cells_around(
    grid: BoxGrid, x: float, y: float, radius: float
) -> tuple[int, int, int, int]:
    """Return the first and last column, and row, into which a circle may reach."""
    x, y = (x - grid.x) * grid.per_metre, (y - grid.y) * grid.per_metre
    radius *= grid.per_metre
    return (
        _cell(x - radius, grid.columns),
        _cell(x + radius, grid.columns),
        _cell(y - radius, grid.rows),
        _cell(y + radius, grid.rows),
    )


@njit_inline
def _list_boxes(grid: BoxGrid, boxes: Floats) -> None:
    """Fill ``heads`` and ``links``."""
    heads = grid.heads
    # First, heads count the boxes of cells; then, lists are filled from their ends.
    for is_filling in (False, True):
        for i in range(len(boxes)):
            x, y, radius = boxes[i, X], boxes[i, Y], boxes[i, FOOTPRINT_RADIUS] + SLACK
            left, right, low, high = _cells_around(grid, x, y, radius)
            for row in range(low, high + 1):
                for column in range(left, right + 1):
                    cell = row * grid.columns + column
                    heads[cell] += -1 if is_filling else 1
                    if is_filling:
                        grid.links[heads[cell]] = i
        if not is_filling:
            for cell in range(1, len(heads)):
                heads[cell] += heads[cell - 1]


@njit_inline
def is_box_near(
    grid: BoxGrid, boxes: Floats, carrier_id: Int, point: Floats, radius: float
) -> bool:
    """Return whether a box other than the carrier's may be within ``radius`` m."""
    left, right, low, high = _cells_around(grid, point[0], point[1], radius)
    for row in range(low, high + 1):
        first = grid.heads[row * grid.columns + left]
        for k in range(first, grid.heads[row * grid.columns + right + 1]):
            i = grid.links[k]
            dx, dy = point[0] - boxes[i, X], point[1] - boxes[i, Y]
            reach = radius + boxes[i, FOOTPRINT_RADIUS]
            if dx * dx + dy * dy <= reach * reach and boxes[i, BOX_ID] != carrier_id:
                return True
    return False


@njit_inline
def _enter_grid(grid: BoxGrid, x: float, y: float, ex: float, ey: float) -> float:
    """Return where a ray enters the grid, m; inf if it does not.

    Args:
        grid: The boxes' grid.
        x: Where the ray starts, cells from the corner.
        y: Likewise.
        ex: Of its direction, cells per metre.
        ey: Likewise.
    """
    half_x, half_y = 0.5 * grid.columns, 0.5 * grid.rows
    if abs(x - half_x) <= half_x and abs(y - half_y) <= half_y:
        return 0.0
    ahead = _intersect_slab(x - half_x, ex, half_x)
    beside = _intersect_slab(y - half_y, ey, half_y)
    enter = max(ahead[0], beside[0], 0.0)
    return enter if enter <= min(ahead[1], beside[1]) else np.inf


@njit_inline
def _first_border(start: float, slope: float, cell: int) -> tuple[float, float, int]:
    """Return how a ray leaves cells along one axis; arguments as in ``_enter_grid``.

    Returns:
        Where the ray crosses the first border, m; the distance from there to the next,
        m; and the step from one cell to the next.
    """
    if abs(slope) < MIN_SLOPE:
        return np.inf, np.inf, 0
    inverse, is_forward = 1.0 / slope, slope > 0.0
    step = 1 if is_forward else -1
    return (cell + is_forward - start) * inverse, abs(inverse), step


@njit_inline
def intersect_boxes(
    grid: BoxGrid,
    boxes: Floats,
    carrier_id: Int,
    origin: Floats,
    direction: Floats,
    max_range: float,
) -> tuple[float, int]:
    """Find the nearest surface of all boxes but the carrier's.

    Where boxes touch, the one listed last in the table is met.

    Args:
        grid: The boxes' grid.
        boxes: (B, 10), from ``Boxes.table``.
        carrier_id: Id of the box that does not count; -1 for none.
        origin: (3,) m.
        direction: (3,) unit vector.
        max_range: m.

    Returns:
        The distance, m, at most ``max_range``; and the box's id, -1 for none.
    """
    nearest = max_range
    found: Int = -1
    # Without a way through the grid, one step goes through the lists of all cells.
    cell = column = row = step_x = step_y = 0
    end = len(grid.heads) - 1
    next_x = next_y = apart_x = apart_y = np.inf
    if end > 1 and max(abs(origin[0]), abs(origin[1])) <= MAX_COORDINATE:
        each = grid.per_metre
        x, y = (origin[0] - grid.x) * each, (origin[1] - grid.y) * each
        ex, ey = direction[0] * each, direction[1] * each
        enter = _enter_grid(grid, x, y, ex, ey)
        if enter > max_range:
            return max_range, -1
        column = _cell(x + enter * ex, grid.columns)
        row = _cell(y + enter * ey, grid.rows)
        next_x, apart_x, step_x = _first_border(x, ex, column)
        next_y, apart_y, step_y = _first_border(y, ey, row)
        cell = row * grid.columns + column
        end = cell + 1
    while True:
        for k in range(grid.heads[cell], grid.heads[end]):
            i = np.int64(grid.links[k])
            if boxes[i, BOX_ID] == carrier_id:
                continue
            t = intersect_box(boxes, i, origin, direction)
            if t >= 0.0 and (t < nearest or (t == nearest and i > found)):
                nearest, found = t, i
        # The boxes of the cells beyond are farther than where this one ends.
        if nearest <= min(next_x, next_y):
            break
        if next_x < next_y:
            column += step_x
            next_x += apart_x
        else:
            row += step_y
            next_y += apart_y
        if not (0 <= column < grid.columns and 0 <= row < grid.rows):
            break
        cell = row * grid.columns + column
        end = cell + 1
    return nearest, int(boxes[found, BOX_ID]) if found >= 0 else -1
