"""A robot with everything that it carries."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radarsim.geometry import Pose3
from radarsim.presets.robots import Item, RobotModel
from radarsim.protocol.reports import Report, Status
from radarsim.rng import generator_for
from radarsim.robots.robot import Battery, Robot
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.simulation.config import (
    DEFAULT_INTERVAL,
    SimulationConfig,
    seconds,
    ticks_of,
)
from radarsim.simulation.items import (
    INSTRUMENTS,
    InsInstrument,
    Instrument,
    Mounting,
)

# What is read first in a tick; clients want a pose before the scan that it belongs to.
ORDER = ("GroundTruth", "INS", "Odometry", "Tachometer", "Encoder", "Touch")
STATUS_TICKS = ticks_of(DEFAULT_INTERVAL)


@dataclass(frozen=True, slots=True)
class MountedScanner:
    """A scanner on a robot, with what it draws from."""

    item: Item
    scanner: RangeScanner
    rng: np.random.Generator


class Vehicle:
    """A robot, its battery and its instruments.

    Attributes:
        number: Tells it from all other robots of the simulation.
        robot: What drives.
        battery: What lasts.
        scanners: In mounting order.
    """

    def __init__(
        self,
        number: int,
        robot: Robot,
        config: SimulationConfig,
        *,
        seed: int,
        tick: int,
    ) -> None:
        self.number = number
        self.robot = robot
        dialect = config.dialect
        self.battery = Battery(dialect.battery_start, dialect.battery_runs_out)
        self._born = tick
        self._tick = tick
        self._extra_scans: set[str] = set()
        self._listening: set[str] = set()
        self._every: dict[str, int] = {}
        self._instruments: dict[str, Instrument] = {}
        scanners = []
        for item in robot.model.items:
            rng = generator_for(seed, robot.name, item.name)
            self._every[item.name] = ticks_of(config.interval(item))
            if item.type == "RangeScanner":
                scanners.append(MountedScanner(item, config.scanner(item), rng))
            elif item.type in INSTRUMENTS:
                mounting = Mounting(item, robot, rng, config, seconds(tick))
                self._instruments[item.name] = INSTRUMENTS[item.type](mounting)
        self.scanners = tuple(scanners)
        self._ordered = sorted(
            (item for item in robot.model.items if item.name in self._instruments),
            key=lambda item: ORDER.index(item.type),
        )

    @property
    def model(self) -> RobotModel:
        """The robot's class."""
        return self.robot.model

    @property
    def alive(self) -> bool:
        """Whether the battery still has something."""
        return not self.battery.is_empty(seconds(self._tick - self._born))

    def step(self, dt: float, others: tuple[Robot, ...]) -> None:
        """Drive and measure for one tick of ``dt`` s."""
        self._tick += 1
        if not self.alive:
            self.robot.halt()
        self.robot.step(dt, others)
        for instrument in self._instruments.values():
            instrument.tick(self._tick - self._born)

    def status(self) -> Status | None:
        """Tell how the robot is, when that is due."""
        if (self._tick - self._born) % STATUS_TICKS:
            return None
        left = self.battery.seconds_left(seconds(self._tick - self._born))
        return Status(seconds(self._tick), left, self.robot.light)

    def readings(self) -> Iterator[Report]:
        """Read the instruments that are due, poses first."""
        if not self.alive:
            return
        for item in self._ordered:
            if self._is_due(item):
                yield self._instruments[item.name].report(seconds(self._tick))

    def due_scanners(self) -> list[MountedScanner]:
        """Find the scanners that are due, or that a client has asked for.

        One that is both is there twice, as a client that asks gets an extra scan.
        """
        if not self.alive:
            return []
        due = [mounted for mounted in self.scanners if self._is_due(mounted.item)]
        asked = [m for m in self.scanners if m.item.name in self._extra_scans]
        self._extra_scans.clear()
        return due + asked

    def sensor_pose(self, item: Item) -> Pose3:
        """Give the pose of an item in the map frame."""
        return self.robot.body.compose(item.mount)

    def order(self, item: Item, opcode: str) -> None:
        """Do what a client asks of an item; anything but SCAN and RESET is nothing."""
        if opcode == "SCAN" and item.type == "RangeScanner":
            self._extra_scans.add(item.name)
        elif opcode == "RESET" and item.name in self._instruments:
            self._instruments[item.name].reset()

    def listen(self, item: Item, on: bool) -> None:
        """Switch on or off that a scanner's echoes are told."""
        if on:
            self._listening.add(item.name)
        else:
            self._listening.discard(item.name)

    def is_listening(self, item_name: str) -> bool:
        """Tell whether a scanner's echoes are to be told."""
        return item_name in self._listening

    def set_ins(self, item: Item, pose: Pose3) -> None:
        """Overwrite the estimate of an INS; nothing for any other item."""
        instrument = self._instruments.get(item.name)
        if isinstance(instrument, InsInstrument):
            instrument.overwrite(pose)

    def _is_due(self, item: Item) -> bool:
        return (self._tick - self._born) % self._every[item.name] == 0
