"""Along the walls of a room until its contour is closed, and then its interior.

The contour is that of the floor which the robot can get to, as the map has it: islands
within it are not gone round, unless there is nothing else. It is closed when the robot
passes where it began to follow, by its own pose. Whoever goes round an island turns the
other way in total; that wall was none of the room's, and another one is looked for.
Where there is none, there is no interior to fill.
"""

import math
from typing import Final

from radarsim.exploration.frontier import coverage_strategy
from radarsim.exploration.path_follower import (
    LEAST_SCANS,
    ExplorationSettings,
    PathFollower,
)
from radarsim.exploration.traversability import Point, TraversabilityMap
from radarsim.geometry import wrap_angle
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.navigation.boundary_policy import Landmark
from radarsim.navigation.control import STAND, Twist, bearing_of, distance, moved
from radarsim.navigation.observation import Observation
from radarsim.navigation.wall_following import FollowMode, WallFollower

THERE: Final = 0.3  # m from a wall's place where following begins
SHORTEST: Final = 3.0  # m that a contour has at least
FOLLOWED: Final = 2.0  # m beside the way along a wall, within which walls are known
TRACK_EVERY: Final = 0.5  # m
LOST: Final = 1.5  # circles without a wall after which it is taken to be gone


class ContourStrategy:
    """Follows the contour of a room once, then fills the interior.

    Attributes:
        activity: ``seeking``, ``aligning``, ``following`` or ``filling``.
        is_done: Whether contour and interior are done, or no wall is one of a room's.
        contours: How many it has closed, islands too.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        self.activity = "seeking"
        self.is_done = False
        self.contours = 0
        self._settings = settings
        self._follower = WallFollower(settings.bumpers, settings.speed_limits)
        self._way = FollowMode(wall_on_left=settings.wall_on_left)
        self._walker = PathFollower(settings)
        self._fill = coverage_strategy(settings)
        self._track: list[Point] = []
        self._round: _Round | None = None
        self._scans = 0
        self._nothing = False
        self._wall: Point = (0.0, 0.0)

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        if self.activity == "seeking":
            return self._seek(observation, grid)
        if self.activity == "aligning":
            return self._align(observation)
        if self.activity == "following":
            return self._follow(observation)
        twist = self._fill.step(observation, grid)
        self.is_done = self._fill.is_done
        return twist

    def _seek(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Go to a wall, and stand once it is there."""
        walker = self._walker
        if walker.look(observation, grid):
            assert walker.floor is not None
            targets = self._walls(walker.floor, observation)
            self._nothing = not walker.plan(observation, targets)
        if self._nothing and not self.contours:
            return self._onward(observation)
        if self._nothing:
            self.is_done = True
        elif walker.end is not None and distance(observation.pose, *walker.end) < THERE:
            return self._arrive(observation)
        return walker.walk(observation)

    def _walls(self, floor: TraversabilityMap, observation: Observation) -> Mask:
        """Give the floor along walls that it has not followed."""
        targets = floor.outer_boundary(floor.reachable(observation.pose))
        for place in self._track:
            targets &= ~floor.within(*place, FOLLOWED)
        return targets

    def _onward(self, observation: Observation) -> Twist:
        """Go straight on until there is something."""
        if self._settings.bumpers.towards(observation, 0.0).blocked:
            return self._arrive(observation)
        return Twist(self._settings.speed_limits.speed, 0.0)

    def _arrive(self, observation: Observation) -> Twist:
        """Choose the nearest place of a wall to align with."""
        self.activity = "aligning"
        nearest = int(observation.ranges.argmin())
        away = float(observation.ranges[nearest])
        angle = float(observation.bearings[nearest]) + observation.pose.yaw
        self._wall = (
            observation.pose.x + away * math.cos(angle),
            observation.pose.y + away * math.sin(angle),
        )
        return STAND

    def _align(self, observation: Observation) -> Twist:
        obstacle = bearing_of(observation.pose, *self._wall)
        twist, aligned = self._follower.align(observation, self._way, obstacle)
        if aligned:
            self.activity = "following"
            direction = self._follower.tangent(observation, self._way)
            self._round = _Round(observation, direction, self._follower.target_distance)
            self._track.append((observation.pose.x, observation.pose.y))
        return twist

    def _follow(self, observation: Observation) -> Twist:
        twist, found = self._follower.step(observation, self._way)
        assert self._round is not None
        self._round.add(observation, found=found)
        if distance(observation.pose, *self._track[-1]) > TRACK_EVERY:
            self._track.append((observation.pose.x, observation.pose.y))
        if self._round.is_closed:
            self.contours += 1
            inside = (self._round.turned < 0) == self._way.wall_on_left
            self.activity = "filling" if inside else "seeking"
        elif self._round.lost > LOST * 2 * math.pi * self._follower.target_distance:
            self.activity = "seeking"
        return twist


class _Round:
    """One way along a wall.

    Attributes:
        is_closed: Whether it has come to where it began.
        turned: By how much in total, rad, counter-clockwise.
        lost: How far it went since there was a wall, m.
    """

    def __init__(
        self, observation: Observation, direction: float, reach: float
    ) -> None:
        self.is_closed = False
        self.turned = 0.0
        self.lost = 0.0
        self._length = 0.0
        self._last = observation.pose
        self._mark = Landmark(observation.pose, direction, max_offset=reach)

    def add(self, observation: Observation, *, found: bool) -> None:
        step = moved(self._last, observation.pose)
        self._length += step
        self.lost = 0.0 if found else self.lost + step
        self.turned += wrap_angle(observation.pose.yaw - self._last.yaw)
        self._last = observation.pose
        self.is_closed = self._mark.passed(observation.pose) and self._length > SHORTEST
