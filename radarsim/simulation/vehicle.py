"""A robot with its battery and its items."""

import math
from bisect import bisect_left
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.engine import engine
from radarsim.geometry import Pose3
from radarsim.presets.robots import Item, RobotModel
from radarsim.presets.sensors import has_fmcw
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import ReportGroup
from radarsim.protocol.packages import LinkOrder
from radarsim.protocol.reports import AerialStatus, Status
from radarsim.rng import generator_for
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.body import TouchSensor
from radarsim.sensors.ins import Ins
from radarsim.sensors.mission_package import MissionPackage
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.readings import Job, Program, ReadingTable, RobotState
from radarsim.sensors.sensor import (
    EngineSensor,
    Mounting,
    Reading,
    Sensor,
    kinds,
    rank,
)
from radarsim.sensors.wheels import join_encoders
from radarsim.simulation.clock import Schedule, seconds, ticks_of
from radarsim.simulation.config import (
    DEFAULT_INTERVAL,
    SimulationConfig,
    check_rays,
)

STATUS_TICKS: Final = ticks_of(DEFAULT_INTERVAL)
MOST_VIEWPORTS: Final = 4  # viewports per picture
STATUS_ONLY: Final = -1  # marks a set of intervals in which only the status is due


@dataclass(slots=True, eq=False)
class MountedScanner:
    """A scanner that is mounted on a robot.

    Attributes:
        item: The item of the robot's class.
        scanner: The scanner, which can be replaced.
        rng: The random generator of the scanner.
        sends_echoes: Whether the client of the robot gets the echoes of the scans.
        sends_targets: Whether the client gets the targets found by the detector.
        shown_at: Tick in which the echoes were last listed for watchers only.
    """

    item: Item
    scanner: RangeScanner
    rng: np.random.Generator
    sends_echoes: bool = False
    sends_targets: bool = False
    shown_at: int = -1

    @property
    def scans(self) -> bool:
        """Whether all beams scan at the same instant, without a rotating antenna."""
        return not self.scanner.settings.has_detector

    @property
    def has_fmcw(self) -> bool:
        """Whether the scanner is an FMCW radar, which can report spectra."""
        return has_fmcw(self.scanner.name)


class DueItems(NamedTuple):
    """The items of a robot that are due in the same tick.

    Attributes:
        groups: Templates of the status, if due, and of readings without rays: one
            group with the headlight off, and one with the headlight on.
        program: The program that computes the numbers of these reports.
        sensors: Sensors with rays, or that are read in Python.
        scanners: Range scanners, in mounting order.
    """

    groups: tuple[ReportGroup, ReportGroup]
    program: Program
    sensors: tuple[Sensor, ...]
    scanners: tuple[MountedScanner, ...]


