"""A map of points that computes their mean and covariance around any point.

Theory of operation
===================
Points are not stored, only their moments: number, sum and sum of squares, in square
cells of five sizes from 0.1 to 1.6 m. Around a point the moments of three by three
cells are summed, weighted by a quadratic B-spline, which is smooth in the position, and
give the mean of the map's points and the line along which they lie. The finest size
with enough points is used: where points are dense, as on a bush near by, a small window
follows the shape; on a far fence, where each scan leaves one point in half a metre, a
wide one averages the noise out. The cells are in a hash table with open addressing, as
few of them hold points.

A window takes in both faces of a thin wall, and where two walls meet. A point of the
map therefore counts by (1 + u . v) / 2, where u and v are the normals of its surface
and of that of the point that is compared: whole if both face the same way, not at all
if one is the back of the other. That is linear in u, so that three sets of moments give
the sum for any v: of the points, and of the points times either component of u.

Surface normals tell which way the surfaces face that the points of a scan are on.

Both faces of a wall are on a map once a robot has seen it from both sides. They are
nearer to each other than echoes of a thick beam scatter, and only the direction in
which they face tells them apart. It is that of the line through the neighbours of a
point in its scan, on the side where the scanner is.
"""

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline

Vector: TypeAlias = tuple[float, float]

FINEST: Final = 0.1  # m
LEVELS: Final = 5
MIN_WEIGHT: Final = 2.0  # of the points in a window; about eight points
LINE_RATIO: Final = 4.0  # variance along a line by that across it, at least
_MIN_ROWS: Final = 1 << 12  # rows of the table
# Columns and rows have 28 bits each, which are 13000 km of the finest cells either way.
_OFFSET: Final = 1 << 27  # makes the numbers of cells positive
# 2^64 by the golden ratio (Fibonacci hashing): keys of neighbouring cells differ by
# little, and the upper bits of the product spread them over the table.
_HASH_FACTOR: Final = np.uint64(0x9E3779B97F4A7C15)
_HASH_SHIFT: Final = np.uint64(29)


class Table(NamedTuple):
    """Hash table of cells.

    Attributes:
        keys: (C,) size and number of a cell; 0 in free rows.
        moments: (C, 3, 6) sums over the cell's points of 1, x, y, x x, x y and y y,
            relative to its center, m; once as they are, once times the x and once
            times the y of their normals.
    """

    keys: NDArray[np.int64]
    moments: Floats


class PointMap:
    """Moments of the points of all scans.

    Attributes:
        table: Table for compiled functions.
    """

    def __init__(self) -> None:
        self.table = _new_table(_MIN_ROWS)
        self._used = 0

    def __len__(self) -> int:
        """Return the number of cells that hold points."""
        return self._used

    def add(self, points: Floats, normals: Floats | None = None) -> None:
        """Add points.

        Args:
            points: (K, 2) m, map frame.
            normals: (K, 2) unit vectors into the surfaces that they are on, map frame;
                None if these are not known.
        """
        if normals is None:
            normals = np.zeros_like(points)
        # As if each point took a new cell of every size: half the rows stay free.
        rows = 2 * (self._used + LEVELS * len(points))
        if rows > len(self.table.keys):
            # A power of two, since a mask finds the rows, and more than is needed now,
            # since all cells have to be copied each time.
            table = _new_table(1 << (2 * rows - 1).bit_length())
            _copy_table(self.table, table)
            self.table = table
        self._used += _add(self.table, points, normals)


def _new_table(rows: int) -> Table:
    return Table(np.zeros(rows, np.int64), np.zeros((rows, 3, 6)))


@njit_inline
def _key(level: int, column: int, row: int) -> int:
    # Counting levels from 1 keeps 0 free, which marks a free row of the table.
    return ((level + 1) << 56) | ((column + _OFFSET) << 28) | (row + _OFFSET)


