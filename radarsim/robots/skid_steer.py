"""Kinematics of a robot that steers by the speeds of its left and right wheels.

Speeds of wheels are taken as reached at once: the set-point of a tick is the speed of
the tick. What stops the robot (walls, other robots) is not known here.
"""

import math
from dataclasses import dataclass

from radarsim.geometry import Pose2, wrap_angle
from radarsim.protocol.dialect import RAD_PER_S, DriveUnit


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    """Drive along the exact circular arc for one time step.

    Args:
        pose: Where the robot is at the start of the step.
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m; wider than the real one
            if the wheels are to slip sideways in a turn.
        dt: Step, s. Two half steps land where one whole step does.

    Returns:
        Where the robot is at the end of it, with its yaw in (-pi, pi].

    Source: geometry of an arc; its chord is 2 (distance / turn) sin(turn / 2), and
    points half a turn off the heading at its start.
    """
    turn = (
        (right - left) / track * dt
    )  # y points left: right faster = counter-clockwise
    half = turn / 2
    chord = (left + right) / 2 * dt * (math.sin(half) / half if half else 1.0)
    return Pose2(
        pose.x + chord * math.cos(pose.yaw + half),
        pose.y + chord * math.sin(pose.yaw + half),
        wrap_angle(pose.yaw + turn),
    )


@dataclass(frozen=True, slots=True)
class WheelDrive:
    """What a number in a drive command means.

    Attributes:
        max_spin: The fastest that a wheel spins either way, in ``unit``.
        unit: Of ``max_spin`` and of the commands.
    """

    max_spin: float
    unit: DriveUnit = "rad_per_s"

    @property
    def max_spin_rad_s(self) -> float:
        """The fastest that a wheel spins, rad/s."""
        return self.max_spin * RAD_PER_S[self.unit]

    def spin(self, value: float, *, normalized: bool = False) -> float:
        """Turn a commanded number into the speed that the wheel gets, rad/s.

        Args:
            value: In ``unit``; forward is positive.
            normalized: The value is a percentage of ``max_spin`` instead.
        """
        wanted = value * self.max_spin / 100 if normalized else value
        return max(-self.max_spin, min(self.max_spin, wanted)) * RAD_PER_S[self.unit]
