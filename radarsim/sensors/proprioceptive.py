"""Sensors of the robot's own motion: INS, tachometer and encoder.

They convert true poses and true wheel angles to readings. Ground truth needs no code
here, since it is the pose of the robot's body, nor does odometry, which the fleet
integrates as robots drive. The simulation calls the sensors when they are
due; they know neither the clock nor the robot.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.suggestions import expected_one_of

INS_DRIFT_INTERVAL = 0.2  # s of simulated time between two updates of the drift
ENCODER_RESOLUTION = 0.01745  # rad per tick
MAX_NOISE = 10.0  # times the motion itself; more overflows after a while
ENCODER_NOISE = 0.005  # largest error, as a fraction of the total angle


@dataclass(frozen=True, slots=True)
class InsNoise:
    """Drift of an inertial navigation system; all zero for none.

    Attributes:
        sigma: Standard deviation of the error of a motion, as a fraction of it.
        position_bias: Largest mean of the relative error on each axis; the mean is
            drawn once per run.
        angle_bias: Largest mean of the relative error of each angle, drawn likewise.
    """

    sigma: float = 0.05
    position_bias: float = 0.5e-3
    angle_bias: float = 0.5e-6

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Create the noise from the settings of an item.

        Raises:
            PresetError: If a setting is unknown, negative or not a finite number.
        """
        known = [field.name for field in fields(cls)]
        for name, value in settings.items():
            if name not in known:
                raise PresetError(f"INS setting {expected_one_of(name, known)}")
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0 <= value <= MAX_NOISE:
                text = repr(value)[:80]
                limits = f"expected 0 to {MAX_NOISE:g}"
                raise PresetError(f"INS setting {name}: {text}, {limits}")
        return cls(**settings)


class Ins:
    """Dead reckoning that drifts with the distance driven and the angles turned.

    The estimate starts at the sensor's true pose. An update of the drift adds the
    body's true motion since the previous one, with an error: on each axis the distance
    times a normal random number, on each angle the turn times another. Between updates
    the true motion is added without error, so that readings can be more frequent.

    Source: the original server's INS, whose deviation is 5 % regardless of its
    settings.
    """

    def __init__(
        self,
        sensor: Pose3,
        body: Pose3,
        rng: np.random.Generator,
        noise: InsNoise | None = None,
    ) -> None:
        """Start at the pose of the spawn.

        Args:
            sensor: Pose of the sensor, map frame.
            body: Pose of the robot's body, map frame.
            rng: Source of the drift.
            noise: Size of the drift; None for that of the original.
        """
        self._noise = noise or InsNoise()
        self._rng = rng
        largest = np.repeat([self._noise.position_bias, self._noise.angle_bias], 3)
        self._bias: list[float] = (rng.uniform(-1.0, 1.0, 6) * largest).tolist()
        self._estimate = list(sensor.numbers())
        self._body = body

    def drift(self, body: Pose3) -> None:
        """Add the motion since the last call, with drift.

        It is due every ``INS_DRIFT_INTERVAL``.
        """
        motion = _motion(self._body, body)
        distance = float(np.linalg.norm(motion[:3]))
        scale = (distance, distance, distance, *motion[3:])
        sigma, draws = self._noise.sigma, self._rng.standard_normal(6).tolist()
        for i in range(6):
            error = self._bias[i] + sigma * draws[i]
            self._estimate[i] += motion[i] + scale[i] * error
        self._body = body

    def reading(self, body: Pose3) -> Pose3:
        """Return the estimated pose, map frame; its angles are not wrapped."""
        estimate, motion = self._estimate, _motion(self._body, body)
        return Pose3(
            estimate[0] + motion[0],
            estimate[1] + motion[1],
            estimate[2] + motion[2],
            estimate[3] + motion[3],
            estimate[4] + motion[4],
            estimate[5] + motion[5],
        )

    def overwrite(self, pose: Pose3, body: Pose3) -> None:
        """Set the estimate, which also removes the bias."""
        self._estimate = list(pose.numbers())
        self._bias = [0.0] * 6
        self._body = body


def _motion(start: Pose3, end: Pose3) -> list[float]:
    """Return the translation and the wrapped rotations between two poses, 6 numbers."""
    return [
        end.x - start.x,
        end.y - start.y,
        end.z - start.z,
        math.remainder(end.roll - start.roll, math.tau),
        math.remainder(end.pitch - start.pitch, math.tau),
        math.remainder(end.yaw - start.yaw, math.tau),
    ]


