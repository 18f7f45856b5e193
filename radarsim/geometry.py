"""Poses and angles; the one place that states the frames.

Everything inside radarsim follows REP-103: right-handed, x forward, y left, z up,
metres, seconds, radians, yaw counter-clockwise seen from above. Roll, pitch and yaw
turn about the fixed x, then y, then z axis: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
The axes of the wire (y right, z down) exist in ``radarsim.protocol`` alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


def wrap_angle(angle: float) -> float:
    """Bring an angle into (-pi, pi], rad.

    >>> wrap_angle(3 * math.pi / 2) == -math.pi / 2
    True
    """
    wrapped = math.remainder(angle, 2 * math.pi)
    return math.pi if wrapped <= -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose2:
    """A place on the floor: x and y in m, yaw in rad."""

    x: float
    y: float
    yaw: float = 0.0

    def compose(self, inner: "Pose2") -> "Pose2":
        """Express a pose that is given in this frame in the frame around it."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x = self.x + c * inner.x - s * inner.y
        y = self.y + s * inner.x + c * inner.y
        return Pose2(x, y, wrap_angle(self.yaw + inner.yaw))

    def relative_to(self, other: "Pose2") -> "Pose2":
        """Give this pose as told from another of the same frame."""
        c, s = math.cos(other.yaw), math.sin(other.yaw)
        dx, dy = self.x - other.x, self.y - other.y
        turn = wrap_angle(self.yaw - other.yaw)
        return Pose2(c * dx + s * dy, c * dy - s * dx, turn)


@dataclass(frozen=True, slots=True)
class Pose3:
    """A place in space: x, y, z in m, roll, pitch, yaw in rad."""

    x: float
    y: float
    z: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @classmethod
    def from_numbers(cls, numbers: Sequence[float]) -> Self:
        """Read ``x, y, z, roll, pitch, yaw``.

        Raises:
            ValueError: If these are not six finite numbers.
        """
        if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"pose {list(numbers)!r}, expected six finite numbers")
        return cls(*(float(number) for number in numbers))

    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Give ``x, y, z, roll, pitch, yaw``."""
        return (self.x, self.y, self.z, self.roll, self.pitch, self.yaw)

    def position(self) -> Floats:
        """Give the position, (3,) m."""
        return np.array([self.x, self.y, self.z])

    def rotation(self) -> Floats:
        """Give the matrix, (3, 3), that turns vectors of this frame into the outer."""
        return rotation_matrix(self.roll, self.pitch, self.yaw)

    def compose(self, inner: "Pose3") -> "Pose3":
        """Express a pose that is given in this frame in the frame around it."""
        turn = self.rotation()
        x, y, z = self.position() + turn @ inner.position()
        roll, pitch, yaw = _angles(turn @ inner.rotation())
        return Pose3(float(x), float(y), float(z), roll, pitch, yaw)


def rotation_matrix(roll: float, pitch: float, yaw: float) -> Floats:
    """Give ``Rz(yaw) @ Ry(pitch) @ Rx(roll)``, (3, 3), for angles in rad."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _angles(turn: Floats) -> tuple[float, float, float]:
    """Give roll, pitch, yaw of a rotation matrix; at a pitch of 90° roll is 0."""
    horizontal = math.hypot(turn[0, 0], turn[1, 0])
    pitch = math.atan2(-turn[2, 0], horizontal)
    if horizontal < 1e-12:
        return 0.0, pitch, math.atan2(-turn[0, 1], turn[1, 1])
    roll = math.atan2(turn[2, 1], turn[2, 2])
    yaw = math.atan2(turn[1, 0], turn[0, 0])
    return roll + 0.0, pitch + 0.0, yaw + 0.0  # -0.0 prints badly
