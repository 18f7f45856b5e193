"""What a navigator wants of the wheels."""

import math
from dataclasses import dataclass

from radarsim.geometry import Pose2, wrap_angle

HEADING_GAIN = 2.5  # 1/s: rad/s of turning for each rad of heading error


@dataclass(frozen=True, slots=True)
class Motion:
    """Speed forward in m/s and turn counter-clockwise in rad/s."""

    speed: float
    turn: float


STAND = Motion(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a navigator wants to be: m/s, and rad/s on the spot."""

    speed: float = 0.3
    turn: float = 0.8

    def __post_init__(self) -> None:
        for name, value in (("speed", self.speed), ("turn", self.turn)):
            if not 0 < value < math.inf:
                raise ValueError(f"{name} {value!r}, expected above 0 and finite")

    def towards(self, bearing: float, *, most: float = math.inf) -> Motion:
        """Turn to a bearing, and go the faster the better the robot faces it.

        Args:
            bearing: rad from the robot's front.
            most: Upper limit of the speed, m/s.
        """
        turn = max(-self.turn, min(self.turn, HEADING_GAIN * bearing))
        facing = max(0.0, math.cos(bearing))
        return Motion(min(self.speed, most) * facing**4, turn)


def bearing_of(pose: Pose2, x: float, y: float) -> float:
    """Give the direction of a point as seen from a pose, rad from its front."""
    return wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)


def distance(pose: Pose2, x: float, y: float) -> float:
    """Give how far a point is from a pose, m."""
    return math.hypot(x - pose.x, y - pose.y)
