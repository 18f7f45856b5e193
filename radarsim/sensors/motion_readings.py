"""What an INS and encoders remember; ``readings.hpp`` has the theory, and reads them.

Sensors know neither the clock nor the robot. Random numbers are drawn ahead.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Pose3
from radarsim.presets.sensor_settings import InsNoise

INS_DRIFT_INTERVAL: Final = 0.2  # s of simulated time between two updates of the drift
ENCODER_NOISE: Final = 0.005  # largest error, as a fraction of the total angle
DRAWN_AHEAD: Final = 16  # updates of an INS, and readings of an encoder
INS: Final = engine.rows["Ins"]
ENCODER: Final = engine.rows["Encoder"]


def new_ins(
    sensor: Pose3, body: Pose3, noise: InsNoise, rng: np.random.Generator
) -> NDArray[Any]:
    """Return the state of an INS at its spawn.

    Args:
        sensor: Pose of the sensor, map frame.
        body: Pose of the robot's body, map frame.
        noise: Size of the drift.
        rng: Source of the bias, and later of the drift.
    """
    ins = np.zeros(1, INS)
    overwrite_ins(ins, sensor, body)
    largest = np.repeat([noise.position_bias, noise.angle_bias], 3)
    ins["bias"] = rng.uniform(-1.0, 1.0, 6) * largest
    ins["sigma"] = noise.sigma
    draw_drift(ins, rng)
    return ins


def draw_drift(ins: NDArray[Any], rng: np.random.Generator) -> None:
    """Draw the random numbers of the next updates of an INS."""
    rng.standard_normal(out=ins["draws"])
    ins["used"] = 0.0


def overwrite_ins(ins: NDArray[Any], pose: Pose3, body: Pose3) -> None:
    """Set the estimate of an INS, which also removes the bias."""
    ins["estimate"], ins["bias"], ins["body"] = pose.numbers(), 0.0, body.numbers()


def new_encoders(
    sides: Sequence[int], rng: np.random.Generator, *, noise: float = ENCODER_NOISE
) -> NDArray[Any]:
    """Return the states of encoders of an item, one for each wheel.

    Args:
        sides: 0 for a left wheel, 1 for a right one.
        rng: Source of the errors.
        noise: Largest error, as a fraction of the total angle.
    """
    encoders = np.zeros(len(sides), ENCODER)
    encoders["side"], encoders["sign"], encoders["noise"] = sides, 1.0, noise
    draw_errors(encoders, rng)
    return encoders


def draw_errors(encoders: NDArray[Any], rng: np.random.Generator) -> None:
    """Draw the random numbers of the next readings of the encoders of an item."""
    encoders["draws"] = rng.random((DRAWN_AHEAD, len(encoders))).T
    encoders["used"] = 0.0


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