class Vehicle:
    """A robot, its battery and its items.

    Attributes:
        number: Number of the robot within the simulation.
        robot: The body that moves.
        config: Configuration of the items.
        spawn_tick: Tick of the spawn, from which all intervals are counted.
        scanners: Range scanners, in mounting order.
        drift: Program that updates the drift of the INS items; empty without any.
        has_touch: Whether the robot has a touch sensor.
        dialect: The dialect of lines sent to the client.
        extra_rays: Rays per second that changes of settings have added.
        cameras: The cameras, in mounting order.
        fovs: Fields of view of the cameras by name, degrees.
        viewports: Names of the cameras in the four viewports of a picture; None for an
            empty viewport.
        is_quad: Whether a picture shows all four viewports, not only the first.
        address: Address of the client's machine; empty if unknown.
        shows_echoes: Whether scanners list their echoes for watchers.
    """

    def __init__(
        self,
        robot: Robot,
        config: SimulationConfig,
        *,
        seed: int,
        schedule: "Schedule[Vehicle]",
        readings: ReadingTable,
        scene: Scene,
    ) -> None:
        """Create a robot that is spawned in the current tick.

        Args:
            robot: The body that moves.
            config: Configuration of the simulation.
            seed: Seed of the simulation.
            schedule: Schedule to which the vehicle adds the intervals of its reports.
            readings: Table of the states of all sensors.
            scene: The scene of the simulation.
        """
        self.number = robot.number
        self.robot = robot
        self.config = self._first_config = config
        dialect = config.dialect.of_generation(robot.model.generation)
        self.dialect = dialect
        self._empty_age = _empty_age(dialect)
        self._schedule, self._clock = schedule, schedule.clock
        self.spawn_tick = self._clock.ticks
        self._requested_scans: set[str] = set()
        self._changed: set[str] = set()  # names of scanners that must be replaced
        self.shows_echoes, self.extra_rays, self.address = False, 0.0, ""
        self.cameras = cameras = robot.model.items_of("Camera")
        self.fovs = {c.name: config.settings_of(c).fov_deg for c in cameras}
        shown = [*(camera.name for camera in cameras), *[None] * MOST_VIEWPORTS]
        self.viewports: list[str | None] = shown[:MOST_VIEWPORTS]
        self.is_quad = len(cameras) > 1
        self._due_items: dict[tuple[int, ...], DueItems] = {}
        self._readings, self._state = readings, RobotState(readings, robot.slot)
        self._status_jobs = self._power_status()
        items = robot.model.items
        self._interval_ticks = {i.name: ticks_of(config.interval(i)) for i in items}
        rngs = {i.name: generator_for(seed, robot.name, i.name) for i in items}
        self.scanners = tuple(
            MountedScanner(item, config.scanner(item), rngs[item.name])
            for item in robot.model.items_of("RangeScanner")
        )
        self._sensors = self._mount_sensors(rngs, scene)
        self.has_touch = any(isinstance(s, TouchSensor) for s in self._sensors)
        drifting = [each.drift for each in self._sensors if isinstance(each, Ins)]
        self.drift = readings.program(drifting, 0)
        self._reschedule()

    def _power_status(self) -> dict[str, list[Job]]:
        """Add the battery to the robot's state; return jobs that compute the status."""
        charge, dialect = np.zeros(1, engine.rows["Charge"]), self.dialect
        charge["life"], charge["spawn_tick"] = dialect.battery_start, self.spawn_tick
        # Clients pause a robot whose battery reads 0, so a
        # battery that never gets empty reads at least 1.
        charge["least"] = 0.0 if dialect.battery_runs_out else 1.0
        return {
            "time": [Job(Reading.TIME)],
            "battery": [Job(Reading.CHARGE, self._state.add(charge).start)],
            "steering": [Job(Reading.STEERING)],
        }

    def _mount_sensors(
        self, rngs: Mapping[str, np.random.Generator], scene: Scene
    ) -> list[Sensor]:
        """Return the sensors of the robot, in the order of their readings."""
        mountings: dict[str, list[Mounting]] = {}
        for item in self.model.items:
            kind = kinds().get(item.type)
            if kind is None:
                continue
            mounting = Mounting(
                item,
                self.config.settings_of(item),
                self.robot,
                self._state,
                rngs[item.name],
                scene,
                self.config.dialect,
                self._clock.time,
            )
            key = item.type if kind.is_joined else item.name
            mountings.setdefault(key, []).append(mounting)
        sensors = [kinds()[each[0].item.type](*each) for each in mountings.values()]
        return sorted(sensors, key=lambda sensor: rank(sensor.item.type))

    @property
    def model(self) -> RobotModel:
        """The robot class: body, steering and items."""
        return self.robot.model

    @property
    def alive(self) -> bool:
        """Whether the robot's battery is not yet empty."""
        return self._age < self._empty_age

    @property
    def _age(self) -> int:
        """Ticks since the robot was spawned."""
        return self._clock.ticks - self.spawn_tick

    def due(self) -> DueItems:
        """Return the items due in this tick; only the status once the battery is empty.

        A requested scan is an extra scan, so a scanner can be in the result twice. The
        requests are cleared.
        """
        age = self._age
        # An item is due if its interval ends in this tick.
        ended = tuple([each for each in self._intervals if age % each == 0])
        if age >= self._empty_age:
            ended = (STATUS_ONLY, *ended)
        # There are only few combinations of intervals, so
        # the due items of each combination are cached.
        due = self._due_items.get(ended)
        if due is None:
            due = self._due_items[ended] = self._select_items(ended)
        if age >= self._empty_age:
            return due
        if self._changed and (due.scanners or self._requested_scans):
            for mounted in self.scanners:
                if mounted.item.name in self._changed:
                    mounted.scanner = self.config.scanner(mounted.item)
            self._changed.clear()
        if not self._requested_scans:
            return due
        requested = [m for m in self.scanners if m.item.name in self._requested_scans]
        self._requested_scans.clear()
        return due._replace(scanners=(*due.scanners, *requested))

    def draw(self) -> None:
        """Draw new random numbers if a sensor has used up its random numbers."""
        if self._state.is_depleted:
            self._state.is_depleted = False
            for sensor in self._sensors:
                sensor.draw()

    def sensor_pose(self, item: Item) -> Pose3:
        """Return the pose of an item of the robot in the map frame."""
        return self.robot.body.compose(item.mount)

    def camera_pose(self, item: Item) -> Pose3:
        """Return the pose of a camera, map frame; the camera looks along its x axis."""
        body = self.robot.body
        for sensor in self._sensors:
            if isinstance(sensor, MissionPackage) and sensor.item.name == item.parent:
                body = body.compose(sensor.tip(self._clock.ticks))
        return body.compose(item.mount)

    def zoom(self, camera: Item, fov_deg: float) -> None:
        """Set the field of view of a camera within the camera's limits.

        Args:
            camera: A camera of the robot.
            fov_deg: Horizontal field of view, degrees; 0 for the configured one.
        """
        settings = self.config.settings_of(camera)
        self.fovs[camera.name] = settings.limit(fov_deg or settings.fov_deg)

    def request_scan(self, item: Item) -> None:
        """Request an extra scan in the next tick, if the item is a range scanner."""
        if item.type == "RangeScanner":
            self._requested_scans.add(item.name)
            self._schedule.request(self)

    def change_settings(
        self,
        items: Sequence[Item],
        settings: Mapping[str, Any],
        others: Iterable["Vehicle"] = (),
    ) -> None:
        """Change settings of scanners; the next scans use the new settings.

        If there is an error, no scanner is changed.

        Args:
            items: Range scanners of the robot.
            settings: Settings by name, as in a configuration.
            others: Robots that share the limit of additional rays.

        Raises:
            PresetError: If there is no such setting, or a value is out of range, or
                scans would have more rays than a client may request.
        """
        config = self.config
        for item in items:
            config = config.with_settings(item, settings)
        scanners = [mounted.item for mounted in self.scanners]
        shared = sum(other.extra_rays for other in others if other is not self)
        # The limits come from the first configuration, where
        # the operator of the server may have allowed more rays.
        self.extra_rays = check_rays(
            scanners, config, self._first_config, self.extra_rays, shared
        )
        self.config = config
        self._changed |= {item.name for item in items}
        ticks = {item.name: ticks_of(config.interval(item)) for item in items}
        if not ticks.items() <= self._interval_ticks.items():
            self._interval_ticks |= ticks
            self._reschedule()

    def reset(self, item: Item) -> None:
        """Reset the counters of a sensor; a sensor without counters does not change."""
        for sensor in self._sensors:
            if sensor.item.name == item.name:
                sensor.reset()

    def move_link(self, order: LinkOrder) -> bool:
        """Move a link of an arm or a camera mount; return False if it is unknown."""
        packages = (s for s in self._sensors if isinstance(s, MissionPackage))
        return any(package.move(order, self._clock.ticks) for package in packages)

    def set_ins(self, item: Item, pose: Pose3) -> None:
        """Replace the estimated pose of an INS; items of other types are ignored."""
        for sensor in self._sensors:
            if isinstance(sensor, Ins) and sensor.item.name == item.name:
                sensor.overwrite(pose)

    def _reschedule(self) -> None:
        """Schedule the robot for all intervals of its items and of its status."""
        self._intervals = sorted({STATUS_TICKS, *self._interval_ticks.values()})
        self._due_items.clear()
        # Intervals are counted from the spawn, so a change of settings does not shift
        # the readings of other items.
        self._schedule.remove(self)
        for interval in self._intervals:
            self._schedule.add(self, interval, self.spawn_tick)
        if self._requested_scans:
            self._schedule.request(self)

    def _select_items(self, intervals: Collection[int]) -> DueItems:
        due = {name for name, each in self._interval_ticks.items() if each in intervals}
        if STATUS_ONLY in intervals:
            due.clear()
        sensors = [each for each in self._sensors if each.item.name in due]
        sources = [each.source for each in sensors if isinstance(each, EngineSensor)]
        if "Encoder" in self.dialect.joined:
            sources = join_encoders(sources)
        lit = sources
        steering = None if self.robot.bicycle is None else (0.0, 0.0)
        if STATUS_TICKS in intervals:
            kind = Status if self.model.flight is None else AerialStatus
            sources, lit = (
                [(kind(0.0, 0, light, steering), self._status_jobs), *sources]
                for light in (False, True)
            )
        # The order of the jobs is the order of the numbers in the report lines.
        jobs: list[Job] = []
        size = 0
        for sample, jobs_of in sources:
            for attribute in sample.sources(self.dialect):
                jobs += jobs_of[attribute]
            size += len(sample.split(self.dialect)[1])
        off, on = (
            ReportGroup([sample for sample, _ in each], self.dialect)
            for each in (sources, lit)
        )
        return DueItems(
            (off, on),
            self._readings.program(jobs, size),
            tuple([s for s in sensors if not isinstance(s, EngineSensor)]),
            tuple([each for each in self.scanners if each.item.name in due]),
        )


def _empty_age(dialect: Dialect) -> float:
    """Return the age of a robot, in ticks, at which its battery is almost empty.

    The battery drains with time only, independent of the robot's motion.
    """
    life = dialect.battery_start
    if not dialect.battery_runs_out:
        return math.inf
    ages = range(ticks_of(life) + 1)
    # The status uses the same formula, so status and battery change in the same tick.
    return bisect_left(ages, True, key=lambda age: life - seconds(age) < 1.0)
