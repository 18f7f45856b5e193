"""The odometry of wheels; ``motion.hpp`` drives the robots."""

from typing import TYPE_CHECKING, Final

from radarsim.geometry import Floats, Pose2

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
