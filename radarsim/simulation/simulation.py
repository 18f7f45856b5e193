"""The simulation of all robots in one scene.

In each tick all robots move, in the order of spawning, and then all due readings are
computed. The rays of all scans of a tick are traced together. A robot without due
readings costs only the time of its motion.
"""

import math
from collections.abc import Generator, Mapping, Sequence
from itertools import islice
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarsim import plugins
from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import RobotModel
from radarsim.presets.sensors import sensor_presets
from radarsim.protocol.fields import SensorReport
from radarsim.protocol.reports import RangeScan
from radarsim.raycast.rays import Boxes, EventKind, Rays, Traces
from radarsim.raycast.tracer import tracer_of
from radarsim.robots.fleet import Fleet
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles, finish, overlaps
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.ins import INS_DRIFT_INTERVAL
from radarsim.sensors.readings import Program, ReadingTable
from radarsim.sensors.scan_batch import ScanBatch, ScanRequest, take_scans
from radarsim.sensors.sensor import Sensor
from radarsim.simulation.clock import TICK, Clock, Schedule, ticks_of
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.crates import Crates
from radarsim.simulation.flight import Airspace, Surroundings
from radarsim.simulation.tick_output import (
    DueScan,
    Faults,
    ScanEchoes,
    ScannerItems,
    TickOutput,
    report_scan,
)
from radarsim.simulation.trails import Trails
from radarsim.simulation.vehicle import DueItems, MountedScanner, Vehicle

SEARCH_RADIUS = 1.0  # m around an occupied position
SLICING_WORK: Final = 300_000  # estimated work of slicing around a flying robot
# Maximum number of scans per tick that list their echoes only for watchers. Listing
# takes 1 or 2 ms per scan, so the limit avoids delays for clients.
MAX_SHOWN: Final = 4
MOST_READY_FLOORS: Final = 8  # floors that are sliced before the first spawn
DRIFT_TICKS: Final = ticks_of(INS_DRIFT_INTERVAL)
ITEMS_GROUP: Final = "radarsim.items"  # plugin group of add-ons that read scanners
NOTHING: Final = Boxes(np.zeros((0, 8)))


