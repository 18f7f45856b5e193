"""Searches for paths on grids, and the cost of driving near obstacles.

The robot's centre keeps the safety distance from obstacles, so a passage has to be
twice the safety distance wide, plus the errors of the sensor and of the cell size.
Where there is space, paths keep farther away from obstacles. All grid planners use the
same costs, so they all reach the same cells.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.engine import engine
from radarsim.geometry import Floats

COSTLY: Final = 0.4  # m beyond the safety distance in which a step costs more
COSTLY_FACTOR: Final = 3.0  # extra cost of a step at the inner edge
CHEAP: Final = 2.0  # highest cost of a step on a straight short cut
ESCAPE_RADIUS: Final = 1.0  # m around a robot that is too close to an obstacle
ESCAPE_COST: Final = 10.0


def step_cost(clearance: Floats, safety_distance: float) -> Floats:
    """Return what a step into each cell costs; inf for cells that are closed.

    Args:
        clearance: (R, C) m from the centre of each cell to the nearest centre of a
            blocked cell; inf if none is near.
        safety_distance: Safety distance from the robot's centre, m.

    Returns:
        (R, C).
    """
    depth = np.clip(1 - (clearance - safety_distance) / COSTLY, 0.0, 1.0)
    cost: Floats = 1.0 + COSTLY_FACTOR * depth
    return np.where(clearance < safety_distance, math.inf, cost)


Cell = tuple[int, int]

_EIGHT_NEIGHBORS = np.ones((3, 3), np.bool_)


def shortest_path(
    cost: Floats, start: Cell, targets: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the cheapest path from a cell to any target cell, with 8 neighbors each.

    Args:
        cost: (R, C) cost of a step of one cell into each cell; inf for closed cells.
        start: Row and column of the start, which may be closed.
        targets: (R, C), true for target cells.

    Returns:
        (N, 2) rows and columns, both ends included; N is 0 if there is no path, and 1
        if the start is a target.
    """
    end, parents, _ = _search(cost, start, targets)
    path = []
    while end >= 0:
        row, column = divmod(int(end), cost.shape[1])
        path.append((row, column))
        end = parents[row, column] if (row, column) != start else -1
    return np.array(path[::-1], np.int64).reshape(-1, 2)


def path_costs(cost: Floats, start: Cell) -> Floats:
    """Return the cost of the cheapest path from a start cell to each cell, (R, C).

    Args:
        cost: (R, C) cost of a step of one cell into each cell; inf for closed cells.
        start: Row and column of the start, which may be closed.
    """
    return _search(cost, start, np.zeros(cost.shape, np.bool_))[2]


def flood_fill(passable: NDArray[np.bool_], start: Cell) -> NDArray[np.bool_]:
    """Return a mask, (R, C), of the start and of all cells connected with it."""
    cells = passable.copy()
    cells[start] = True
    labels, _ = ndimage.label(cells, _EIGHT_NEIGHBORS)
    return np.asarray(labels == labels[start])


def may_join_outside(passable: NDArray[np.bool_], start: Cell, end: Cell) -> bool:
    """Return whether two cells connect to the border, but not to each other.

    If so, a path between the cells may lead around the area of the grid. A closed end
    cell cannot be reached, so the result is False.
    """
    border = np.ones(passable.shape, np.bool_)
    border[1:-1, 1:-1] = False
    from_start, from_end = (flood_fill(passable, each) for each in (start, end))
    if from_start[end] or not passable[end]:
        return False
    return bool((from_start & border).any() and (from_end & border).any())


def _search(
    cost: Floats, start: Cell, targets: NDArray[np.bool_]
) -> tuple[int, NDArray[np.int64], Floats]:
    """Visit cells in order of their path cost until a target cell is reached.

    Unlike ``scipy.sparse.csgraph``, the search stops at the first target, needs no
    graph, and always returns the same path of several with equal cost.

    Returns:
        The number of the target, or -1; the number of the previous cell of each cell,
        and the cost of the path to each cell.
    """
    parents, best = np.full(cost.shape, -1, np.int64), np.full(cost.shape, np.inf)
    end = engine.search_grid(cost, *start, targets, parents, best)
    return end, parents, best
