"""Settings of sensors of the robot's own motion: INS, tachometer and encoder.

What they read follows from them in ``motion_readings``. Ground truth needs no code,
since it is the pose of the robot's body, nor does odometry, which the fleet integrates
as robots drive.

Imports no compiled code: a server that still compiles answers GETCONF with these.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

from radarsim.errors import PresetError, expected_one_of

INS_DRIFT_INTERVAL = 0.2  # s of simulated time between two updates of the drift
# compiled into kernels
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
