"""Readings of INS, tachometer and encoder, as machine code.

A sensor is a few numbers, from a place on in a row of numbers: those of all sensors of
a robot. Here are the numbers, and what they become as the robot moves. Sensors know
neither the clock nor the robot; random numbers are drawn ahead, many at a time, which
are those that would be drawn one after the other.

Theory of operation
===================
An INS is dead reckoning that drifts with the distance driven and the angles turned. Its
estimate starts at the sensor's true pose. An update of the drift adds the body's true
motion since the previous one, with an error: on each axis the distance times a normal
random number, on each angle the turn times another. Between updates the true motion is
added without error, so that readings can be more frequent.

A tachometer measures the mean speed of wheels since its last reading, and their angles,
without noise. An encoder counts ticks: the error is a fraction of the total angle, and
the count restarts with every turn.

Source: the original server's sensors; the deviation of its INS is 5 % regardless of its
settings.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.jit import Int, njit_inline
from radarsim.presets.sensor_settings import ENCODER_RESOLUTION, InsNoise

INS_DRIFT_INTERVAL: Final = 0.2  # s of simulated time between two updates of the drift
ENCODER_NOISE: Final = 0.005  # largest error, as a fraction of the total angle
BLOCK: Final = 16  # times that random numbers are drawn ahead
# Numbers of an INS: estimated pose and mean errors; the body's pose at the last update,
# m, rad; standard deviation of errors; how many of the random numbers are used up.
ESTIMATE, BIAS, BODY = 0, 6, 12
SIGMA, INS_USED, INS_DRAWS = 18, 19, 20
INS_NUMBERS: Final = INS_DRAWS + 6 * BLOCK
# Numbers of a tachometer: time of the last reading, s; of the left and of the right
# wheels: angles and speeds then, and angles that count as zero, rad, rad/s.
READ_AT, ANGLES, SPEEDS, ANGLE_ZERO = 0, 1, 3, 5
# Numbers of an encoder: angles of the left and of the right wheels that count as zero,
# rad; largest error, as a fraction; how many random numbers there are, and are used up.
TICK_ZERO, NOISE, DRAWN, USED, ENCODER_DRAWS = 0, 2, 3, 4, 5


def new_ins(
    sensor: Pose3, body: Pose3, noise: InsNoise, rng: np.random.Generator
) -> Floats:
    """Return the numbers of an INS at its spawn.

    Args:
        sensor: Pose of the sensor, map frame.
        body: Pose of the robot's body, map frame.
        noise: Size of the drift.
        rng: Source of the bias, and later of the drift.
    """
    numbers = np.zeros(INS_NUMBERS)
    largest = np.repeat([noise.position_bias, noise.angle_bias], 3)
    numbers[BIAS : BIAS + 6] = rng.uniform(-1.0, 1.0, 6) * largest
    numbers[ESTIMATE : ESTIMATE + 6] = sensor.numbers()
    numbers[BODY : BODY + 6] = body.numbers()
    numbers[SIGMA] = noise.sigma
    draw_drift(numbers, rng)
    return numbers


def draw_drift(ins: Floats, rng: np.random.Generator) -> None:
    """Draw the random numbers of the next ``BLOCK`` updates of an INS."""
    rng.standard_normal(out=ins[INS_DRAWS:])
    ins[INS_USED] = 0.0


def overwrite_ins(ins: Floats, pose: Pose3, body: Pose3) -> None:
    """Set the estimate of an INS, which also removes the bias."""
    ins[ESTIMATE : ESTIMATE + 6] = pose.numbers()
    ins[BIAS : BIAS + 6] = 0.0
    ins[BODY : BODY + 6] = body.numbers()


def new_tachometer(time: float, left: float, right: float) -> Floats:
    """Return the numbers of a tachometer at a time, s, and angles of wheels, rad."""
    return np.array([time, left, right, 0.0, 0.0, left, right])


def new_encoder(
    wheels: int,
    left: float,
    right: float,
    rng: np.random.Generator,
    *,
    noise: float = ENCODER_NOISE,
) -> Floats:
    """Return the numbers of an encoder.

    Args:
        wheels: Number of wheels whose ticks it counts.
        left: Angle of the left wheels, rad.
        right: Angle of the right wheels, rad.
        rng: Source of the errors.
        noise: Largest error, as a fraction of the total angle.
    """
    drawn = BLOCK * wheels
    numbers = np.array([left, right, noise, drawn, 0.0, *[0.0] * drawn])
    draw_errors(numbers, rng)
    return numbers


def draw_errors(encoder: Floats, rng: np.random.Generator) -> None:
    """Draw the random numbers of the next ``BLOCK`` readings of an encoder."""
    rng.random(out=encoder[ENCODER_DRAWS:])
    encoder[USED] = 0.0


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


@njit_inline
def move_ins(numbers: Floats, ins: Int, body: Floats) -> None:
    """Update the drift of an INS, for which random numbers are there.

    Args:
        numbers: Numbers of all sensors of the robot.
        ins: Place from which on those of the INS are.
        body: x, y, z, roll, pitch, yaw of the robot's body, map frame.
    """
    distance, first = 0.0, ins + INS_DRAWS + int(numbers[ins + INS_USED])
    for axis in range(3):
        moved = body[axis] - numbers[ins + BODY + axis]
        distance += moved * moved
    distance = math.sqrt(distance)
    for axis in range(6):
        motion = _motion(numbers[ins + BODY + axis], body[axis], axis)
        # Errors grow with the way driven, also across it, and with the turn itself.
        scale = distance if axis < 3 else motion
        drawn = numbers[ins + SIGMA] * numbers[first + axis]
        error = numbers[ins + BIAS + axis] + drawn
        numbers[ins + ESTIMATE + axis] += motion + scale * error
    for axis in range(6):
        numbers[ins + BODY + axis] = body[axis]
    numbers[ins + INS_USED] += 6.0


@njit_inline
def read_ins(numbers: Floats, ins: Int, body: Floats, out: Floats, at: Int) -> None:
    """Write the estimated pose, map frame, whose angles are not wrapped.

    Args:
        numbers: As in ``move_ins``.
        ins: See there.
        body: See there.
        out: For the six numbers of the pose.
        at: Place of the first.
    """
    for axis in range(6):
        motion = _motion(numbers[ins + BODY + axis], body[axis], axis)
        out[at + axis] = numbers[ins + ESTIMATE + axis] + motion


@njit_inline
def _motion(start: float, end: float, axis: int) -> float:
    """Return the motion on an axis, or the turn about it, the short way round, rad."""
    motion = end - start
    if axis < 3 or abs(motion) <= math.pi:
        return motion
    rest = np.fmod(abs(motion), math.tau)  # exact, as all that follows
    other = math.tau - rest
    return math.copysign(1.0, motion) * float(rest if rest <= other else -other)


@njit_inline
def measure_speeds(
    numbers: Floats, tachometer: Int, time: float, left: float, right: float
) -> None:
    """Measure the mean speeds of wheels since the last reading of a tachometer.

    Args:
        numbers: Numbers of all sensors of the robot.
        tachometer: Place from which on those of the tachometer are.
        time: s; a second reading at the same time keeps the speeds of the first one.
        left: Angle of the left wheels, rad.
        right: Angle of the right wheels, rad.
    """
    elapsed = time - numbers[tachometer + READ_AT]
    # Two readings in a tick would divide by zero.
    if elapsed > 1e-6:
        angles, speeds = tachometer + ANGLES, tachometer + SPEEDS
        numbers[speeds] = (left - numbers[angles]) / elapsed
        numbers[speeds + 1] = (right - numbers[angles + 1]) / elapsed
        numbers[tachometer + READ_AT] = time
        numbers[angles], numbers[angles + 1] = left, right


@njit_inline
def count_ticks(numbers: Floats, encoder: Int, side: Int, angle: float) -> float:
    """Return the ticks of a wheel, for which a random number is there.

    Args:
        numbers: Numbers of all sensors of the robot.
        encoder: Place from which on those of the encoder are.
        side: 0 for a left wheel, 1 for a right one.
        angle: Angle of the wheel, rad.
    """
    used, noise = int(numbers[encoder + USED]), numbers[encoder + NOISE]
    numbers[encoder + USED] += 1.0
    error = -noise + 2 * noise * numbers[encoder + ENCODER_DRAWS + used]
    turned = (angle - numbers[encoder + TICK_ZERO + side]) * (1 + error)
    return float(np.trunc(np.fmod(turned, 2 * math.pi) / ENCODER_RESOLUTION))
