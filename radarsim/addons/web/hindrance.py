"""Why a robot can do nothing by itself."""

import math

from radarsim.addons.web.offers import FIRST_CLASS
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.client import RobotInfo
from radarsim.errors import ClientError


def find_hindrance(robot: RobotInfo) -> str | None:
    """Return why a robot cannot drive to a goal or explore; None if it can.

    Args:
        robot: Its properties; it steers by its first scanner.
    """
    try:
        scanner = robot.scanner()
    except ClientError:
        return "it has no range scanner"
    if Bumpers(safety_distance=1.0).blind(scanner.angles + scanner.mount.yaw):
        seen = f"{scanner.name} sees {math.degrees(scanner.fov):.0f}\N{DEGREE SIGN}"
        return f"{seen}, not all around as that of a {FIRST_CLASS}"
    return None
