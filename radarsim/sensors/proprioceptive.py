"""Sensors of where the robot is and of how its wheels turn.

Ground truth needs nothing here: it is the pose of the robot's body. All the others take
true poses and true wheel angles and give what they make of them. They know no clock and
no robot; whoever steps the simulation asks them when they are due.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from radarsim.errors import PresetError
from radarsim.geometry import Floats, Pose2, Pose3

INS_DRAW_INTERVAL = 0.2  # s of simulated time between two draws of the drift
ENCODER_RESOLUTION = 0.01745  # rad per tick
MOST_NOISE = 10.0  # times the way itself; more than that overflows in time
ENCODER_NOISE = 0.005  # largest error, as a part of the whole angle


@dataclass(frozen=True, slots=True)
class InsNoise:
    """How an inertial navigation system drifts; all zero: not at all.

    Attributes:
        sigma: Standard deviation of the error of a stretch, as a part of the stretch.
        position_bias: Largest mean of that error on each axis, drawn once per run.
        angle_bias: The same for each angle.
    """

    sigma: float = 0.05
    position_bias: float = 0.5e-3
    angle_bias: float = 0.5e-6

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Take the noise from an item's settings.

        Raises:
            PresetError: If a setting is unknown, negative or no finite number.
        """
        known = [field.name for field in fields(cls)]
        for name, value in settings.items():
            if name not in known:
                raise PresetError(f"INS setting {name[:80]!r}, expected one of {known}")
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0 <= value <= MOST_NOISE:
                text = repr(value)[:80]
                limits = f"expected 0 to {MOST_NOISE:g}"
                raise PresetError(f"INS setting {name}: {text}, {limits}")
        return cls(**settings)


class Ins:
    """Dead reckoning that drifts with the way made and with the angles turned.

    The estimate begins at the sensor's true pose. A draw adds the body's true motion
    since the draw before, with an error: on each axis the distance times a normal
    number, on each angle the turn times another. Between draws the true motion is added
    as it is, so that readings may come oftener than draws.

    Source: the original server's INS, whose deviation is 5 % whatever its settings say.
    """

    def __init__(
        self,
        sensor: Pose3,
        body: Pose3,
        rng: np.random.Generator,
        noise: InsNoise | None = None,
    ) -> None:
        """Begin at the spawn.

        Args:
            sensor: The sensor's own pose, map frame.
            body: The robot's pose, map frame.
            rng: Where all of the drift comes from.
            noise: How it drifts; None for the original's drift.
        """
        self._noise = noise or InsNoise()
        self._rng = rng
        largest = np.repeat([self._noise.position_bias, self._noise.angle_bias], 3)
        self._bias: Floats = rng.uniform(-1.0, 1.0, 6) * largest
        self._estimate = np.array(sensor.numbers())
        self._body = body

    def draw(self, body: Pose3) -> None:
        """Take in the motion since the last draw; due every ``INS_DRAW_INTERVAL``."""
        motion = _motion(self._body, body)
        scale = np.concatenate([np.full(3, np.linalg.norm(motion[:3])), motion[3:]])
        error = self._bias + self._noise.sigma * self._rng.standard_normal(6)
        self._estimate += motion + scale * error
        self._body = body

    def reading(self, body: Pose3) -> Pose3:
        """Give the estimate, map frame; its angles are not brought into a range."""
        estimate = self._estimate + _motion(self._body, body)
        return Pose3.from_numbers(estimate.tolist())

    def overwrite(self, pose: Pose3, body: Pose3) -> None:
        """Set the estimate by hand, which also ends the bias."""
        self._estimate = np.array(pose.numbers())
        self._bias = np.zeros(6)
        self._body = body


def _motion(start: Pose3, end: Pose3) -> Floats:
    """Give the way and the turns, the shorter way round, from one pose to another."""
    motion = np.subtract(end.numbers(), start.numbers())
    motion[3:] = [math.remainder(angle, 2 * math.pi) for angle in motion[3:]]
    return motion


