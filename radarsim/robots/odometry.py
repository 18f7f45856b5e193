"""Wheel odometry: where robots would be if their wheels never slipped."""

import math
from typing import TYPE_CHECKING, Final

from radarsim.geometry import Floats, Pose2
from radarsim.jit import njit_inline
from radarsim.robots.fleet_columns import LEFT_ANGLE, RIGHT_ANGLE, WHEEL_RADIUS

if TYPE_CHECKING:
    from radarsim.robots.robot import Robot

# Columns of the table of odometry: slot of the robot, or FREE; distance between its
# left and right wheels, m; pose since the reset, m, rad; angles of the wheels at the
# pose, rad.
SLOT, SEPARATION, POSE_X, POSE_Y, POSE_YAW, POSE_LEFT, POSE_RIGHT = range(7)
ODOMETRY_COLUMNS = 7
FREE: Final = -1.0  # of a row without odometry


class WheelOdometry:
    """The odometry of one robot, which its fleet integrates in each step.

    Attributes:
        robot: The robot.
        row: Its row in the fleet's table of odometry, in which it stays.
    """

    def __init__(self, robot: "Robot", row: int) -> None:
        self.robot = robot
        self.row = row

    @property
    def pose(self) -> Pose2:
        """Pose relative to that of the spawn or reset, m and rad, not wrapped."""
        return Pose2(*self._numbers[POSE_X : POSE_YAW + 1].tolist())

    def reset(self) -> None:
        """Make the pose of the last step the new origin."""
        self._numbers[POSE_X : POSE_YAW + 1] = 0.0

    @property
    def _numbers(self) -> Floats:
        numbers: Floats = self.robot.fleet.odometry[self.row]
        return numbers


@njit_inline
def integrate_odometry(odometry: Floats, robots: Floats) -> None:
    """Advance all odometry to the present angles of the wheels.

    The motion since the last step is one circular arc, which is exact as long as the
    wheel speeds are constant in between.
    """
    for row in range(len(odometry)):
        slot = int(odometry[row, SLOT])
        if slot < 0:
            continue
        left, right = robots[slot, LEFT_ANGLE], robots[slot, RIGHT_ANGLE]
        left_turn = left - odometry[row, POSE_LEFT]
        right_turn = right - odometry[row, POSE_RIGHT]
        if left_turn == 0.0 and right_turn == 0.0:
            continue
        left_distance = robots[slot, WHEEL_RADIUS] * left_turn
        right_distance = robots[slot, WHEEL_RADIUS] * right_turn
        turn = (right_distance - left_distance) / odometry[row, SEPARATION]
        half = turn / 2
        chord = (left_distance + right_distance) / 2
        chord *= math.sin(half) / half if half != 0.0 else 1.0
        heading = odometry[row, POSE_YAW] + half
        odometry[row, POSE_X] += chord * math.cos(heading)
        odometry[row, POSE_Y] += chord * math.sin(heading)
        odometry[row, POSE_YAW] += turn
        odometry[row, POSE_LEFT] = left
        odometry[row, POSE_RIGHT] = right
