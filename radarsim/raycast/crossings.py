"""Where a line crosses triangles: float64, and the same answer from all sides.

Theory of operation
===================
A line is looked at along itself: points are sheared so that it becomes the third
axis, and a triangle is crossed if the origin lies inside its shadow on the plane of
the first two axes. The origin is inside where it is on the same side of all three
edges, and how deep the line is there follows from the depths of the corners.

Rule 1: every corner is sheared by itself, by the same operations, so that it has one
shadow, whichever triangle asks.
Rule 2: the side of an edge is the sign of a difference of two products. Rounding
never turns that sign round, it can only make it zero; seen from the triangle on the
other side of the edge it is the exact opposite.
Rule 3: where it is zero, the line goes through the edge. It is taken to pass beside
it, by an infinitely small step along the first axis and a still smaller one along the
second, the same for all triangles (simulation of simplicity).
Therefore a line through an edge or a corner crosses one triangle of a surface, not
two or none; and along any line a closed surface is entered as often as left, exactly.
Rule 4: the depth is a mean of the corners' depths with weights of one sign, so that no
grazing line finds a crossing outside the triangle.
"""

from typing import Any, Final

import numpy as np

from radarsim.jit import njit_inline

LINE_SIZE: Final = 6  # numbers that say where a line is
AXES_SIZE: Final = 3  # which axis of space is the line's first, second, third
# How far a line passes beside an edge that it goes through. That has to be less than
# any distance there is, so distances that are next to nothing are taken for nothing:
# of numbers above ``TINY``, no difference of products is below 1e-210.
BARELY: Final = 1e-290
TINY: Final = 1e-30


@njit_inline
def _tidy(number: Any) -> Any:
    return 0.0 if abs(number) < TINY else number


@njit_inline
def aim(origin: Any, direction: Any, line: Any, axes: Any) -> None:
    """Write down a line for ``cross``.

    Args:
        origin: (3,) m, where depths count from.
        direction: (3,) unit vector.
        line: (6,) to be filled: the origin, two shears and the stretch of the depth.
        axes: (3,) unsigned integers, to be filled.
    """
    third = 0
    if abs(direction[1]) > abs(direction[third]):
        third = 1
    if abs(direction[2]) > abs(direction[third]):
        third = 2
    first, second = (third + 1) % 3, (third + 2) % 3
    axes[0], axes[1], axes[2] = first, second, third
    line[0], line[1] = _tidy(origin[first]), _tidy(origin[second])
    line[2] = _tidy(origin[third])
    stretch = 1.0 / direction[third]
    line[3] = _tidy(direction[first] * stretch)
    line[4] = _tidy(direction[second] * stretch)
    line[5] = stretch


@njit_inline
def _side(ax: Any, ay: Any, bx: Any, by: Any) -> Any:
    """Say on which side of the edge from a to b the line passes, and how far."""
    area = ax * by - ay * bx
    if area != 0.0:
        return area
    ahead, behind = (ay, by) if ay != by else (bx, ax)
    if ahead == behind:
        return 0.0
    return BARELY if ahead > behind else -BARELY


@njit_inline
def cross(line: Any, axes: Any, corners: Any) -> Any:
    """Cross one triangle.

    Args:
        line: From ``aim``.
        axes: From ``aim``.
        corners: (9,) m, x, y, z of one corner after the other; none of them below
            ``TINY`` but 0.

    Returns:
        1 if the line goes in by the front, -1 if it comes out by the back, 0 if it
        passes by; and how far along the line, m.
    """
    first, second, third = axes[0], axes[1], axes[2]
    az = corners[third] - line[2]
    bz = corners[third + 3] - line[2]
    cz = corners[third + 6] - line[2]
    ax = corners[first] - line[0] - line[3] * az
    bx = corners[first + 3] - line[0] - line[3] * bz
    cx = corners[first + 6] - line[0] - line[3] * cz
    ay = corners[second] - line[1] - line[4] * az
    by = corners[second + 3] - line[1] - line[4] * bz
    cy = corners[second + 6] - line[1] - line[4] * cz
    a, b, c = _side(bx, by, cx, cy), _side(cx, cy, ax, ay), _side(ax, ay, bx, by)
    whole = a + b + c
    if whole == 0.0 or (min(a, b, c) < 0.0 and max(a, b, c) > 0.0):
        return 0, 0.0
    t = line[5] * ((a * az + b * bz + c * cz) / whole)
    return (-1 if (whole > 0.0) == (line[5] > 0.0) else 1), t


# Section from raycast.crossings.
# The surfaces that one ray meets: a list, and its order.

CROSSING: Final = np.dtype([("t", "f8"), ("part", "i4"), ("turn", "i4")])


@njit_inline
def _comes_after(one: Any, other: Any) -> Any:
    """Order by distance; where distances are equal, by part, and in before out."""
    if one.t != other.t:
        return one.t > other.t
    if one.part != other.part:
        return one.part > other.part
    return one.turn < other.turn


@njit_inline
def _swap(one: Any, other: Any) -> None:
    one.t, other.t = other.t, one.t
    one.part, other.part = other.part, one.part
    one.turn, other.turn = other.turn, one.turn


@njit_inline
def sort_crossings(crossings: Any, count: Any) -> None:
    """Sort the first ``count`` crossings in place: Shell's sort, in gaps of 3k + 1."""
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
