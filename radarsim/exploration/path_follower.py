"""What all strategies of exploring have in common: how a robot gets to a place.

A strategy is asked at every scan how to move, as a bug is, and is shown the map too.
Ways are planned on the map and lead through floor that is sensed and drivable; what the
bumpers feel overrules them: towards what is too near no robot goes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np

from radarsim.exploration.traversability import Point, TraversabilityMap
from radarsim.geometry import Pose2
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.control import (
    STAND,
    SpeedLimits,
    Twist,
    bearing_of,
    distance,
    moved,
)
from radarsim.navigation.observation import Observation

LEAST_SCANS: Final = 10  # that the map has before it is judged

LOOK_EVERY: Final = 1.0  # s between two looks at the map
LOOKAHEAD: Final = 1.2  # m of a way that is cut short where the straight way is open
PATIENCE: Final = 10.0  # s without getting anywhere, after which a place is given up
GIVEN_UP: Final = 0.7  # m around such a place
_PROGRESS: Final = 0.2  # m
_TRIED: Final = math.radians(10.0)


class Strategy(Protocol):
    """A way to explore."""

    @property
    def activity(self) -> str:
        """What it is at, in one word."""

    @property
    def is_done(self) -> bool:
        """Whether nothing is left to do for it."""

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplorationSettings:
    """How a robot explores.

    Attributes:
        bumpers: What it senses by, and the distance that it keeps.
        speed_limits: How fast it goes.
        wall_on_left: Whether it keeps walls on its left hand.
        radius: How far from its start it goes where there is no border, m.
    """

    bumpers: Bumpers
    speed_limits: SpeedLimits = field(default_factory=SpeedLimits)
    wall_on_left: bool = True
    radius: float = 12.0

    def floor(self, grid: OccupancyGrid) -> TraversabilityMap:
        """Look at a map."""
        return TraversabilityMap(grid, self.bumpers.safety_distance)

    def careful(self, observation: Observation, twist: Twist) -> Twist:
        """Let the bumpers overrule a motion: turn where something ahead is too near."""
        behind = twist.speed < 0
        ahead = math.pi if behind else 0.0
        if not twist.speed or not self.bumpers.towards(observation, ahead).too_near:
            return twist
        return Twist(0.0, twist.turn or self.speed_limits.turn)

    def clear_bearing(self, observation: Observation, bearing: float) -> float:
        """Give the nearest to a bearing that is not too near to anything, rad."""
        for k in range(int(math.pi / _TRIED) + 1):
            for tried in (bearing + k * _TRIED, bearing - k * _TRIED):
                if not self.bumpers.towards(observation, tried).too_near:
                    return tried
        return bearing


class PathFollower:
    """Walks to the nearest of some places, over floor that is sensed and open.

    Attributes:
        floor: As it was at the last look; None before the first.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        self.floor: TraversabilityMap | None = None
        self._settings = settings
        self._looked = -math.inf
        self._way: Sequence[Point] = ()
        self._given_up: list[Point] = []
        self._since: tuple[float, Pose2] | None = None

    def look(self, observation: Observation, grid: OccupancyGrid) -> bool:
        """Look at the map if it is time to; tells whether it was."""
        if self.floor is not None and observation.time < self._looked + LOOK_EVERY:
            return False
        self.floor, self._looked = self._settings.floor(grid), observation.time
        return True

    def plan(self, observation: Observation, targets: Mask) -> bool:
        """Find the way to the nearest of some tiles; tells whether there is one."""
        assert self.floor is not None
        for place in self._given_up:
            targets = targets & ~self.floor.within(*place, GIVEN_UP)
        before = self._way[-1:]
        self._way = self.floor.find_path(observation.pose, targets)
        if self._since is None or not before:
            self._since = observation.time, observation.pose
        return bool(self._way)

    def walk(self, observation: Observation) -> Twist:
        """Decide how to go on along the way."""
        if not self._way:
            return STAND
        self._mind(observation)
        settings = self._settings
        bearing = bearing_of(observation.pose, *self._next(observation.pose))
        bearing = settings.clear_bearing(observation, bearing)
        return settings.careful(observation, settings.speed_limits.towards(bearing))

    @property
    def end(self) -> Point | None:
        """Where it goes, m."""
        return self._way[-1] if self._way else None

    def _next(self, pose: Pose2) -> Point:
        """Give the place to head for: as far along as one can go straight."""
        assert self.floor is not None
        nearest = min(
            range(len(self._way)), key=lambda i: distance(pose, *self._way[i])
        )
        chosen = self._way[min(nearest + 2, len(self._way) - 1)]
        for place in self._way[nearest:]:
            if distance(pose, *place) > LOOKAHEAD:
                break
            if self.floor.is_straight(pose, *place):
                chosen = place
        return chosen

    def _mind(self, observation: Observation) -> None:
        """Give a place up that it does not get nearer to."""
        assert self._since is not None
        since, pose = self._since
        if moved(pose, observation.pose) > _PROGRESS:
            self._since = observation.time, observation.pose
        elif observation.time > since + PATIENCE:
            self._given_up.append(self._way[-1])
            self._since, self._looked = (observation.time, observation.pose), -math.inf


# Section from mapping.exploring_way.
# From place to place, for a way that somebody has chosen.

THERE: Final = 0.25  # m


class WaypointFollower:
    """Goes to some places in turn, as near to each as sensed and open floor leads.

    Attributes:
        activity: Always ``underway``.
        is_done: Whether it has been to all places, or as near as could be.
        left_out: Those that it could not get to, m.
    """

    activity = "underway"

    def __init__(self, settings: ExplorationSettings, places: Sequence[Point]) -> None:
        """Get ready.

        Args:
            settings: How the robot goes.
            places: Where to, m, map frame.
        """
        self.is_done = False
        self.unreached: list[Point] = []
        self._walker = PathFollower(settings)
        self._places = list(places)
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        there = distance(observation.pose, *self._places[0]) < THERE
        if self._walker.look(observation, grid) or there:
            self.is_done = not self._choose(observation)
        return STAND if self.is_done else self._walker.walk(observation)

    def _choose(self, observation: Observation) -> bool:
        """Find the next place that can be got nearer to; tells whether there is one."""
        while self._places:
            if distance(observation.pose, *self._places[0]) >= THERE:
                if self._is_on_way(observation):
                    return True
                self.unreached.append(self._places[0])
            self._places.pop(0)
        return False

    def _is_on_way(self, observation: Observation) -> bool:
        """Plan to get as near to a place as can be; tells whether that is nearer."""
        floor = self._walker.floor
        assert floor is not None
        tiles = floor.nearest(floor.reachable(observation.pose), *self._places[0])
        across, up = floor.cell_centers()
        for row, column in np.argwhere(tiles):
            left = math.dist((across[column], up[row]), self._places[0])
            gain = distance(observation.pose, *self._places[0]) - left
            if left < THERE or gain > THERE:
                return self._walker.plan(observation, tiles)
        return False
