"""Simulates robots of one class in a scene, in steps of one decision period.

Motion, collisions and scans are computed as in a simulation. Nothing is reported
between two decisions, so a period takes only a few calls of the engine.
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

MOST_SECONDS: Final = 10_000.0  # s; longest period, as the engine cannot stop early


class Arena:
    """A scene in which N robots drive and scan.

    Attributes:
        scene: The map.
        model: Class of the robots.
        scanner: The scanner of each robot.
        max_speed: Highest speed of a robot, m/s.
        max_turn_rate: Highest turn rate, rad/s.
    """

    def __init__(self, settings: "GoToSettings", count: int, *, meets: bool) -> None:
        """Load the map and create the robots; call ``place`` before they drive.

        Args:
            settings: The map, the robots' class and scanner, and the decision period.
            count: Number of robots, N.
            meets: Whether robots see and touch each other.

        Raises:
            RadarsimError: If the map, the class or a sensor setting is wrong.
            ValueError: If the class has no such scanner or steers like a car, or the
                period is too short or too long.
        """
        config, map_ = SimulationConfig(), settings.map
        self.scene = map_ if isinstance(map_, Scene) else load_map(map_)
        self.model = load_robot(settings.robot).in_dialect(config.dialect.name)
        if self.model.steering is not None:
            text = f"robot {self.model.name!r} has car-like steering"
            raise ValueError(f"{text}, expected a skid-steered robot")
        period = settings.decision_period
        # A period of at most half a tick would be rounded to 0 ticks.
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
        """Radius of the smallest circle around a robot's footprint, m."""
        return Footprint(self.model.length, self.model.width).radius

    @property
    def poses(self) -> Floats:
        """Poses of all robots, (N, 3): x, y and yaw, m and rad, map frame."""
        first = COLUMN["x"]
        return self._fleet.columns[self._slots, first : first + 3]

    def places_of_others(self, row: int) -> list[tuple[float, float]]:
        """Return the positions, m, of all robots that the robot in ``row`` can hit."""
        others = self._present & (np.arange(len(self._robots)) != row)
        return [(x, y) for x, y, _ in self.poses[others & self._meets].tolist()]

    def place(self, row: int, pose: Pose2) -> None:
        """Place a robot at rest at a pose, which is not checked for obstacles."""
        self._present[row] = True
        self._fleet.place(self._robots[row], pose, self._obstacles_at(pose.x, pose.y))

    def nearest_free_pose(self, pose: Pose2) -> Pose2:
        """Return the nearest pose, within 1 m, at which a robot touches no obstacle.

        Raises:
            ValueError: If there is no such pose.
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
        """Remove a robot from the scene until it is placed again."""
        self._present[row] = False

    def drive(self, speeds: Floats) -> NDArray[np.bool_]:
        """Let all robots drive for a decision period.

        Args:
            speeds: (N, 2) speeds of the left and right wheels as shares of the highest
                speed, -1 to 1.

        Returns:
            (N,) whether each robot was blocked or touched anything in the period.
        """
        # All speeds are written to the table at once, which is faster than a call per
        # robot.
        first = COLUMN["left_spin"]
        self._fleet.columns[self._slots, first : first + 2] = speeds * self._max_spin
        touched = np.zeros(len(self._robots), np.bool_)
        # One call of the engine simulates all ticks of the period.
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
        """Scan once with the scanner of each chosen robot.

        Args:
            rngs: Random generator of each robot.
            chosen: (N,) whether a robot scans.
            values: Further values of each beam, which take more time to compute:
                ``power``, the share of penetration power that remains at the reported
                range, 0 without detection, 1 if it is unlimited; ``rays``, the ray that
                gave the range: -1 right, 0 centre, 1 left.

        Returns:
            Arrays (N, beams): ``ranges``, m, and the further values. Ranges are the
            maximum range without detection, and for robots that do not scan.
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
        # Robots that cannot hit each other do not appear in each other's scans.
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
        # Obstacles depend on the floor's height. Maps have few floor heights, so the
        # obstacles for each height are cached.
        if floor not in self._obstacles:
            self._obstacles[floor] = Obstacles.from_scene(self.scene, floor=floor)
        return self._obstacles[floor]


def _power_left(scan: Scan) -> Floats:
    """Return each beam's share of penetration power left at its range, (beams,)."""
    echoes, shares = scan.echoes, np.zeros(len(scan.ranges))
    # This mask selects the echoes whose ranges are the ranges of their beams.
    is_read = echoes.ranges == scan.ranges[echoes.beams]
    left, sent = echoes.power[is_read], echoes.settings.penetration_power
    # An infinite penetration power never decreases, so its remaining share is 1.
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
