"""A robot that many tests drive."""

import pytest

from radarsim.client import RobotInfo, ScannerInfo
from radarsim.client.teleop_view import DrivenRobot
from radarsim.geometry import Pose3

SCANNER = ScannerInfo(
    name="lms200",
    mount=Pose3(0.2, 0.0, 0.2),
    min_range=0.0,
    max_range=10.0,
    resolution=1.5707963,
    fov=3.1415926,
    beams=3,
)
FACTS = RobotInfo(
    name="P3AT",
    length=0.6,
    width=0.4,
    height=0.4,
    wheel_radius=0.1,
    wheel_separation=0.4,
    max_wheel_speed=0.8,
    drive_scale=1.0,
    scanners=(SCANNER,),
)


@pytest.fixture
def robot_info() -> RobotInfo:
    return FACTS


@pytest.fixture
def state() -> DrivenRobot:
    return DrivenRobot(FACTS, SCANNER, "DM-Test")
