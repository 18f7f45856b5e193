"""Poses and angles, and the definition of the coordinate frames.

All code of radarsim follows REP-103: right-handed frames, x forward, y left, z up,
metres, seconds, radians, yaw counter-clockwise seen from above. Roll, pitch and yaw
rotate about the fixed x, then y, then z axis: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
The axes of the protocol (y right, z down) are used in ``radarsim.protocol`` only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Point: TypeAlias = tuple[float, float]  # x and y, m


def wrap_angle(angle: float) -> float:
    """Wrap an angle, rad, to (-pi, pi].

    >>> wrap_angle(3 * math.pi / 2) == -math.pi / 2
    True
    """
    wrapped = math.remainder(angle, 2 * math.pi)
    return math.pi if wrapped <= -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose on the floor: x and y in m, yaw in rad."""

    x: float
    y: float
    yaw: float = 0.0

    def compose(self, inner: "Pose2") -> "Pose2":
        """Transform a pose from the frame of this pose to this pose's parent frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x = self.x + c * inner.x - s * inner.y
        y = self.y + s * inner.x + c * inner.y
        return Pose2(x, y, wrap_angle(self.yaw + inner.yaw))

    def relative_to(self, other: "Pose2") -> "Pose2":
        """Return this pose relative to another pose in the same parent frame."""
        c, s = math.cos(other.yaw), math.sin(other.yaw)
        dx, dy = self.x - other.x, self.y - other.y
        turn = wrap_angle(self.yaw - other.yaw)
        return Pose2(c * dx + s * dy, c * dy - s * dx, turn)

    def distance(self, other: "Pose2") -> float:
        """Return the distance between this pose and another pose, m."""
        return math.hypot(self.x - other.x, self.y - other.y)

    def point(self, bearing: float, distance: float) -> Point:
        """Return the point at a bearing, rad, and a distance, m, from this pose."""
        angle = self.yaw + bearing
        return self.x + distance * math.cos(angle), self.y + distance * math.sin(angle)

    def is_apart(self, other: "Pose2", distance: float, turn: float) -> bool:
        """Return whether poses differ by more than a distance, m, or an angle, rad."""
        turned = abs(wrap_angle(self.yaw - other.yaw))
        return self.distance(other) > distance or turned > turn


@dataclass(frozen=True, slots=True)
class Pose3:
    """A pose in space: x, y, z in m, roll, pitch, yaw in rad."""

    x: float
    y: float
    z: float
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @classmethod
    def from_numbers(cls, numbers: Sequence[float]) -> Self:
        """Create a pose from ``x, y, z, roll, pitch, yaw``.

        Raises:
            ValueError: If the sequence does not consist of six finite numbers.
        """
        if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"pose {list(numbers)!r}, expected six finite numbers")
        return cls(*(float(number) for number in numbers))

    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Return the pose as six numbers ``x, y, z, roll, pitch, yaw``."""
        return (self.x, self.y, self.z, self.roll, self.pitch, self.yaw)

    def position(self) -> Floats:
        """Return the position of the pose, (3,) m."""
        return np.array([self.x, self.y, self.z], np.float64)

    def rotation(self) -> Floats:
        """Return the matrix, (3, 3), that rotates vectors to the parent frame."""
        return rotation_matrix(self.roll, self.pitch, self.yaw)

    def compose(self, inner: "Pose3") -> "Pose3":
        """Transform a pose from the frame of this pose to this pose's parent frame."""
        tilt = self.roll or self.pitch or inner.roll or inner.pitch
        if not (tilt or inner.y or inner.yaw):
            # For a forward-mounted sensor on a level robot, this is faster than the
            # general computation below, with the same result.
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            x, y = self.x + c * inner.x, self.y + s * inner.x
            z, yaw = float(self.z + inner.z), math.atan2(s, c) + 0.0
            return Pose3(x, y, z, 0.0, 0.0, yaw)
        rotation = self.rotation()
        x, y, z = self.position() + rotation @ inner.position()
        roll, pitch, yaw = _roll_pitch_yaw(rotation @ inner.rotation())
        return Pose3(float(x), float(y), float(z), roll, pitch, yaw)

    def inverse(self) -> "Pose3":
        """Return the pose of the parent frame in the frame of this pose."""
        back = self.rotation().T
        x, y, z = -back @ self.position()
        return Pose3(float(x), float(y), float(z), *_roll_pitch_yaw(back))


def rotation_matrix(roll: float, pitch: float, yaw: float) -> Floats:
    """Return ``Rz(yaw) @ Ry(pitch) @ Rx(roll)``, (3, 3), for angles in rad."""
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


def _roll_pitch_yaw(rotation: Floats) -> tuple[float, float, float]:
    """Return roll, pitch and yaw, rad, of a rotation matrix; roll is 0 at 90° pitch."""
    horizontal = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], horizontal)
    if horizontal < 1e-12:
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return roll + 0.0, pitch + 0.0, yaw + 0.0  # -0.0 becomes 0.0
