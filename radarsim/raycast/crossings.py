"""The surfaces that one ray meets: a list, and its order."""

from typing import Any, Final

import numpy as np

from radarsim.compiled import leaf

CROSSING: Final = np.dtype([("t", "f8"), ("part", "i4"), ("turn", "i4")])


@leaf
def _comes_after(one: Any, other: Any) -> Any:
    """Order by distance; where distances are equal, by part, and in before out."""
    if one.t != other.t:
        return one.t > other.t
    if one.part != other.part:
        return one.part > other.part
    return one.turn < other.turn


@leaf
def _swap(one: Any, other: Any) -> None:
    one.t, other.t = other.t, one.t
    one.part, other.part = other.part, one.part
    one.turn, other.turn = other.turn, one.turn


@leaf
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
