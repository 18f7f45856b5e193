"""All robots in one scene, stepped together.

In each tick every robot drives, in the order of spawning, and then everything that is
due is read; the rays of all scans of a tick are cast together.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.presets.robots import RobotModel
from radarsim.protocol.reports import EchoLine, RangeScan, Report, Status
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_batch import scan_batch
from radarsim.simulation.config import TICK, SimulationConfig, seconds
from radarsim.simulation.echo_lines import echo_lines
from radarsim.simulation.vehicle import MountedScanner, Vehicle

SEARCH_RADIUS = 1.0  # m around a place that is taken


@dataclass(frozen=True, slots=True)
class TickOutput:
    """What one robot tells in one tick.

    Attributes:
        status: If it is due.
        readings: Poses first.
        echoes: Of the scans, where a client has asked for them.
        scans: Last of all.
    """

    status: Status | None
    readings: tuple[Report, ...]
    echoes: tuple[EchoLine, ...]
    scans: tuple[RangeScan, ...]


class Simulation:
    """A scene with robots in it.

    Attributes:
        scene: What there is.
        conditions: What holds for all robots.
        seed: Of everything random.
        ticks: How many have passed.
    """

    def __init__(
        self, scene: Scene, *, config: SimulationConfig | None = None, seed: int = 0
    ) -> None:
        self.scene = scene
        self.config = config or SimulationConfig()
        self.seed = seed
        self.ticks = 0
        self._tracer = tracer_of(scene)
        self._floors: dict[float, Obstacles] = {}
        self._vehicles: dict[int, Vehicle] = {}
        self._robots: tuple[Robot, ...] = ()
        self._spawned = 0
        self._warm_up()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return seconds(self.ticks)

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """All robots, in the order of spawning."""
        return tuple(self._vehicles.values())

    def spawn(self, name: str, model: RobotModel, pose: Pose2) -> Vehicle | None:
        """Put a robot on the floor, at the nearest free place within 1 m.

        Args:
            name: Keys what the robot draws; of two of one name, the later gets another
                key.
            model: Its class.
            pose: Wanted, map frame.

        Returns:
            The robot; None if there is no free place.
        """
        obstacles = self._obstacles(self.scene.floor_at(pose.x, pose.y))
        height = obstacles.floor + model.origin_height
        free = obstacles.nearest_free_pose(
            Footprint(model.length, model.width),
            pose,
            self._robots,
            within=SEARCH_RADIUS,
            is_open=lambda places: ~self._are_filled(places, height),
        )
        if free is None:
            return None
        robot = Robot(
            self._free_name(name),
            model,
            free,
            obstacles=obstacles,
            wheel_drive=self.config.wheel_drive(),
        )
        self._spawned += 1
        vehicle = Vehicle(
            self._spawned, robot, self.config, seed=self.seed, tick=self.ticks
        )
        self._vehicles[vehicle.number] = vehicle
        self._robots = (*self._robots, robot)
        return vehicle

    def remove(self, vehicle: Vehicle) -> None:
        """Take a robot off the floor."""
        del self._vehicles[vehicle.number]
        self._robots = tuple(v.robot for v in self._vehicles.values())

    def step(self) -> None:
        """Let 10 ms pass."""
        self.ticks += 1
        for vehicle in self._vehicles.values():
            vehicle.step(TICK, self._robots)

    def collect_reports(self) -> dict[int, TickOutput]:
        """Read all that is due in this tick, by the number of the robot."""
        due = [
            (vehicle, mounted)
            for vehicle in self._vehicles.values()
            for mounted in vehicle.due_scanners()
        ]
        scans: dict[int, list[RangeScan]] = {n: [] for n in self._vehicles}
        echoes: dict[int, list[EchoLine]] = {n: [] for n in self._vehicles}
        for (vehicle, mounted), scan in zip(due, self._scan(due), strict=True):
            scans[vehicle.number].append(self._report(mounted, scan))
            if vehicle.is_listening(mounted.item.name):
                echoes[vehicle.number] += self._echo_lines(mounted, scan)
        return {
            number: TickOutput(
                vehicle.status(),
                tuple(vehicle.readings()),
                tuple(echoes[number]),
                tuple(scans[number]),
            )
            for number, vehicle in self._vehicles.items()
        }

    def _scan(self, due: list[tuple[Vehicle, MountedScanner]]) -> list[Scan]:
        """Take all scans together."""
        if not due:
            return []
        boxes = self._boxes()
        planned = []
        for vehicle, mounted in due:
            scanner = mounted.scanner
            if vehicle.is_listening(mounted.item.name):
                scanner = scanner.with_all_echoes
            pose = vehicle.sensor_pose(mounted.item)
            plan = scanner.plan(self._tracer, pose, mounted.rng, boxes, vehicle.number)
            planned.append((scanner, plan))
        return scan_batch(self._tracer, planned, boxes)

    def _warm_up(self) -> None:
        """Have all that a scan runs compiled now, and not while clients wait for it."""
        radar, place = load_sensor("radar", fov_deg=1), Pose3(0.0, 0.0, 0.0)
        settings = {"incidence_weights": True, "ray_choice": "together"}
        together = load_sensor("radar", fov_deg=1, range_resolution=0.1, **settings)
        rng, boxes = generator_for(0, "warm-up"), self._boxes()
        planned = [
            (scanner, scanner.plan(self._tracer, place, rng, boxes, carrier_id=0))
            for scanner in (radar, radar.with_all_echoes, together)
        ]
        scan_batch(self._tracer, planned, boxes)

    def _report(self, mounted: MountedScanner, scan: Scan) -> RangeScan:
        settings = mounted.scanner.settings
        return RangeScan(
            self.time,
            mounted.item.name,
            math.radians(settings.resolution_deg),
            math.radians(settings.fov_deg),
            np.minimum(scan.ranges, settings.max_range),
        )

    def _echo_lines(self, mounted: MountedScanner, scan: Scan) -> tuple[EchoLine, ...]:
        robots = {number: v.robot.name for number, v in self._vehicles.items()}
        return echo_lines(self.time, mounted.item.name, scan.echoes, robots)

    def _boxes(self) -> Boxes:
        rows = []
        for vehicle in self._vehicles.values():
            body, model = vehicle.robot.body, vehicle.model
            floor = body.z - model.origin_height
            rows.append(
                (
                    *(body.x, body.y, body.yaw, floor, floor + model.height),
                    *(model.length / 2, model.width / 2, vehicle.number),
                )
            )
        return Boxes(np.array(rows, np.float64).reshape(-1, 8))

    def _obstacles(self, floor: float) -> Obstacles:
        if floor not in self._floors:
            self._floors[floor] = Obstacles.from_scene(self.scene, floor=floor)
        return self._floors[floor]

    def _are_filled(self, places: Floats, height: float) -> NDArray[np.bool_]:
        """Tell which of (N, 2) places are within bushes: solid, yet no surfaces."""
        points = np.column_stack([places, np.full(len(places), height)])
        ahead = np.tile([1.0, 0.0, 0.0], (len(places), 1))
        rays = Rays.uniform(points, ahead, max_range=0.0)
        inside = [
            any(
                event.kind is EventKind.START_INSIDE
                and self.scene.parts[event.part].material.solid
                for event in events
            )
            for events in self._tracer.explain(rays)
        ]
        return np.array(inside, np.bool_)

    def _free_name(self, name: str) -> str:
        taken = {robot.name for robot in self._robots}
        wanted, number = name, 1
        while wanted in taken:
            number += 1
            wanted = f"{name} ({number})"
        return wanted
