"""The nearest of many places, and the way to it, over cells that cost more or less."""

import heapq
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached

Cell = tuple[int, int]


def shortest_path(
    cost: Floats, start: Cell, targets: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Find the cheapest way to any of some cells, to all eight neighbours of each.

    Args:
        cost: (R, C) of a step of one cell into each; inf for those that are closed.
        start: Row and column, closed or not.
        targets: (R, C).

    Returns:
        (N, 2) rows and columns, both ends included; N is 0 if there is no way, and 1
        if the start is a target.
    """
    parents = np.full(cost.shape, -1, np.int64)
    end = _spread(cost, start[0], start[1], targets, parents)
    way = []
    while end >= 0:
        row, column = divmod(int(end), cost.shape[1])
        way.append((row, column))
        end = parents[row, column] if (row, column) != start else -1
    return np.array(way[::-1], np.int64).reshape(-1, 2)


def flood_fill(passable: NDArray[np.bool_], start: Cell) -> NDArray[np.bool_]:
    """Give all cells that can be got to, the start among them, (R, C)."""
    found = np.zeros(passable.shape, np.bool_)
    _flood(passable, start[0], start[1], found)
    return found


@njit_cached
def _flood(passable: Any, row: Any, column: Any, found: Any) -> None:
    rows, columns = passable.shape
    found[row, column] = True
    waiting = [(row, column)]
    while waiting:
        i, j = waiting.pop()
        for k in range(max(i - 1, 0), min(i + 2, rows)):
            for n in range(max(j - 1, 0), min(j + 2, columns)):
                if passable[k, n] and not found[k, n]:
                    found[k, n] = True
                    waiting.append((k, n))


@njit_cached
def _spread(cost: Any, row: Any, column: Any, targets: Any, parents: Any) -> Any:
    """Visit cells in the order of their cost until one is a target; -1 for none."""
    rows, columns = cost.shape
    best = np.full((rows, columns), np.inf)
    best[row, column] = 0.0
    queue = [(0.0, np.int64(row * columns + column))]
    while queue:
        so_far, here = heapq.heappop(queue)
        i, j = here // columns, here % columns
        if so_far > best[i, j]:
            continue
        if targets[i, j]:
            return here
        for down in range(-1, 2):
            for across in range(-1, 2):
                k, n = i + down, j + across
                if not (0 <= k < rows and 0 <= n < columns):
                    continue
                total = so_far + cost[k, n] * math.sqrt(down * down + across * across)
                if total < best[k, n]:
                    best[k, n] = total
                    parents[k, n] = here
                    heapq.heappush(queue, (total, np.int64(k * columns + n)))
    return np.int64(-1)
