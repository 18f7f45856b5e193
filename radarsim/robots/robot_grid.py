"""The robots near a place, from a grid of square cells.

Cells are found by a hash of their place, so that the floor may be of any size. Robots
are entered once in each step, and cells are searched a little farther than asked for,
as robots move within the step.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.robots.fleet_columns import RADIUS, TOP_SPEED, X, Y

ROBOT_RANGE: Final = 4.0  # m between the circles of two robots that find each other
COLUMN, ROW, NEXT = range(3)  # columns of ``places``
CELL, REACH, MAX_SPEED = range(3)  # items of ``limits``

_MIN_CELL: Final = 2.0  # m
_CELLS_IN_REACH: Final = 3


class RobotGrid(NamedTuple):
    """Robots by cells.

    N is the number of rows of the table of robots, B a power of two.

    Attributes:
        heads: (B,) slot of the first robot of each bucket of cells; -1 for none.
        places: (N, 3) column and row of each robot's cell, and the slot of the next
            robot in the same bucket; -1 for none.
        limits: (3,) size of a cell, m; how far cells are searched on each axis, beyond
            the radius of the robot that searches, m; the highest top speed, m/s.
    """

    heads: NDArray[np.int64]
    places: NDArray[np.int64]
    limits: Floats


def new_robot_grid(slots: int) -> RobotGrid:
    """Return a grid for robots in some slots."""
    buckets = 1 << slots.bit_length()
    places = np.zeros((slots, 3), np.int64)
    return RobotGrid(np.full(buckets, -1, np.int64), places, np.zeros(3))


@njit_inline
def bucket_of(grid: Any, column: Any, row: Any) -> Any:
    """Return the bucket of a cell."""
    return (column * 73856093 ^ row * 19349663) & (len(grid.heads) - 1)


@njit_inline
def enter_robots(grid: Any, robots: Any, order: Any, dt: Any) -> Any:
    """Enter all robots where they are.

    Args:
        grid: The ``RobotGrid``.
        robots: The table of robots.
        order: (R,) slots of the robots.
        dt: Longest time for which robots drive before they are entered again, s.
    """
    for bucket in range(len(grid.heads)):
        grid.heads[bucket] = -1
    radius = speed = 0.0
    for i in range(len(order)):
        radius = max(radius, robots[order[i], RADIUS])
        speed = max(speed, robots[order[i], TOP_SPEED])
    reach = ROBOT_RANGE + radius + speed * dt  # they move before they are searched
    cell = max(_MIN_CELL, reach / _CELLS_IN_REACH)
    grid.limits[CELL], grid.limits[REACH] = cell, reach
    grid.limits[MAX_SPEED] = speed
    for i in range(len(order)):
        slot = order[i]
        column = math.floor(robots[slot, X] / cell)
        row = math.floor(robots[slot, Y] / cell)
        bucket = bucket_of(grid, column, row)
        grid.places[slot, COLUMN] = column
        grid.places[slot, ROW] = row
        grid.places[slot, NEXT] = grid.heads[bucket]
        grid.heads[bucket] = slot