@njit_inline
def _find(keys: NDArray[np.int64], key: int) -> int:
    """Return the row of a cell, or the free row where it would be."""
    mask = len(keys) - 1
    row = int(np.int64((np.uint64(key) * _HASH_FACTOR) >> _HASH_SHIFT)) & mask
    # Linear probing; it ends because at least half of the rows are free, see ``add``.
    while keys[row] != 0 and keys[row] != key:
        row = (row + 1) & mask
    return row


@njit_cached
def _copy_table(table: Table, other: Table) -> None:
    for i in range(len(table.keys)):
        if table.keys[i] != 0:
            # The row of a cell depends on the length of the table.
            row = _find(other.keys, table.keys[i])
            other.keys[row] = table.keys[i]
            for axis in range(3):
                for column in range(6):
                    other.moments[row, axis, column] = table.moments[i, axis, column]


@njit_cached
def _add(table: Table, points: Floats, normals: Floats) -> int:
    """Add points, and return how many cells are new."""
    new = 0
    for i in range(len(points)):
        size = FINEST
        for level in range(LEVELS):
            column = math.floor(points[i, 0] / size)
            line = math.floor(points[i, 1] / size)
            key = _key(level, column, line)
            row = _find(table.keys, key)
            if table.keys[row] == 0:
                table.keys[row] = key
                new += 1
            # Relative to the cell's center: far from the map's origin, squares would
            # lose the digits that the covariance consists of.
            x, y = (
                points[i, 0] - (column + 0.5) * size,
                points[i, 1] - (line + 0.5) * size,
            )
            for k in range(3):
                factor = 1.0 if k == 0 else normals[i, k - 1]
                sums = table.moments[row, k]
                sums[0] += factor
                sums[1] += factor * x
                sums[2] += factor * y
                sums[3] += factor * x * x
                sums[4] += factor * x * y
                sums[5] += factor * y * y
            size *= 2.0  # exact, so that windows of a level meet the same cells
    return new


@njit_inline
def _spline(step: int, t: float) -> float:
    """Weight a cell ``step`` cells from that of a point ``t`` off its center."""
    # The weights of the three cells along an axis sum to one, whatever ``t`` is.
    return 0.75 - t * t if step == 0 else 0.5 * (0.5 + step * t) ** 2


@njit_inline
def _sum(moments: Floats, k: int, normal: Vector) -> float:
    """Return a moment of the points of a cell that face as a normal does."""
    nx, ny = normal
    total: float = moments[0, k] + nx * moments[1, k] + ny * moments[2, k]
    return total


@njit_inline
def _window(
    table: Table, level: int, x: float, y: float, normal: Vector
) -> tuple[float, float, float, float, float, float]:
    """Sum the moments of the cells around a point, relative to it."""
    size, nx, ny = FINEST * 2.0**level, normal[0], normal[1]
    # Half of (1 + u . v); without a normal, all points count whole.
    whole = 0.5 if nx * nx + ny * ny > 0.0 else 1.0
    column, line = math.floor(x / size), math.floor(y / size)
    tx, ty = x / size - column - 0.5, y / size - line - 0.5
    n, a, b, aa, ab, bb = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            row = _find(table.keys, _key(level, column + i, line + j))
            if table.keys[row] == 0:
                continue
            f = whole * _spline(i, tx) * _spline(j, ty)
            u, v = (i - tx) * size, (j - ty) * size
            # Moments about the point, from those about a center that is (u, v) away.
            sums = table.moments[row]
            m, p = f * _sum(sums, 0, normal), f * _sum(sums, 1, normal)
            q = f * _sum(sums, 2, normal)
            n += m
            a += p + m * u
            b += q + m * v
            aa += f * _sum(sums, 3, normal) + 2.0 * u * p + m * u * u
            ab += f * _sum(sums, 4, normal) + u * q + v * p + m * u * v
            bb += f * _sum(sums, 5, normal) + 2.0 * v * q + m * v * v
    return n, a, b, aa, ab, bb


