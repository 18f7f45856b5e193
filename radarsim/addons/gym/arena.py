"""Robots of one class in a scene, driven for one decision period at a time.

They are those of a simulation: the same motion, collisions and scans. Here nothing is
reported between two decisions, so that a period takes a few calls of the engine.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.client.robot_info import same_name
from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import Item, RobotModel, load_robot
from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.robots.fleet import Fleet
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles, finish
from radarsim.robots.robot import COLUMN
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_batch import ScanRequest, take_scans
from radarsim.simulation.clock import TICK, ticks_of
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.gym.environment import GoToSettings

MOST_SECONDS: Final = 10_000.0  # of a decision, as nothing interrupts the engine


class Arena:
    """A scene with N robots.

    Attributes:
        scene: The map.
        model: Class of the robots.
        scanner: The scanner that each carries.
        max_speed: Highest speed of a robot, m/s.
        max_turn_rate: Highest turn rate, rad/s.
    """

    def __init__(self, settings: "GoToSettings", count: int, *, meets: bool) -> None:
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
        if not TICK / 2 < period <= MOST_SECONDS:
            expected = f"expected {TICK:g} to {MOST_SECONDS:g} s"
            raise ValueError(f"decision period {period!r} s, {expected}")
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
        free = finish(obstacles.search_free_pose(footprint, pose))
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
        self,
        rngs: Sequence[np.random.Generator],
        chosen: NDArray[np.bool_],
        values: Sequence[str],
    ) -> dict[str, Floats]:
        """Take a scan of each chosen robot.

        Args:
            rngs: Source of randomness of each robot.
            chosen: (N,) whether a robot scans.
            values: What else of each beam is read, which takes longer: ``power``, the
                penetration power left where it reads, as a share of that sent, 0 where
                nothing is detected, 1 where it is unlimited; ``rays``, which ray of it
                gave the range: -1 right, 0 centre, 1 left.

        Returns:
            (N, beams) each: ``ranges``, m, the maximum range where nothing is detected,
            and for robots that do not scan or were taken out; and the other values.
        """
        shape = len(self._robots), len(self.scanner.angles)
        found = {"ranges": np.full(shape, self.scanner.settings.max_range)}
        found |= {name: np.zeros(shape) for name in values}
        rows = np.flatnonzero(chosen & self._present)
        requests = [
            ScanRequest(
                self.scanner,
                self._robots[row].body.compose(self._mount),
                rngs[row],
                self._robots[row].number,
            )
            for row in rows.tolist()
        ]
        # They see each other, or none.
        boxes = Boxes(self._fleet.boxes()[self._present]) if self._meets else None
        taken = take_scans(self._tracer, requests, boxes)
        for row, request, (batch, k) in zip(rows, requests, taken, strict=True):
            found["ranges"][row] = batch.reported[k]
            if "rays" in values and batch.rays is not None:
                found["rays"][row] = batch.rays[k]
            if "power" in values:
                scan = batch.scan(k, request.scanner.name, request.pose)
                found["power"][row] = _power_left(scan)
        return found

    def _obstacles_at(self, x: float, y: float) -> Obstacles:
        floor = self.scene.floor_at(x, y)
        # What stands on another storey is no obstacle; few heights occur, each computed
        # once.
        if floor not in self._obstacles:
            self._obstacles[floor] = Obstacles.from_scene(self.scene, floor=floor)
        return self._obstacles[floor]


def _power_left(scan: Scan) -> Floats:
    """Return the share of its power that each beam has left where it reads."""
    echoes, shares = scan.echoes, np.zeros(len(scan.ranges))
    # A beam reads one of its echoes: the one whose range is that of the scan.
    is_read = echoes.ranges == scan.ranges[echoes.beams]
    left, sent = echoes.power[is_read], echoes.settings.penetration_power
    # What never loses power has an infinite one: nothing of it is lost.
    read, limited = np.ones(len(left)), np.isfinite(left)
    read[limited] = left[limited] / sent if sent else 0.0
    shares[echoes.beams[is_read]] = read
    return np.clip(shares, 0.0, 1.0)


def _scanner_item(model: RobotModel, name: str | None) -> Item:
    items = model.items_of("RangeScanner")
    for item in items:
        if name is None or same_name(item.name, name):
            return item
    known = [item.name for item in items]
    raise ValueError(f"robot {model.name}: scanner {name!r}, expected one of {known}")
