"""The state of all robots as one table, which kernels read and write.

A row is a robot; the columns are numbered here. Whole numbers and truth values are
floats too, so that kernels need only one array for all.
"""

from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_inline

# Pose on the floor, m, rad, map frame; speeds of the wheels, rad/s, and angles that
# they turned forward since the spawn, rad.
X, Y, YAW, LEFT_SPIN, RIGHT_SPIN, LEFT_ANGLE, RIGHT_ANGLE = range(7)
# Whether the last move did not end at the wanted pose; m: no wall is closer, no other
# robot is closer.
BLOCKED, WALL_GAP, ROBOT_GAP = range(7, 10)
# First of six: start and wanted pose of the last move that walls forbade, nan if none.
REJECTED: Final = 10
# z of the floor and of the top, half length and half width, radius around all, m.
BOTTOM, TOP, HALF_LENGTH, HALF_WIDTH, RADIUS = range(16, 21)
# m, m; highest speed of the centre, pushes included, m/s.
TRACK, WHEEL_RADIUS, TOP_SPEED = range(21, 24)
# Number of the floor; counts the robots in the order of spawning, from 1 on.
FLOOR, NUMBER = range(24, 26)
# Whether the robot was blocked or touches something, UNKNOWN until that is asked for.
TOUCHED: Final = 26
BODY_Z: Final = 27  # z of the body frame, m
COLUMNS: Final = 28

UNKNOWN: Final = -1.0

# x, y and yaw, m, rad, map frame: a ``Pose2`` as kernels have it.
Place: TypeAlias = tuple[float, float, float]

MAX_DISPLACEMENT_RATIO: Final = 2.0  # of a centre, by the sweep of a move


def new_columns(rows: int) -> Floats:
    """Return the table of robots that are not set up, (``rows``, ``COLUMNS``)."""
    columns = np.zeros((rows, COLUMNS))
    columns[:, REJECTED : REJECTED + 6] = np.nan
    columns[:, TOUCHED] = UNKNOWN
    return columns


@njit_inline
def pose_of(robots: Floats, slot: Int) -> Place:
    """Return x, y and yaw of a robot."""
    return robots[slot, X], robots[slot, Y], robots[slot, YAW]
