"""Wheel sensors: odometry, tachometers, encoders; ``readings.hpp`` computes them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from radarsim.engine import engine
from radarsim.geometry import Pose2
from radarsim.protocol import reports
from radarsim.sensors.readings import Job
from radarsim.sensors.sensor import EngineSensor, Mounting, Reading, Source

ENCODER_NOISE: Final = 0.005  # largest error as a fraction of the total angle
ENCODER_RESOLUTION: Final = 0.01745  # rad per tick, as in readings.hpp


class Odometry(EngineSensor, types=["Odometry"]):
    """Reads the pose that the robot estimates from the rotation of its wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._row = self.robot.fleet.add_odometry(self.robot)
        (place,) = self._remember(np.array([float(self._row)]))
        sample = reports.Odometry(0.0, self.item.name, Pose2(0.0, 0.0))
        self._report(sample, pose=[Job(Reading.WHEEL_POSE, place)])

    def reset(self) -> None:
        """Reset the pose estimated by odometry to zeros."""
        for name in ("x", "y", "yaw"):
            self.robot.fleet.odometry[name][self._row] = 0.0


class Tachometer(EngineSensor, types=["Tachometer"]):
    """Reads the speeds and the rotation angles of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = np.zeros(1, engine.rows["Tachometer"])
        start["read_at"] = mounting.time
        start["angles"] = start["zero"] = self.robot.side_angles
        (place,), sides = self._remember(start), self.robot.model.wheels
        zeros = (0.0,) * len(sides)
        speeds = {"left": Reading.LEFT_SPEED, "right": Reading.RIGHT_SPEED}
        angles = {"left": Reading.LEFT_ANGLE, "right": Reading.RIGHT_ANGLE}
        self._report(
            reports.Tachometer(0.0, self.item.name, zeros, zeros),
            velocities=[Job(speeds[side], place) for side in sides],
            positions=[Job(angles[side], place) for side in sides],
        )

    def reset(self) -> None:
        """Count the rotation angles of the wheels from zero again."""
        self._memory["zero"] = self.robot.side_angles


class Encoder(EngineSensor, types=["Encoder"]):
    """Reads the encoder ticks of the wheels that the item's name lists."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sides = self.robot.model.wheels
        wheels = encoded_wheels(self.item.name, sides)
        start = np.zeros(len(wheels), engine.rows["Encoder"])
        start["side"] = [sides[index] == "right" for _, index, _ in wheels]
        start["sign"] = [sign for *_, sign in wheels]
        start["noise"], start["used"] = ENCODER_NOISE, np.inf
        jobs = [Job(Reading.TICKS, place) for place in self._remember(start)]
        self.draw()
        self.reset()
        sample = reports.Encoder(0.0, tuple((name, 0) for name, *_ in wheels))
        self._report(sample, ticks=jobs)

    def reset(self) -> None:
        """Count the encoder ticks from zero again."""
        encoders, (left, right) = self._memory, self.robot.side_angles
        encoders["zero"] = np.where(encoders["side"], right, left)

    def draw(self) -> None:
        """Draw random errors for later readings if all previous errors are used up."""
        encoders = self._memory
        draws = encoders["draws"]
        if (encoders["used"] >= draws.shape[1]).any():
            draws[:] = self._rng.random(draws.T.shape).T
            encoders["used"] = 0.0


def encoded_wheels(name: str, sides: Sequence[str]) -> list[tuple[str, int, int]]:
    """Return the wheels that the name of an encoder lists, such as ``W1``.

    ``W1`` counts wheel 1. ``ECLeft`` counts the first left wheel, with negative ticks
    for forward motion, as clients of UT2004 servers expect.

    Source: the original server's encoder, and lines of UT2004 servers in the
    documentation of clients.

    Args:
        name: Name of the item.
        sides: ``left`` or ``right`` for each wheel.

    Returns:
        For each wheel, the name in the reading, the index of the wheel, and the sign of
        the ticks for forward motion, 1 or -1.
    """
    for side in ("left", "right"):
        if name.casefold() == f"ec{side}" and side in sides:
            return [(name, sides.index(side), -1)]
    numbers = [wheel for wheel in range(len(sides)) if f"W{wheel}" in name]
    return [(f"W{wheel}", wheel, 1) for wheel in numbers]


def join_encoders(sources: Iterable[Source]) -> list[Source]:
    """Join consecutive encoder reports into one; other reports stay unchanged."""
    joined: list[Source] = []
    for sample, jobs in sources:
        before, its_jobs = joined[-1] if joined else (None, {})
        # Clients of older USARSim servers read the encoders of both sides in one line.
        if isinstance(before, reports.Encoder) and isinstance(sample, reports.Encoder):
            both = replace(before, ticks=(*before.ticks, *sample.ticks))
            joined[-1] = both, {**jobs, "ticks": [*its_jobs["ticks"], *jobs["ticks"]]}
        else:
            joined.append((sample, jobs))
    return joined