class Odometry:
    """Where the robot would be if its wheels never slipped, from where it spawned.

    Attributes:
        pose: x and y in m along the axes of the spawn pose; yaw in rad, not wrapped.
    """

    def __init__(self, *, wheel_radius: float, wheel_separation: float) -> None:
        self.pose = Pose2(0.0, 0.0)
        self._radius = wheel_radius
        self._separation = wheel_separation
        self._left = self._right = 0.0

    def update(self, left: float, right: float) -> None:
        """Take in how far the wheels turned since the spawn, rad.

        The way since the last update is taken as one arc, which is exact as long as the
        wheels keep their speeds in between.
        """
        ahead_left = self._radius * (left - self._left)
        ahead_right = self._radius * (right - self._right)
        turn = (ahead_right - ahead_left) / self._separation
        half = turn / 2
        chord = (ahead_left + ahead_right) / 2 * (math.sin(half) / half if half else 1)
        heading = self.pose.yaw + half
        self.pose = Pose2(
            self.pose.x + chord * math.cos(heading),
            self.pose.y + chord * math.sin(heading),
            self.pose.yaw + turn,
        )
        self._left, self._right = left, right

    def reset(self) -> None:
        """Begin again at the place of the last update."""
        self.pose = Pose2(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class WheelReading:
    """What a tachometer says, wheel by wheel.

    Attributes:
        velocities: rad/s, averaged since the scan before.
        positions: rad turned since the spawn or the last reset.
    """

    velocities: tuple[float, ...]
    positions: tuple[float, ...]


class Tachometer:
    """Speeds and angles of all wheels, without noise."""

    def __init__(self, time: float, angles: Sequence[float]) -> None:
        self._time = time
        self._angles = self._zero = tuple(angles)
        self._velocities = (0.0,) * len(self._angles)

    def scan(self, time: float, angles: Sequence[float]) -> WheelReading:
        """Read the wheels.

        Args:
            time: s; a second scan at the same time repeats the velocities of the first.
            angles: How far each wheel turned since the spawn, rad.
        """
        elapsed = time - self._time
        if elapsed > 1e-6:
            pairs = zip(angles, self._angles, strict=True)
            self._velocities = tuple((now - then) / elapsed for now, then in pairs)
            self._time, self._angles = time, tuple(angles)
        pairs = zip(angles, self._zero, strict=True)
        return WheelReading(self._velocities, tuple(now - zero for now, zero in pairs))

    def reset(self, angles: Sequence[float]) -> None:
        """Count positions from here on."""
        self._zero = tuple(angles)


class Encoder:
    """Ticks of the wheels that the encoder's name mentions: ``W1`` is wheel 1.

    The error is a part of the whole angle, and the ticks begin again with every turn.

    Source: the original server's encoder.
    """

    def __init__(
        self,
        name: str,
        angles: Sequence[float],
        rng: np.random.Generator,
        *,
        noise: float = ENCODER_NOISE,
    ) -> None:
        """Begin at the spawn.

        Args:
            name: Of the item.
            angles: How far each wheel turned since the spawn, rad.
            rng: Where the error comes from.
            noise: Largest error, as a part of the whole angle.
        """
        self._wheels = [wheel for wheel in range(len(angles)) if f"W{wheel}" in name]
        self._zero = tuple(angles)
        self._rng = rng
        self._noise = noise

    def ticks(self, angles: Sequence[float]) -> tuple[tuple[str, int], ...]:
        """Give name and ticks of each wheel that it sits on; backward is negative."""
        errors = self._rng.uniform(-self._noise, self._noise, len(self._wheels))
        return tuple(
            (f"W{wheel}", _ticks((angles[wheel] - self._zero[wheel]) * (1 + error)))
            for wheel, error in zip(self._wheels, errors.tolist(), strict=True)
        )

    def reset(self, angles: Sequence[float]) -> None:
        """Count from here on."""
        self._zero = tuple(angles)


def _ticks(angle: float) -> int:
    return int(math.fmod(angle, 2 * math.pi) / ENCODER_RESOLUTION)