@dataclass(frozen=True, slots=True)
class WheelReading:
    """Reading of a tachometer, wheel by wheel.

    Attributes:
        velocities: Mean speeds since the previous reading, rad/s.
        positions: Angles turned since the spawn or the last reset, rad.
    """

    velocities: tuple[float, ...]
    positions: tuple[float, ...]


class Tachometer:
    """Measures speeds and angles of all wheels, without noise."""

    def __init__(self, time: float, angles: Sequence[float]) -> None:
        self._time = time
        self._angles = self._zero = tuple(angles)
        self._velocities = (0.0,) * len(self._angles)

    def read(self, time: float, angles: Sequence[float]) -> WheelReading:
        """Read the wheels.

        Args:
            time: s; a second reading at the same time repeats the first one's
                velocities.
            angles: Angle that each wheel turned since the spawn, rad.
        """
        elapsed = time - self._time
        if elapsed > 1e-6:
            pairs = zip(angles, self._angles, strict=True)
            self._velocities = tuple([(now - then) / elapsed for now, then in pairs])
            self._time, self._angles = time, tuple(angles)
        pairs = zip(angles, self._zero, strict=True)
        turned = tuple([now - zero for now, zero in pairs])
        return WheelReading(self._velocities, turned)

    def reset(self, angles: Sequence[float]) -> None:
        """Set the zero of the positions."""
        self._zero = tuple(angles)


@dataclass(frozen=True, slots=True)
class EncodedWheel:
    """A wheel whose ticks an encoder counts.

    Attributes:
        name: Name that its ticks have in a reading.
        index: Index of the wheel.
        sign: 1 if forward counts up, -1 if it counts down.
    """

    name: str
    index: int
    sign: int = 1


def encoded_wheels(name: str, sides: Sequence[str]) -> tuple[EncodedWheel, ...]:
    """Return the wheels whose ticks an encoder counts, by its name.

    ``W1`` counts wheel 1. ``ECLeft`` counts the first of the left wheels, forward
    negative, as clients of UT2004's encoders expect.

    Source: the original server's encoder, and lines of UT2004's that clients quote.

    Args:
        name: Name of the item.
        sides: ``left`` or ``right`` for each wheel.
    """
    for side in ("left", "right"):
        if name.casefold() == f"ec{side}" and side in sides:
            return (EncodedWheel(name, sides.index(side), -1),)
    numbers = [wheel for wheel in range(len(sides)) if f"W{wheel}" in name]
    return tuple(EncodedWheel(f"W{wheel}", wheel) for wheel in numbers)


class Encoder:
    """Counts ticks of wheels.

    The error is a fraction of the total angle, and the count restarts with every turn.

    Source: the original server's encoder.
    """

    def __init__(
        self,
        wheels: Sequence[EncodedWheel],
        angles: Sequence[float],
        rng: np.random.Generator,
        *,
        noise: float = ENCODER_NOISE,
    ) -> None:
        """Start at the angles of the spawn.

        Args:
            wheels: Wheels whose ticks it counts.
            angles: Angle that each wheel of the robot turned since the spawn, rad.
            rng: Source of the error.
            noise: Largest error, as a fraction of the total angle.
        """
        self._wheels = wheels
        self._zero = tuple(angles)
        self._rng = rng
        self._noise = noise

    def ticks(self, angles: Sequence[float]) -> tuple[tuple[str, int], ...]:
        """Return name and ticks of each of its wheels."""
        return tuple([self._count(wheel, angles) for wheel in self._wheels])

    def reset(self, angles: Sequence[float]) -> None:
        """Set the zero of the count."""
        self._zero = tuple(angles)

    def _count(self, wheel: EncodedWheel, angles: Sequence[float]) -> tuple[str, int]:
        # The same number as ``uniform`` draws, which takes longer.
        error = -self._noise + 2 * self._noise * self._rng.random()
        angle = (angles[wheel.index] - self._zero[wheel.index]) * (1 + error)
        return wheel.name, wheel.sign * _ticks(angle)


def _ticks(angle: float) -> int:
    return int(math.fmod(angle, 2 * math.pi) / ENCODER_RESOLUTION)
