"""Searches on grids, and the rule of passage: where a robot may be, at what cost.

The robot's centre keeps the safety distance from what blocks robots, so a passage is
wide enough if twice the safety distance, and what the sensor and the cells blur, fits
in. Where there is room, paths keep farther away. All planners that work on grids follow
this rule, so that what one of them can reach is what all can reach.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.engine import engine
from radarsim.geometry import Floats

COSTLY: Final = 0.4  # m beyond the safety distance, where a step costs more
COSTLY_FACTOR: Final = 3.0  # added at its inner edge to the cost of a step, which is 1
CHEAP: Final = 2.0  # cost of a step that a short cut may lead over
ESCAPE_RADIUS: Final = 1.0  # m around a robot that is too near to something
ESCAPE_COST: Final = 10.0


def step_cost(clearance: Floats, safety_distance: float) -> Floats:
    """Return the cost of a step of one cell into each; inf where none may be made.

    Args:
        clearance: (R, C) m from the centre of each cell to the nearest centre of a cell
            that blocks robots; inf if that is far away.
        safety_distance: m from the robot's centre.

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
    """Return the cheapest path from a cell to any of the targets, over all 8 neighbors.

    Args:
        cost: (R, C) cost of a step of one cell into each; inf for closed cells.
        start: Row and column, closed or not.
        targets: (R, C).

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
    """Return the cost of the cheapest path from a cell to each, (R, C).

    Args:
        cost: (R, C) cost of a step of one cell into each; inf for closed cells.
        start: Row and column, closed or not.
    """
    return _search(cost, start, np.zeros(cost.shape, np.bool_))[2]


def flood_fill(passable: NDArray[np.bool_], start: Cell) -> NDArray[np.bool_]:
    """Return all cells connected with the start, which is one of them, (R, C)."""
    cells = passable.copy()
    cells[start] = True
    labels, _ = ndimage.label(cells, _EIGHT_NEIGHBORS)
    return np.asarray(labels == labels[start])


def may_join_outside(passable: NDArray[np.bool_], start: Cell, end: Cell) -> bool:
    """Return whether two cells are joined with the border, and not with each other.

    Then a path between them may lead around what the grid shows. To an end that is
    closed nothing leads.
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
    """Visit cells by cost until one is a target.

    Unlike ``scipy.sparse.csgraph`` it stops at the first target, needs no graph, and
    always chooses the same of several paths of equal cost.

    Returns:
        The number of the target, or -1; the number of the cell before each, and the
        cost of the path to each.
    """
    parents, best = np.full(cost.shape, -1, np.int64), np.full(cost.shape, np.inf)
    end = engine.search_grid(cost, *start, targets, parents, best)
    return end, parents, best
