"""Where a line crosses triangles, in float64, and the list of a ray's crossings.

Theory of operation
===================
The triangle is seen along the line: points are sheared so that the line becomes the
third axis. The line crosses the triangle if the origin is inside the triangle's
projection onto the first two axes, which is so where it is on the same side of all
three edges. The depth of the crossing is interpolated from the depths of the corners.

Rule 1: each corner is sheared on its own by the same operations, so that it has one
projection, whichever triangle it is taken from.
Rule 2: the side of an edge is the sign of a difference of two products. Rounding can
make this difference zero, but never reverses its sign; computed for the triangle on the
other side of the edge, it is the exact opposite.
Rule 3: where it is zero, the line goes through the edge. It is treated as passing
beside the edge, displaced by an infinitesimal step along the first axis and a still
smaller one along the second, the same for all triangles (simulation of simplicity).
Hence a line through an edge or a corner crosses exactly one triangle of a surface, and
along any line a closed surface is entered as often as it is left.
Rule 4: the depth is a mean of the corners' depths with weights of one sign, so that no
grazing line is given a crossing outside the triangle.
"""

from typing import Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_inline

LINE_SIZE: Final = 6  # length of the arrays that `project_line` fills
AXES_SIZE: Final = 3
# How far a line is displaced from an edge that it goes through. This has to be less
# than any other difference of products. Therefore numbers below ``TINY`` are set to
# zero; of those above, no difference of products is below 1e-210.
INFINITESIMAL: Final = 1e-290
TINY: Final = 1e-30

# One surface that a ray crosses: its distance, m; the part that it belongs to; and its
# sign, which is added to the part's winding number: 1 on entering, -1 on leaving.
CROSSING: Final = np.dtype([("t", "f8"), ("part", "i4"), ("sign", "i4")])
Crossings: TypeAlias = NDArray[np.void]  # of CROSSING


class Crossing(Protocol):
    """A row of CROSSING, as kernels see it."""

    t: float
    part: int
    sign: int


@njit_inline
def _flush_to_zero(number: float) -> float:
    return 0.0 if abs(number) < TINY else number


@njit_inline
def project_line(
    origin: Floats, direction: Floats, line: Floats, axes: NDArray[np.uint64]
) -> None:
    """Compute the shear that makes a line the third axis, for ``cross_triangle``.

    Args:
        origin: (3,) m, where distances are zero.
        direction: (3,) unit vector.
        line: (6,) to be filled: the origin, two shear factors, and the scale of depths.
        axes: (3,) unsigned, to be filled: the axes of space in the order of projection.
    """
    # The line's steepest axis comes third: no factor below is greater than 1.
    third = 0
    if abs(direction[1]) > abs(direction[third]):
        third = 1
    if abs(direction[2]) > abs(direction[third]):
        third = 2
    first, second = (third + 1) % 3, (third + 2) % 3
    axes[0], axes[1], axes[2] = first, second, third
    line[0], line[1] = _flush_to_zero(origin[first]), _flush_to_zero(origin[second])
    line[2] = _flush_to_zero(origin[third])
    # One division for the line instead of one for each triangle.
    scale = 1.0 / direction[third]
    line[3] = _flush_to_zero(direction[first] * scale)
    line[4] = _flush_to_zero(direction[second] * scale)
    line[5] = scale


@njit_inline
def _edge_side(ax: float, ay: float, bx: float, by: float) -> float:
    """Return twice the signed area of the origin and an edge from a to b.

    The sign is the side of the edge on which the line passes; it is 0 only for an edge
    that is seen as a point.
    """
    area = ax * by - ay * bx
    if area != 0.0:
        return area
    # Rule 3: the displacement decides by the edge's extent along the other axis.
    end, start = (ay, by) if ay != by else (bx, ax)
    if end == start:
        return 0.0
    return INFINITESIMAL if end > start else -INFINITESIMAL


@njit_inline
def cross_triangle(
    line: Floats, axes: NDArray[np.uint64], corners: Floats
) -> tuple[int, float]:
    """Intersect a line with one triangle.

    Args:
        line: From ``project_line``.
        axes: From ``project_line``.
        corners: (9,) m, x, y, z of each corner in turn; 0 or at least ``TINY``.

    Returns:
        1 if the line enters by the front face, -1 if it leaves by the back face, 0 if
        it misses; and the distance along the line, m.
    """
    first, second, third = axes[0], axes[1], axes[2]
    # Unsigned, as signed indices could count from the end, which is tested each time
    # (row d of the benchmarks).
    b_first, c_first = np.uint64(3), np.uint64(6)
    az = corners[third] - line[2]
    bz = corners[third + b_first] - line[2]
    cz = corners[third + c_first] - line[2]
    ax = corners[first] - line[0] - line[3] * az
    bx = corners[first + b_first] - line[0] - line[3] * bz
    cx = corners[first + c_first] - line[0] - line[3] * cz
    ay = corners[second] - line[1] - line[4] * az
    by = corners[second + b_first] - line[1] - line[4] * bz
    cy = corners[second + c_first] - line[1] - line[4] * cz
    a = _edge_side(bx, by, cx, cy)
    b = _edge_side(cx, cy, ax, ay)
    c = _edge_side(ax, ay, bx, by)
    # The areas have one sign if the line passes all edges on the same side.
    area = a + b + c
    if area == 0.0 or (min(a, b, c) < 0.0 and max(a, b, c) > 0.0):
        return 0, 0.0
    # For a normal n and a direction d, the area has the sign of n.d / d[third], and the
    # scale that of d[third]. Where the two are equal, n.d is positive: the line leaves.
    t = line[5] * ((a * az + b * bz + c * cz) / area)
    return (-1 if (area > 0.0) == (line[5] > 0.0) else 1), t


@njit_inline
def _comes_after(one: Crossing, other: Crossing) -> bool:
    """Order by distance; at equal distances by part, and entering before leaving."""
    if one.t != other.t:
        return one.t > other.t
    if one.part != other.part:
        return one.part > other.part
    return one.sign < other.sign


@njit_inline
def _swap(one: Crossing, other: Crossing) -> None:
    one.t, other.t = other.t, one.t
    one.part, other.part = other.part, one.part
    one.sign, other.sign = other.sign, one.sign


@njit_inline
def sort_crossings(crossings: Crossings, count: Int) -> None:
    """Sort the first ``count`` crossings in place.

    This is Shell's sort with gaps of 3k + 1.
    """
    # It needs no memory, which inlined functions must not allocate; and most rays have
    # a few crossings, for which no other way is faster.
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for start in range(gap, count):
            i = start
            while i >= gap and _comes_after(crossings[i - gap], crossings[i]):
                _swap(crossings[i - gap], crossings[i])
                i -= gap
        gap //= 3
