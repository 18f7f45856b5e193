"""Robots of one class in a scene, driven for one decision period at a time.

They are those of a simulation: the same motion, collisions and scans. Here nothing is
reported between two decisions, so that a period takes a few calls of the engine.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.gym.settings import GoToSettings
from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import Item, RobotModel, load_robot
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.robots.fleet import Fleet
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import COLUMN
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan_batch import ScanRequest, scan_batch, scan_ranges
from radarsim.simulation.clock import TICK, ticks_of
from radarsim.simulation.config import SimulationConfig

MOST_SECONDS: Final = 10_000.0  # of a decision, as nothing interrupts the engine


class BeamReadings(NamedTuple):
    """What the beams of N robots read; (N, beams) each.

    Attributes:
        ranges: m; the maximum range where nothing is detected.
        power: Penetration power that was left where a beam reads, as a share of that
            sent; 0 where nothing is detected, 1 where it is unlimited.
        rays: Which ray of its beam gave each range: -1 right, 0 centre, 1 left; 0 for a
            sensor without side rays.
    """

    ranges: Floats
    power: Floats
    rays: Floats


class Arena:
    """A scene with N robots.

    Attributes:
        scene: The map.
        model: Class of the robots.
        scanner: The scanner that each carries.
        max_speed: Highest speed of a robot, m/s.
        max_turn_rate: Highest turn rate, rad/s.
    """

    def __init__(self, settings: GoToSettings, count: int, *, meets: bool) -> None:
        """Load the map; robots are to be placed first.

        Args:
            settings: The map, the robots' class and scanner, and the period.
            count: N.
            meets: Whether robots see and touch each other.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            ValueError: If the class has no such scanner or is a car, or the period is
                too short.
        """
        config, map_ = SimulationConfig(), settings.map
        self.scene = map_ if isinstance(map_, Scene) else load_map(map_)
        self.model = load_robot(settings.robot).in_dialect(config.dialect.name)
        if self.model.steering is not None:
            text = f"robot {self.model.name!r} steers as a car does"
            raise ValueError(f"{text}, expected one that is skid-steered")
        period = settings.decision_period
        # Less than half a tick would be rounded to a period of none.
        if not TICK / 2 < period < math.inf:
            text = f"decision period {period!r} s, expected at least {TICK:g} s"
            raise ValueError(text)
        if period > MOST_SECONDS:
            text = f"decision period {period!r} s, expected at most {MOST_SECONDS:g} s"
            raise ValueError(text)
        self._meets, self._ticks = meets, ticks_of(period)
        item = _scanner_item(self.model, settings.scanner)
        config = config.with_settings(item, settings.sensor_settings)
        self.scanner: RangeScanner = config.scanner(item)
        self._mount = item.mount
        self._tracer = tracer_of(self.scene)
        self._obstacles: dict[float, Obstacles] = {}
        self._fleet, drive = Fleet(), config.wheel_drive(self.model)
        self._max_spin = drive.max_spin_rad_s
        self.max_speed = self._max_spin * self.model.wheel_radius
        self.max_turn_rate = 2 * self.max_speed / self.model.track
        self._robots = tuple(
            self._fleet.add(
                f"robot_{row}",
                self.model,
                Pose2(0.0, 0.0),
                obstacles=self._obstacles_at(0.0, 0.0),
                wheel_drive=drive,
            )
            for row in range(count)
        )
        self._slots = self._fleet.slots
        self._present = np.ones(count, np.bool_)

    @property
    def radius(self) -> float:
        """Radius of the circle around a robot, m."""
        return Footprint(self.model.length, self.model.width).radius

    @property
    def poses(self) -> Floats:
        """Poses of all robots, (N, 3): x, y and yaw, m and rad, map frame."""
        first = COLUMN["x"]
        return self._fleet.columns[self._slots, first : first + 3]

    def places_of_others(self, row: int) -> list[tuple[float, float]]:
        """Return x and y, m, of the robots that one may run into."""
        others = self._present & (np.arange(len(self._robots)) != row)
        return [(x, y) for x, y, _ in self.poses[others & self._meets].tolist()]

    def place(self, row: int, pose: Pose2) -> None:
        """Put a robot somewhere, where it stands still; no free place is looked for."""
        self._present[row] = True
        self._fleet.place(self._robots[row], pose, self._obstacles_at(pose.x, pose.y))

    def nearest_free_pose(self, pose: Pose2) -> Pose2:
        """Return the nearest pose, within 1 m, at which a robot touches no obstacle.

        Raises:
            ValueError: If there is none.
        """
        obstacles = self._obstacles_at(pose.x, pose.y)
        footprint = Footprint(self.model.length, self.model.width)
        free = obstacles.nearest_free_pose(footprint, pose)
        if free is None:
            raise ValueError(
                f"start {pose.x:g},{pose.y:g}: no free place within 1 m of it"
                f" on map {self.scene.name!r}"
            )
        return free

    def take_out(self, row: int) -> None:
        """Let a robot neither drive, nor be seen or touched, until it is placed."""
        self._present[row] = False

    def drive(self, speeds: Floats) -> NDArray[np.bool_]:
        """Let all robots drive for a period.

        Args:
            speeds: (N, 2) speeds of the left and right wheels as shares of the highest
                one, -1 to 1.

        Returns:
            (N,) whether a robot was blocked or touched anything meanwhile.
        """
        # Straight into the table: calls for each robot would cost more than its motion.
        first = COLUMN["left_spin"]
        self._fleet.columns[self._slots, first : first + 2] = speeds * self._max_spin
        touched = np.zeros(len(self._robots), np.bool_)
        # All ticks of a period in one call of the engine.
        touched[self._present] = self._fleet.drive(
            self._slots[self._present], TICK, self._ticks, meets=self._meets
        )
        return touched

    def scan(
        self, rngs: Sequence[np.random.Generator], chosen: NDArray[np.bool_]
    ) -> Floats:
        """Take a scan of each chosen robot.

        Args:
            rngs: Source of randomness of each robot.
            chosen: (N,) whether a robot scans.

        Returns:
            (N, beams) ranges, m; the maximum range where nothing is detected, and for
            robots that do not scan or were taken out.
        """
        ranges = self._blank(self.scanner.settings.max_range)
        scanning = chosen & self._present
        requests = self._requests(rngs, scanning)
        ranges[scanning] = scan_ranges(self._tracer, requests, self._seen()).ranges
        return ranges

    def read_beams(
        self, rngs: Sequence[np.random.Generator], chosen: NDArray[np.bool_]
    ) -> BeamReadings:
        """Take the same scans as ``scan``, and return more of them, which takes longer.

        Args:
            rngs: Source of randomness of each robot.
            chosen: (N,) whether a robot scans.
        """
        most = self.scanner.settings.max_range
        found = BeamReadings(self._blank(most), self._blank(0.0), self._blank(0.0))
        scanning = chosen & self._present
        scans = scan_batch(self._tracer, self._requests(rngs, scanning), self._seen())
        for row, scan in zip(np.flatnonzero(scanning), scans, strict=True):
            found.ranges[row] = np.minimum(scan.ranges, most)
            echoes = scan.echoes
            # A beam reads one of its echoes: the one whose range is that of the scan.
            is_read = echoes.ranges == scan.ranges[echoes.beams]
            left, sent = echoes.power[is_read], echoes.settings.penetration_power
            shares = np.ones(len(left))
            limited = np.isfinite(left)
            # What never loses power has an infinite one: nothing of it is lost.
            shares[limited] = left[limited] / sent if sent else 0.0
            found.power[row, echoes.beams[is_read]] = np.clip(shares, 0.0, 1.0)
            if scan.rays is not None:
                found.rays[row] = scan.rays
        return found

    def _blank(self, value: float) -> Floats:
        return np.full((len(self._robots), len(self.scanner.angles)), value)

    def _requests(
        self, rngs: Sequence[np.random.Generator], scanning: NDArray[np.bool_]
    ) -> list[ScanRequest]:
        return [
            ScanRequest(
                self.scanner,
                self._robots[row].body.compose(self._mount),
                rngs[row],
                self._robots[row].number,
            )
            for row in np.flatnonzero(scanning).tolist()
        ]

    def _seen(self) -> Boxes | None:
        """Return the boxes of the robots, if they see each other."""
        return Boxes(self._fleet.boxes()[self._present]) if self._meets else None

    def _obstacles_at(self, x: float, y: float) -> Obstacles:
        floor = self.scene.floor_at(x, y)
        # What stands on another storey is no obstacle; few heights occur, each computed
        # once.
        if floor not in self._obstacles:
            self._obstacles[floor] = Obstacles.from_scene(self.scene, floor=floor)
        return self._obstacles[floor]


def _scanner_item(model: RobotModel, name: str | None) -> Item:
    items = model.items_of("RangeScanner")
    if name is not None:
        items = tuple(i for i in items if i.name.casefold() == name.casefold())
    if not items:
        known = [item.name for item in model.items_of("RangeScanner")]
        text = f"robot {model.name}: scanner {name!r}, expected one of {known}"
        raise ValueError(text)
    return items[0]
