"""The odometry of one robot, as its fleet integrates it."""

from typing import NamedTuple

from radarsim.geometry import Pose2
from radarsim.robots.robot import Robot


class WheelOdometry(NamedTuple):
    """A row in the table of a fleet."""

    robot: Robot
    row: int

    @property
    def pose(self) -> Pose2:
        """Pose relative to that of the start, m and rad, not wrapped."""
        _, _, x, y, yaw, *_ = self.robot.fleet.odometry[self.row].item()
        return Pose2(x, y, yaw)


def add_odometry(robot: Robot) -> WheelOdometry:
    return WheelOdometry(robot, robot.fleet.add_odometry(robot))
