"""The items of a robot that send readings, all with the same three verbs.

``tick`` is called in every step, ``report`` when a reading is due, ``reset`` when a
client asks. Scanners are not among them: their rays are cast together with others'.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item
from radarsim.protocol import reports
from radarsim.robots.robot import Robot
from radarsim.sensors.proprioceptive import (
    INS_DRAW_INTERVAL,
    Encoder,
    Ins,
    InsNoise,
    Odometry,
    Tachometer,
)
from radarsim.simulation.config import SimulationConfig, ticks_of

DRAW_TICKS = ticks_of(INS_DRAW_INTERVAL)


class Instrument(Protocol):
    """An item that sends readings."""

    def tick(self, age: int) -> None:
        """Take part in a step; ``age`` counts ticks since the spawn."""
        ...

    def report(self, time: float) -> reports.Report:
        """Read, at a simulated time in s."""
        ...

    def reset(self) -> None:
        """Count from here on."""
        ...


@dataclass(frozen=True, slots=True)
class Mounting:
    """What an instrument is made of.

    Attributes:
        item: Of the robot's class.
        robot: That carries it.
        rng: The item's own.
        conditions: Of the simulation.
        time: Of the spawn, s.
    """

    item: Item
    robot: Robot
    rng: np.random.Generator
    config: SimulationConfig
    time: float


class _Still:
    """What does nothing between readings, and has nothing to reset."""

    def __init__(self, mounting: Mounting) -> None:
        self.name = mounting.item.name
        self.robot = mounting.robot

    def tick(self, age: int) -> None:
        """Do nothing."""

    def reset(self) -> None:
        """Do nothing."""


class GroundTruthInstrument(_Still):
    """Tells where the body is."""

    def report(self, time: float) -> reports.Report:
        """Read."""
        return reports.GroundTruth(time, self.name, self.robot.body)


class TouchInstrument(_Still):
    """Tells whether something touches the robot."""

    def report(self, time: float) -> reports.Report:
        """Read."""
        return reports.Touch(time, self.name, self.robot.touched)


class InsInstrument(_Still):
    """Tells where it believes to be."""

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

    def tick(self, age: int) -> None:
        """Draw the drift when it is due."""
        if age % DRAW_TICKS == 0:
            self._ins.draw(self.robot.body)

    def report(self, time: float) -> reports.Report:
        """Read."""
        return reports.Ins(time, self.name, self._ins.reading(self.robot.body))

    def overwrite(self, pose: Pose3) -> None:
        """Set the estimate by hand."""
        self._ins.overwrite(pose, self.robot.body)


class OdometryInstrument(_Still):
    """Tells the pose that the wheels tell."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        model = mounting.robot.model
        self._odometry = Odometry(
            wheel_radius=model.wheel_radius, wheel_separation=model.wheel_separation
        )

    def tick(self, age: int) -> None:  # noqa: ARG002 - the verb of all instruments
        """Follow the wheels; in each step they keep their speeds."""
        self._odometry.update(*self.robot.side_angles)

    def report(self, time: float) -> reports.Report:
        """Read."""
        return reports.Odometry(time, self.name, self._odometry.pose)

    def reset(self) -> None:
        """Begin again here."""
        self._odometry.reset()


class TachometerInstrument(_Still):
    """Tells speeds and angles of the wheels."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._tachometer = Tachometer(mounting.time, self.robot.wheel_angles)

    def report(self, time: float) -> reports.Report:
        """Read."""
        reading = self._tachometer.scan(time, self.robot.wheel_angles)
        return reports.Tachometer(
            time, self.name, reading.velocities, reading.positions
        )

    def reset(self) -> None:
        """Count positions from here."""
        self._tachometer.reset(self.robot.wheel_angles)


class EncoderInstrument(_Still):
    """Tells ticks of the wheels that its name mentions."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._encoder = Encoder(self.name, self.robot.wheel_angles, mounting.rng)

    def report(self, time: float) -> reports.Report:
        """Read."""
        return reports.Encoder(time, self._encoder.ticks(self.robot.wheel_angles))

    def reset(self) -> None:
        """Count from here."""
        self._encoder.reset(self.robot.wheel_angles)


INSTRUMENTS: dict[str, Callable[[Mounting], Instrument]] = {
    "GroundTruth": GroundTruthInstrument,
    "INS": InsInstrument,
    "Odometry": OdometryInstrument,
    "Tachometer": TachometerInstrument,
    "Encoder": EncoderInstrument,
    "Touch": TouchInstrument,
}
