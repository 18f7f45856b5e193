"""Kinematics of skid steering: motion from the speeds of the left and right wheels.

Wheels reach their set-points at once: the set-point of a tick is the speed during that
tick. Collisions are not modelled here.
"""

import math
from dataclasses import dataclass

from radarsim.geometry import Pose2, wrap_angle
from radarsim.protocol.dialect import RAD_PER_S, DriveUnit


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    """Return the pose after one time step along the exact circular arc.

    Args:
        pose: Pose at the start of the step.
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m; wider than the real one
            if the wheels slip sideways in a turn.
        dt: Time step, s; two half steps give the same pose as one whole step.

    Returns:
        The pose at the end of the step, with its yaw in (-pi, pi].

    Source: geometry of an arc; its chord is 2 (distance / turn) sin(turn / 2), and
    points half a turn off the heading at its start.
    """
    # y points left, so faster right wheels turn the robot counter-clockwise
    turn = (right - left) / track * dt
    half = turn / 2
    chord = (left + right) / 2 * dt * (math.sin(half) / half if half else 1.0)
    return Pose2(
        pose.x + chord * math.cos(pose.yaw + half),
        pose.y + chord * math.sin(pose.yaw + half),
        wrap_angle(pose.yaw + turn),
    )


@dataclass(frozen=True, slots=True)
class WheelDrive:
    """Conversion of drive commands to wheel speeds.

    Attributes:
        max_spin: Highest speed of a wheel in either direction, in ``unit``.
        unit: Unit of ``max_spin`` and of the commands.
    """

    max_spin: float
    unit: DriveUnit = "rad_per_s"

    @property
    def max_spin_rad_s(self) -> float:
        """The highest speed of a wheel, rad/s."""
        return self.max_spin * RAD_PER_S[self.unit]

    def spin(self, value: float, *, normalized: bool = False) -> float:
        """Convert a commanded value to the wheel speed, limited, rad/s.

        Args:
            value: Commanded speed in ``unit``; forward is positive.
            normalized: Whether the value is a percentage of ``max_spin`` instead.
        """
        speed = value * self.max_spin / 100 if normalized else value
        speed = max(-self.max_spin, min(self.max_spin, speed))
        return speed * RAD_PER_S[self.unit]
