"""Path follower and base class shared by all exploration strategies.

At every scan a strategy receives the observation and the map, and returns the twist
until the next scan. Paths are planned on the map and lead over sensed and open floor.
The bumpers override paths: a robot does not drive towards an obstacle that is too near.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Final

import numpy as np

from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import (
    STOP,
    SpeedLimits,
    Twist,
    bearing_of,
    distance,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.geometry import Point, Pose2

MIN_SCANS: Final = 10  # scans on the map before it is evaluated
MAP_INTERVAL: Final = 1.0  # s between two evaluations of the map
LOOKAHEAD: Final = 1.2  # m of a path that a straight line may cut short
PATIENCE: Final = 10.0  # s without progress before a target is given up
GIVEN_UP_RADIUS: Final = 0.7  # m around a target that was given up, to exclude tiles
WAYPOINT_RADIUS: Final = 0.25  # m from a waypoint, within which it is reached
WAITING: Final = "waiting"  # activity of a robot that waits for floor to become free
_PROGRESS: Final = 0.2  # m of motion that count as progress
_BEARING_STEP: Final = math.radians(10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationSettings:
    """Settings of an exploration.

    Attributes:
        bumpers: The long-range bumpers, with the safety distance.
        speed_limits: Highest speeds.
        plan: The plan of the exploration.
    """

    bumpers: Bumpers
    speed_limits: SpeedLimits = field(default_factory=SpeedLimits)
    plan: ExplorationPlan = field(default_factory=ExplorationPlan)

    def traversability(self, grid: OccupancyGrid) -> TraversabilityMap:
        """Compute which parts of a map the robot can drive on."""
        return TraversabilityMap(grid, self.bumpers.safety_distance)

    def limit_by_bumpers(self, observation: Observation, twist: Twist) -> Twist:
        """Return the twist, or only its turn if an obstacle ahead is too near."""
        ahead = math.pi if twist.speed < 0 else 0.0
        if not twist.speed or not self.bumpers.towards(observation, ahead).too_near:
            return twist
        return Twist(0.0, twist.turn or self.speed_limits.turn)

    def clear_bearing(self, observation: Observation, bearing: float) -> float:
        """Return the obstacle-free bearing, rad, that is nearest to a given bearing."""
        # Bearings are tried on both sides in turn,
        # so the first free one is the nearest.
        for k in range(int(math.pi / _BEARING_STEP) + 1):
            for each in (bearing + k * _BEARING_STEP, bearing - k * _BEARING_STEP):
                if not self.bumpers.towards(observation, each).too_near:
                    return each
        return bearing


class PathFollower:
    """Drives to the nearest of the given tiles, over floor that is sensed and free.

    Attributes:
        floor: The map as last evaluated.
    """

    floor: TraversabilityMap

    def __init__(self, settings: ExplorationSettings) -> None:
        self._settings = settings
        self._updated = -math.inf
        self._path: Sequence[Point] = ()
        self._given_up: list[Point] = []
        self._last_progress: tuple[float, Pose2] | None = None

    @property
    def end(self) -> Point | None:
        """End point of the current path, m; None without a path."""
        return self._path[-1] if self._path else None

    def update_map(self, observation: Observation, grid: OccupancyGrid) -> bool:
        """Update the traversability map if an update is due; return whether it was.

        Args:
            observation: The newest observation.
            grid: The map.
        """
        if observation.time < self._updated + MAP_INTERVAL:
            return False
        self.floor = self._settings.traversability(grid)
        self._updated = observation.time
        return True

    def plan(self, observation: Observation, targets: Mask) -> bool:
        """Plan a path to the nearest of the given tiles; return whether there is one.

        Tiles near abandoned targets are excluded.
        """
        had_path = bool(self._path)
        for point in self._given_up:
            targets = targets & ~self.floor.disc(*point, GIVEN_UP_RADIUS)
        self._path = self.floor.find_path(observation.pose, targets)
        # Plans are made every second, so a new plan does not count as progress.
        if self._last_progress is None or not had_path:
            self._last_progress = observation.time, observation.pose
        return bool(self._path)

    def step(self, observation: Observation) -> Twist:
        """Return the twist that drives the robot along the planned path."""
        if not self._path:
            return STOP
        self._check_progress(observation)
        settings = self._settings
        bearing = bearing_of(observation.pose, *self._next_point(observation.pose))
        bearing = settings.clear_bearing(observation, bearing)
        twist = settings.speed_limits.towards(bearing)
        # The map may be wrong or outdated, so
        # bumpers limit the twist by the newest scan.
        return settings.limit_by_bumpers(observation, twist)

    def _next_point(self, pose: Pose2) -> Point:
        """Return the farthest path point that the robot reaches in a straight line."""
        path = self._path
        nearest = min(range(len(path)), key=lambda i: distance(pose, *path[i]))
        # The two nearest points of the path are skipped: a robot that heads for its own
        # position would turn forever.
        ahead = min(nearest + 2, len(path) - 1)
        chosen = path[ahead]
        for point in path[ahead:]:
            if distance(pose, *point) > LOOKAHEAD:
                break
            if self.floor.is_line_cheap(pose, *point):
                chosen = point
        return chosen

    def _check_progress(self, observation: Observation) -> None:
        """Give up a target if the robot makes no progress towards it."""
        assert self._last_progress is not None
        time, pose = self._last_progress
        if observation.pose.distance(pose) > _PROGRESS:
            self._last_progress = observation.time, observation.pose
        elif observation.time > time + PATIENCE:
            # The floor around the target is excluded as
            # well, since it is just as hard to reach.
            self._given_up.append(self._path[-1])
            self._last_progress = observation.time, observation.pose
            self._updated = -math.inf  # plan again at once


class Strategy(ABC):
    """Base class of exploration strategies.

    Attributes:
        activity: Current activity, in one word.
        is_done: Whether the strategy has nothing left to explore.
    """

    activity: str
    min_scans: ClassVar = MIN_SCANS

    def __init__(self, settings: ExplorationSettings) -> None:
        self.is_done = False
        self._settings = settings
        self._path_follower = PathFollower(settings)
        self._start: Pose2 | None = None  # pose at the first scan
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Return the twist of the robot until the next scan."""
        self._start = self._start or observation.pose
        self._scans += 1
        if self.is_done or self._scans < self.min_scans:
            return STOP
        return self._decide(observation, grid)

    @abstractmethod
    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist: ...