class LocalShape(NamedTuple):
    """Distribution of the map's points around a point.

    Attributes:
        found: Whether there are enough points; otherwise the numbers are 0.
        dx: x from the point to their mean, m.
        dy: y from the point to their mean, m.
        xx: Variance along x, m².
        xy: Covariance, m².
        yy: Variance along y, m².
    """

    found: bool
    dx: float
    dy: float
    xx: float
    xy: float
    yy: float


@njit_inline
def is_line(xx: float, xy: float, yy: float) -> bool:
    """Return whether points of a covariance lie along a line."""
    half, turn = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    # Rounding can make the smaller eigenvalue negative.
    return half + turn >= LINE_RATIO * max(half - turn, 0.0)


@njit_inline
def shape_around(
    table: Table, x: float, y: float, normal: Vector = (0.0, 0.0), wider: int = 0
) -> LocalShape:
    """Return the shape of the map around a point, m.

    Args:
        table: Table of the map.
        x: m.
        y: m.
        normal: Unit vector into the surface that the point is on; zeros if not known.
        wider: How many wider windows are tried for a line, if the first shows none.
    """
    last = LEVELS - 1
    found = LocalShape(False, 0.0, 0.0, 0.0, 0.0, 0.0)
    for level in range(LEVELS):
        # From the finest size on, which follows the shape best where points are dense.
        n, a, b, aa, ab, bb = _window(table, level, x, y, normal)
        if n >= MIN_WEIGHT:
            a, b = a / n, b / n
            shape = LocalShape(
                True, a, b, aa / n - a * a, ab / n - a * b, bb / n - b * b
            )
            if is_line(shape.xx, shape.xy, shape.yy):
                return shape
            # The first window with enough points counts, unless a little wider there
            # is a line, which holds the robot in one direction only.
            if not found.found:
                found, last = shape, min(level + wider, last)
        if level == last:
            break
    return found


NEIGHBOURS: Final = 8  # points of the scan, to each side, that may count
RADIUS: Final = 0.4  # m, within which they do
MIN_NEIGHBOURS: Final = 4  # of a line, the point itself included
# Least share of a beam that is along the normal; lines nearly along the beam are the
# scatter of single points.
LEAST_FACING: Final = 0.2


def inward_normals(places: Floats, along: Floats) -> Floats:
    """Return unit vectors from points into the surfaces that they are on, (K, 2).

    Where the neighbours of a point form no line, it is the direction of the beam.

    Args:
        places: (K, 2) points of a scan in the order of their beams, m.
        along: (K, 2) unit vectors along the beams.
    """
    normals: Floats = along.copy()
    if len(places):
        _fill_normals(np.ascontiguousarray(places), along, normals)
    return normals


@njit_cached
def _fill_normals(places: Floats, along: Floats, normals: Floats) -> None:
    count = len(places)
    # Indices wrap, as scans go all around; no point may count twice in a short scan.
    side = min(NEIGHBOURS, (count - 1) // 2)
    for i in range(count):
        n, x, y, xx, xy, yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(i - side, i + side + 1):
            j = k % count
            u, v = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1]
            # Beams beside each other may end on different things, metres apart.
            if u * u + v * v < RADIUS * RADIUS:
                n += 1
                x += u
                y += v
                xx += u * u
                xy += u * v
                yy += v * v
        if n < MIN_NEIGHBOURS:
            continue
        x, y = x / n, y / n
        xx, xy, yy = xx / n - x * x, xy / n - x * y, yy / n - y * y
        if not is_line(xx, xy, yy):
            continue
        # the angle of the principal axis, across which the normal is
        angle = math.atan2(2.0 * xy, xx - yy) / 2
        nx, ny = -math.sin(angle), math.cos(angle)
        facing = nx * along[i, 0] + ny * along[i, 1]
        if abs(facing) > LEAST_FACING:
            inward = math.copysign(1.0, facing)
            normals[i, 0], normals[i, 1] = inward * nx, inward * ny
