"""Conversion of drive commands to wheel speeds.

Apart from the kinematics, because a server needs it before compiled code is loaded.
"""

from dataclasses import dataclass

from radarsim.protocol.dialect import RAD_PER_S, DriveUnit


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