class WaypointFollower(Strategy):
    """Drives to waypoints in order, as close to each as sensed and free floor allows.

    Attributes:
        unreached: Waypoints that could not be reached, m.
    """

    activity = "underway"

    def __init__(
        self, settings: ExplorationSettings, waypoints: Sequence[Point]
    ) -> None:
        """Create a strategy.

        Args:
            settings: Settings of the exploration.
            waypoints: Positions in order, m, map frame.
        """
        super().__init__(settings)
        self.unreached: list[Point] = []
        self._waypoints = list(waypoints)

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        has_arrived = self._distance(observation) < WAYPOINT_RADIUS
        if self._path_follower.update_map(observation, grid) or has_arrived:
            self.is_done = not self._choose(observation)
        return STOP if self.is_done else self._path_follower.step(observation)

    def _distance(self, observation: Observation) -> float:
        return distance(observation.pose, *self._waypoints[0])

    def _choose(self, observation: Observation) -> bool:
        """Find the next reachable waypoint; return whether there is one."""
        while self._waypoints:
            if self._distance(observation) >= WAYPOINT_RADIUS:
                if self._plan(observation):
                    return True
                self.unreached.append(self._waypoints[0])
            self._waypoints.pop(0)
        return False

    def _plan(self, observation: Observation) -> bool:
        """Plan a path towards the waypoint; return whether its end is nearer to it."""
        floor = self._path_follower.floor
        reachable = floor.reachable(observation.pose)
        tiles = floor.nearest(reachable, *self._waypoints[0])
        x, y = floor.tile_centers()
        # ``tiles`` contains at most one tile, so this loop runs at most once.
        for row, column in np.argwhere(tiles):
            remaining = math.dist((x[column], y[row]), self._waypoints[0])
            gain = self._distance(observation) - remaining
            if remaining < WAYPOINT_RADIUS or gain > WAYPOINT_RADIUS:
                return self._path_follower.plan(observation, tiles)
        return False
