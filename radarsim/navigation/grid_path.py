"""Shortest paths and connected cells on grids."""

import heapq
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.geometry import Floats
from radarsim.jit import njit_cached

Cell = tuple[int, int]

_EIGHT_NEIGHBORS = np.ones((3, 3), np.bool_)


def shortest_path(
    cost: Floats, start: Cell, targets: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the cheapest path from a cell to any of the targets, over all 8 neighbors.

    Args:
        cost: (R, C) cost of a step of one cell into each; inf for closed cells.
        start: Row and column, closed or not.
        targets: (R, C).

    Returns:
        (N, 2) rows and columns, both ends included; N is 0 if there is no path, and 1
        if the start is a target.
    """
    parents = np.full(cost.shape, -1, np.int64)
    end = _search(cost, start[0], start[1], targets, parents)
    path = []
    while end >= 0:
        row, column = divmod(int(end), cost.shape[1])
        path.append((row, column))
        end = parents[row, column] if (row, column) != start else -1
    return np.array(path[::-1], np.int64).reshape(-1, 2)


def flood_fill(passable: NDArray[np.bool_], start: Cell) -> NDArray[np.bool_]:
    """Return all cells connected with the start, which is one of them, (R, C)."""
    cells = passable.copy()
    cells[start] = True
    labels, _ = ndimage.label(cells, _EIGHT_NEIGHBORS)
    return np.asarray(labels == labels[start])


def may_join_outside(passable: NDArray[np.bool_], start: Cell, end: Cell) -> bool:
    """Return whether two cells are both connected with the border of the grid.

    Then a path between them may lead around what the grid shows.
    """
    border = np.ones(passable.shape, np.bool_)
    border[1:-1, 1:-1] = False
    return all((flood_fill(passable, each) & border).any() for each in (start, end))


@njit_cached
def _search(cost: Any, row: Any, column: Any, targets: Any, parents: Any) -> Any:
    """Visit cells by cost until one is a target (Dijkstra); return it, or -1.

    Unlike ``scipy.sparse.csgraph`` it stops at the first target, needs no graph, and
    always chooses the same of several paths of equal cost.
    """
    rows, columns = cost.shape
    best = np.full((rows, columns), np.inf)
    best[row, column] = 0.0
    queue = [(0.0, np.int64(row * columns + column))]
    while queue:
        so_far, cell = heapq.heappop(queue)
        i, j = cell // columns, cell % columns
        if so_far > best[i, j]:
            continue
        if targets[i, j]:
            return cell
        for di in range(-1, 2):
            for dj in range(-1, 2):
                k, n = i + di, j + dj
                if not (0 <= k < rows and 0 <= n < columns):
                    continue
                total = so_far + cost[k, n] * math.sqrt(di * di + dj * dj)
                if total < best[k, n]:
                    best[k, n] = total
                    parents[k, n] = cell
                    heapq.heappush(queue, (total, np.int64(k * columns + n)))
    return np.int64(-1)