class Simulation:
    """A simulation: a scene with robots, advanced in ticks of 10 ms.

    Attributes:
        scene: The scene.
        config: Configuration of all robots.
        seed: Seed of all random numbers.
        scanner_items: Scanners read by add-ons, by the name of the add-on's entry.
        crates: The crates of the map, and of clients.
        trails: The trails of robots, which cameras show.
        faults: Errors of single robots.
        shown: The number of the robot, and the name of its camera or None, in the
            pictures for the viewers at each IP address.
    """

    def __init__(
        self, scene: Scene, *, config: SimulationConfig | None = None, seed: int = 0
    ) -> None:
        self.scene = scene
        self.config = config or SimulationConfig()
        self.seed = seed
        self.faults = Faults()
        self.shown: dict[str, tuple[int, str | None]] = {}
        self._clock = Clock()
        self.trails = Trails(self._clock)
        self._tracer = tracer_of(scene)
        self._airspace = Airspace(scene, self._tracer)
        self._obstacles_by_floor: dict[float, Obstacles] = {}
        self._vehicles: dict[int, Vehicle] = {}
        self._fleet = Fleet()
        self.crates = Crates(scene, self._fleet)
        self._readings = ReadingTable(self._fleet)
        self._mortal: dict[Vehicle, None] = {}  # robots whose battery runs out
        self._flying: dict[Vehicle, None] = {}
        self._reporting: Schedule[Vehicle] = Schedule(self._clock)
        self._drifting: Schedule[Vehicle] = Schedule(self._clock)
        self.scanner_items: dict[str, ScannerItems] = {
            name: plugins.load(ITEMS_GROUP, name)(scene, self._clock)
            for name in plugins.names(ITEMS_GROUP)
        }
        self._prepare_spawns()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._clock.time

    @property
    def ticks(self) -> int:
        """Number of ticks since the start of the simulation."""
        return self._clock.ticks

    @ticks.setter
    def ticks(self, ticks: int) -> None:
        self._clock.ticks = ticks

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """All robots of the simulation, in the order of their spawning."""
        return tuple(self._vehicles.values())

    @property
    def body_names(self) -> dict[int, str]:
        """The names of all robots and crates, by the numbers of their bodies."""
        return {body.number: body.name for body in self._fleet.robots}

    def spawn(
        self, name: str, model: RobotModel, pose: Pose2, z: float = -math.inf
    ) -> Vehicle | None:
        """Create a robot as ``spawn_stepwise`` does, but in a single call."""
        return finish(self.spawn_stepwise(name, model, pose, z))

    def spawn_stepwise(
        self, name: str, model: RobotModel, pose: Pose2, z: float = -math.inf
    ) -> Generator[int, None, Vehicle | None]:
        """Create a robot at the nearest free position, at most 1 m from a pose.

        Args:
            name: Name of the robot, which selects its random numbers; a number is
                appended if another robot has that name.
            model: Robot class; the dialect of the simulation selects its items.
            pose: Requested pose, map frame.
            z: Height of a flying robot, m, map frame; raised to the floor if below.

        Yields:
            The work of the next step of the search for a free position, as in
            ``Obstacles.search_free_pose``; nothing if the requested pose is free.

        Returns:
            The robot; None if there is no free position.
        """
        model = model.in_dialect(self.config.dialect.name)
        floor = self.scene.floor_at(pose.x, pose.y)
        height = floor + model.origin_height
        footprint = Footprint(model.length, model.width)
        reach = SEARCH_RADIUS + footprint.radius + 0.1  # a little more than needed
        around: tuple[Surroundings, ...] = ()
        if model.flight is None:
            obstacles = self._obstacles(floor)
        else:
            height = max(height, min(z, self._airspace.ceiling))
            place = pose.x, pose.y, height
            around = (self._airspace.surroundings(model, place, reach),)
            obstacles = around[0].obstacles
        free = yield from obstacles.search_free_pose(
            footprint,
            pose,
            lambda: self._fleet.near(pose.x, pose.y, reach),
            within=SEARCH_RADIUS,
            is_open=lambda places: ~self._are_inside_solids(places, height),
            work=SLICING_WORK if around else 0,
        )
        if free is None:
            return None
        taken = {robot.name for robot in self._fleet.robots}
        unique, number = name, 1
        while unique in taken:
            number += 1
            # An underscore precedes the number, since some clients split names at
            # blanks.
            unique = f"{name}_{number}"
        robot = self._fleet.add(
            unique,
            model,
            free,
            obstacles=obstacles,
            wheel_drive=self.config.wheel_drive(model),
        )
        if model.flight is not None:
            self._airspace.lift(self._fleet, robot, height, *around)
        vehicle = Vehicle(
            robot,
            self.config,
            seed=self.seed,
            schedule=self._reporting,
            readings=self._readings,
            scene=self.scene,
        )
        self._vehicles[vehicle.number] = vehicle
        for items in self.scanner_items.values():
            items.add(vehicle)
        if model.flight is not None:
            self._flying[vehicle] = None
        if vehicle.dialect.battery_runs_out:
            self._mortal[vehicle] = None
        if vehicle.drift.end > vehicle.drift.first:
            self._drifting.add(vehicle, DRIFT_TICKS)
        return vehicle

    def obstacles_at(self, model: RobotModel, pose: Pose2) -> list[str]:
        """Return the names of objects and robots that a robot at a pose would overlap.

        Args:
            model: Robot class.
            pose: Pose of the robot, map frame.
        """
        obstacles = self._obstacles(self.scene.floor_at(pose.x, pose.y))
        footprint = Footprint(model.length, model.width)
        height = obstacles.floor + model.origin_height
        parts = set(obstacles.parts_at(footprint, pose))
        parts |= set(self._solids_around([(pose.x, pose.y)], height)["part"].tolist())
        objects = [self.scene.parts[number].object_name for number in sorted(parts)]
        near = self._fleet.near(pose.x, pose.y, footprint.radius)
        robots = [each.name for each in near if overlaps(footprint, pose, each)]
        return list(dict.fromkeys(objects + robots))

    def remove(self, vehicle: Vehicle) -> None:
        """Remove a robot from the simulation."""
        del self._vehicles[vehicle.number]
        self.trails.end(vehicle.robot)
        self._fleet.remove(vehicle.robot)
        for items in self.scanner_items.values():
            items.remove(vehicle)
        self._mortal.pop(vehicle, None)
        self._flying.pop(vehicle, None)
        self._reporting.remove(vehicle)
        self._drifting.remove(vehicle)

    def step(self) -> None:
        """Advance the simulation by one tick of 10 ms."""
        # The clock advances first, since readings get the time at the end of the tick.
        self._clock.ticks += 1
        # A robot with an empty battery accepts no
        # command to stop, so it is stopped here.
        for vehicle in self._mortal:
            if not vehicle.alive:
                vehicle.robot.halt()
        self._fleet.step(TICK)
        if self._flying:
            robots = [vehicle.robot for vehicle in self._flying]
            rooms = self._airspace.rooms(self._fleet, robots, self.boxes(), TICK)
            for vehicle in self._flying:
                self.faults.call(vehicle, self._fly, vehicle.robot, rooms)
        self.trails.step()
        drifting = self._drifting.due()
        if drifting:
            self._compute([(vehicle, vehicle.drift) for vehicle in drifting])

    def _fly(self, robot: Robot, rooms: Mapping[Robot, float]) -> None:
        self._airspace.climb(self._fleet, robot, rooms.get(robot), TICK)
        robot.tilt(TICK)

    def collect_reports(self) -> dict[int, TickOutput]:
        """Compute all readings of sensors that are due in this tick.

        Returns:
            The reports of each robot, by its number, without robots that have no report
            or an error.
        """
        # The scans of add-ons are read first, since a robot with such a scan sends
        # reports even if no other reading is due.
        read_by_others = self._read_scanner_items()
        reporting = self._reporting.due()
        if not reporting:
            return {}
        due = []
        for vehicle in reporting:
            items = self.faults.call(vehicle, vehicle.due)
            if items is not None:
                due.append((vehicle, items))
        # All sensors get the same boxes of robots,
        # so their order does not affect readings.
        has_rays = any(items.scanners or items.sensors for _, items in due)
        boxes = self.boxes() if has_rays else NOTHING
        sensors = [(v, sensor) for v, items in due for sensor in items.sensors]
        # `_take_readings` may run twice, so readings that draw random numbers or count
        # something are computed once, by `_cast`.
        cast = self._cast(sensors, boxes)
        due = [each for each in due if each[0].number not in self.faults.errors]
        try:
            return self._take_readings(due, read_by_others, cast, boxes)
        except Exception:  # noqa: BLE001 - the loop finds the robot with the error
            outputs: dict[int, TickOutput] = {}
            for vehicle, items in due:
                alone = [(vehicle, items)], read_by_others, cast, boxes
                outputs |= self.faults.call(vehicle, self._take_readings, *alone) or {}
            return outputs

    def _take_readings(
        self,
        due: list[tuple[Vehicle, DueItems]],
        read_by_others: list[DueScan],
        cast: Mapping[int, Sequence[SensorReport]],
        boxes: Boxes,
    ) -> dict[int, TickOutput]:
        """Compute all readings but those in ``cast``; return the reports of each robot.

        Args:
            due: The robots, and their due items.
            read_by_others: Scans of add-ons, possibly also of other robots.
            cast: The readings of ``_cast``.
            boxes: Boxes of all robots.
        """
        scanners = [
            (v, each) for v, items in due for each in items.scanners if each.scans
        ]
        scans: dict[int, list[RangeScan]] = {v.number: [] for v, _ in due}
        echoes: dict[int, list[ScanEchoes | DueScan]] = {}
        listing = self._select_listing(scanners)
        taken = self._scan(scanners, listing, boxes)
        for k, (vehicle, mounted) in enumerate(scanners):
            batch, row = taken[k]
            name, scanner = mounted.item.name, mounted.scanner
            ranges = batch.reported[row]
            report = report_scan(self.time, name, scanner.settings, ranges)
            scans[vehicle.number].append(report)
            if listing[k]:
                scan = batch.scan(row, scanner.name, vehicle.sensor_pose(mounted.item))
                found = ScanEchoes(name, scan.echoes, mounted.sends_echoes)
                echoes.setdefault(vehicle.number, []).append(found)
        for due_scan in read_by_others:
            number = due_scan.vehicle.number
            if number not in scans:
                continue
            scans[number].append(due_scan.scan)
            if due_scan.reports:
                echoes.setdefault(number, []).append(due_scan)
        # One call computes for all robots with a touch sensor what they touch.
        self._fleet.touched([v.robot.slot for v, _ in due if v.has_touch])
        numbers = iter(self._compute([(v, items.program) for v, items in due]))
        return {
            vehicle.number: TickOutput(
                items.groups[vehicle.robot.light],
                list(islice(numbers, items.program.size)),
                cast.get(vehicle.number, ()),
                echoes.get(vehicle.number, ()),
                scans[vehicle.number],
            )
            for vehicle, items in due
        }

    def _read_scanner_items(self) -> list[DueScan]:
        """Return the scans that add-ons read; mark their robots as due for reports."""
        due_scans = [
            due_scan
            for items in self.scanner_items.values()
            for due_scan in items.read_due(self.boxes, self.faults)
        ]
        for due_scan in due_scans:
            self._reporting.request(due_scan.vehicle)
        return due_scans

    def _compute(self, programs: Sequence[tuple[Vehicle, Program]]) -> list[float]:
        """Run the programs of robots, and return the results, robot by robot."""
        jobs = [(vehicle.robot.slot, program) for vehicle, program in programs]
        numbers, is_depleted = self._readings.run(jobs, self.ticks)
        if is_depleted:
            for vehicle, _ in programs:
                vehicle.draw()
        return numbers

    def boxes(self) -> Boxes:
        """Return a bounding box for each robot, with the robot's number as id."""
        return Boxes(self._fleet.boxes())

    def _select_listing(self, due: list[tuple[Vehicle, MountedScanner]]) -> list[bool]:
        """Return for each scanner whether it lists the echoes of its scan in this tick.

        Scanners list echoes if their client has requested them. In addition, up to
        ``MAX_SHOWN`` scanners list echoes for watchers, the longest waiting first.
        """
        listing = [mounted.sends_echoes for _, mounted in due]
        shown = [
            k
            for k, (vehicle, _) in enumerate(due)
            if vehicle.shows_echoes and not listing[k]
        ]
        shown.sort(key=lambda k: due[k][1].shown_at)
        for k in shown[:MAX_SHOWN]:
            listing[k] = True
            due[k][1].shown_at = self.ticks
        return listing

    def _scan(
        self,
        due: list[tuple[Vehicle, MountedScanner]],
        listing: list[bool],
        boxes: Boxes,
    ) -> list[tuple[ScanBatch, int]]:
        """Compute all scans at once; scanners with true ``listing`` list all echoes."""
        requests = []
        for (vehicle, mounted), lists in zip(due, listing, strict=True):
            scanner = mounted.scanner
            if lists:
                scanner = scanner.with_all_echoes
            pose = vehicle.sensor_pose(mounted.item)
            requests.append(ScanRequest(scanner, pose, mounted.rng, vehicle.number))
        return take_scans(self._tracer, requests, boxes)

    def _cast(
        self, due: list[tuple[Vehicle, Sensor]], boxes: Boxes
    ) -> dict[int, list[SensorReport]]:
        """Return the readings of sensors that cast rays, by the number of the robot."""
        call, trace, time = self.faults.call, self._tracer.trace, self.time
        asked = [(vehicle, item, call(vehicle, item.rays)) for vehicle, item in due]
        cast = [(v, item, rays) for v, item, rays in asked if rays is not None]
        readings: dict[int, list[SensorReport]] = {}
        if not cast:
            return readings
        batches = [rays for *_, rays in cast]
        pieces: Sequence[Traces | None]
        try:
            traces = trace(Rays.concatenate(batches), boxes, incidence=True)
            pieces = traces.split([len(rays.max_range) for rays in batches])
        except Exception:  # noqa: BLE001 - some robot has invalid rays
            pieces = [
                call(v, trace, rays, boxes, incidence=True) for v, _, rays in cast
            ]
        for (vehicle, item, _), piece in zip(cast, pieces, strict=True):
            its_readings = readings.setdefault(vehicle.number, [])
            if piece is not None:
                its_readings += call(vehicle, item.read, time, piece) or ()
        return readings

    def _prepare_spawns(self) -> None:
        """Load presets and slice walls at the starts, so that spawning is fast."""
        sensor_presets()
        sensor_presets("items")
        floors = dict.fromkeys(start.pose.z for start in self.scene.starts)
        for floor in islice(floors or [0.0], MOST_READY_FLOORS):
            self._fleet.prepare(self._obstacles(floor))

    def _obstacles(self, floor: float) -> Obstacles:
        if floor not in self._obstacles_by_floor:
            obstacles = Obstacles.from_scene(self.scene, floor=floor)
            self._obstacles_by_floor[floor] = obstacles
        return self._obstacles_by_floor[floor]

    def _are_inside_solids(self, places: Floats, height: float) -> NDArray[np.bool_]:
        """Return which of (N, 2) positions are inside a solid volume.

        Obstacles are only surfaces, so they do not exclude the inside of a large bush.
        """
        inside = np.zeros(len(places), np.bool_)
        inside[self._solids_around(places, height)["ray"]] = True
        return inside

    def _solids_around(self, places: ArrayLike, height: float) -> NDArray[np.void]:
        """Return an event for each solid volume around one of (N, 2) positions.

        ``ray`` of an event is the index of the position, ``part`` that of the volume.
        """
        points = np.column_stack([places, np.full(len(np.asarray(places)), height)])
        # The events of a ray of length 0 list the volumes around its start.
        directions = np.tile([1.0, 0.0, 0.0], (len(points), 1))
        rays = Rays.uniform(points, directions, max_range=0.0)
        events = self._tracer.trace(rays, events=True).events
        starts = events[events["kind"] == EventKind.START_INSIDE]
        solid = np.array([part.material.solid for part in self.scene.parts], np.bool_)
        inside: NDArray[np.void] = starts[solid[starts["part"]]]
        return inside
