"""The items of a robot that give readings without casting rays.

Scanners, sonars and GPS are not among them, because the rays of all robots in a tick
are cast together.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item
from radarsim.protocol import reports
from radarsim.robots.robot import Robot
from radarsim.sensors.proprioceptive import (
    Encoder,
    Ins,
    InsNoise,
    Tachometer,
    encoded_wheels,
)
from radarsim.simulation.config import SimulationConfig


class SensorItem(Protocol):
    """An item that gives readings."""

    def read(self, time: float) -> reports.Report:
        """Return a reading at a simulated time in s."""
        ...

    def reset(self) -> None:
        """Start counting again."""
        ...


@dataclass(frozen=True, slots=True)
class Mounting:
    """What a sensor item is created from.

    Attributes:
        item: The item of the robot's class.
        robot: The robot that carries it.
        rng: The item's own random numbers.
        config: Configuration of the simulation.
        time: Time of the spawn, s.
    """

    item: Item
    robot: Robot
    rng: np.random.Generator
    config: SimulationConfig
    time: float


class _StatelessItem:
    """An item that reads the robot's state, and has none of its own."""

    def __init__(self, mounting: Mounting) -> None:
        self.name = mounting.item.name
        self.robot = mounting.robot

    def reset(self) -> None:
        """Do nothing."""


class GroundTruthItem(_StatelessItem):
    """Reads the true pose of the robot's body."""

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        return reports.GroundTruth(time, self.name, self.robot.body)


class TouchItem(_StatelessItem):
    """Reads whether something touches the robot."""

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        return reports.Touch(time, self.name, self.robot.touched)


class InsItem(_StatelessItem):
    """Reads the drifting pose of an inertial navigation system."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        body = mounting.robot.body
        settings = mounting.config.settings(mounting.item)
        self._ins = Ins(
            body.compose(mounting.item.mount),
            body,
            mounting.rng,
            InsNoise.from_settings(settings),
        )

    def drift(self) -> None:
        """Draw the drift since the last call; due every ``INS_DRIFT_INTERVAL``."""
        self._ins.drift(self.robot.body)

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        return reports.Ins(time, self.name, self._ins.reading(self.robot.body))

    def overwrite(self, pose: Pose3) -> None:
        """Replace the estimated pose."""
        self._ins.overwrite(pose, self.robot.body)


class OdometryItem(_StatelessItem):
    """Reads the pose that follows from the turns of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._odometry = mounting.robot.fleet.add_odometry(mounting.robot)

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        return reports.Odometry(time, self.name, self._odometry.pose)

    def reset(self) -> None:
        """Start again from a pose of zeros."""
        self._odometry.reset()


class TachometerItem(_StatelessItem):
    """Reads speeds and angles of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._tachometer = Tachometer(mounting.time, self.robot.wheel_angles)

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        reading = self._tachometer.read(time, self.robot.wheel_angles)
        return reports.Tachometer(
            time, self.name, reading.velocities, reading.positions
        )

    def reset(self) -> None:
        """Count angles from zero again."""
        self._tachometer.reset(self.robot.wheel_angles)


class EncoderItem(_StatelessItem):
    """Reads ticks of the wheels that are in the item's name."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        wheels = encoded_wheels(self.name, self.robot.model.wheels)
        self._encoder = Encoder(wheels, self.robot.wheel_angles, mounting.rng)

    def read(self, time: float) -> reports.Report:
        """Return a reading."""
        return reports.Encoder(time, self._encoder.ticks(self.robot.wheel_angles))

    def reset(self) -> None:
        """Count ticks from zero again."""
        self._encoder.reset(self.robot.wheel_angles)


def join_encoders(readings: Sequence[reports.Report]) -> list[reports.Report]:
    """Return readings of one time with one report of all encoders, at the first's."""
    encoders = [each for each in readings if isinstance(each, reports.Encoder)]
    others: list[reports.Report] = [
        each for each in readings if not isinstance(each, reports.Encoder)
    ]
    if encoders:
        ticks = tuple(tick for each in encoders for tick in each.ticks)
        at = readings.index(encoders[0])
        others.insert(at, reports.Encoder(encoders[0].time, ticks))
    return others


# By item type, in the order of readings within a tick: clients expect a pose before the
# scan that belongs to it.
SENSOR_ITEMS: dict[str, Callable[[Mounting], SensorItem]] = {
    "GroundTruth": GroundTruthItem,
    "INS": InsItem,
    "Odometry": OdometryItem,
    "Tachometer": TachometerItem,
    "Encoder": EncoderItem,
    "Touch": TouchItem,
}
