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
from radarsim.navigation.wall_following import FollowSide, WallFollower

THERE: Final = 0.3  # m from a wall's place where following begins
SHORTEST: Final = 3.0  # m that a contour has at least
FOLLOWED: Final = 2.0  # m beside the way along a wall, within which walls are known
TRACK_EVERY: Final = 0.5  # m
LOST: Final = 1.5  # circles without a wall after which it is taken to be gone


class ContourStrategy:
    """Follows the contour of a room once, then fills the interior.

    Attributes:
        doing: ``seeking``, ``aligning``, ``following`` or ``filling``.
        is_done: Whether contour and interior are done, or no wall is one of a room's.
        contours: How many it has closed, islands too.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        self.doing = "seeking"
        self.is_done = False
        self.contours = 0
        self._settings = settings
        self._follower = WallFollower(settings.bumpers, settings.speed_limits)
        self._way = FollowSide(on_left=settings.on_left)
        self._walker = PathFollower(settings)
        self._fill = coverage_strategy(settings)
        self._track: list[Point] = []
        self._round: _Round | None = None
        self._scans = 0
        self._nothing = False
        self._wall: Point = (0.0, 0.0)

    def step(self, sensed: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        if self.doing == "seeking":
            return self._seek(sensed, grid)
        if self.doing == "aligning":
            return self._align(sensed)
        if self.doing == "following":
            return self._follow(sensed)
        motion = self._fill.step(sensed, grid)
        self.is_done = self._fill.is_done
        return motion

    def _seek(self, sensed: Observation, grid: OccupancyGrid) -> Twist:
        """Go to a wall, and stand once it is there."""
        walker = self._walker
        if walker.look(sensed, grid):
            assert walker.floor is not None
            targets = self._walls(walker.floor, sensed)
            self._nothing = not walker.plan(sensed, targets)
        if self._nothing and not self.contours:
            return self._onward(sensed)
        if self._nothing:
            self.is_done = True
        elif walker.end is not None and distance(sensed.pose, *walker.end) < THERE:
            return self._arrive(sensed)
        return walker.walk(sensed)

    def _walls(self, floor: TraversabilityMap, sensed: Observation) -> Mask:
        """Give the floor along walls that it has not followed."""
        targets = floor.outer_boundary(floor.reachable(sensed.pose))
        for place in self._track:
            targets &= ~floor.within(*place, FOLLOWED)
        return targets

    def _onward(self, sensed: Observation) -> Twist:
        """Go straight on until there is something."""
        if self._settings.bumpers.towards(sensed, 0.0).blocked:
            return self._arrive(sensed)
        return Twist(self._settings.speed_limits.speed, 0.0)

    def _arrive(self, sensed: Observation) -> Twist:
        """Choose the nearest place of a wall to align with."""
        self.doing = "aligning"
        nearest = int(sensed.ranges.argmin())
        away = float(sensed.ranges[nearest])
        angle = float(sensed.bearings[nearest]) + sensed.pose.yaw
        self._wall = (
            sensed.pose.x + away * math.cos(angle),
            sensed.pose.y + away * math.sin(angle),
        )
        return STAND

    def _align(self, sensed: Observation) -> Twist:
        obstacle = bearing_of(sensed.pose, *self._wall)
        motion, aligned = self._follower.align(sensed, self._way, obstacle)
        if aligned:
            self.doing = "following"
            direction = self._follower.tangent(sensed, self._way)
            self._round = _Round(sensed, direction, self._follower.wanted)
            self._track.append((sensed.pose.x, sensed.pose.y))
        return motion

    def _follow(self, sensed: Observation) -> Twist:
        motion, found = self._follower.step(sensed, self._way)
        assert self._round is not None
        self._round.add(sensed, found=found)
        if distance(sensed.pose, *self._track[-1]) > TRACK_EVERY:
            self._track.append((sensed.pose.x, sensed.pose.y))
        if self._round.is_closed:
            self.contours += 1
            inside = (self._round.turned < 0) == self._way.on_left
            self.doing = "filling" if inside else "seeking"
        elif self._round.lost > LOST * 2 * math.pi * self._follower.wanted:
            self.doing = "seeking"
        return motion


class _Round:
    """One way along a wall.

    Attributes:
        is_closed: Whether it has come to where it began.
        turned: By how much in total, rad, counter-clockwise.
        lost: How far it went since there was a wall, m.
    """

    def __init__(self, sensed: Observation, direction: float, reach: float) -> None:
        self.is_closed = False
        self.turned = 0.0
        self.lost = 0.0
        self._length = 0.0
        self._last = sensed.pose
        self._mark = Landmark(sensed.pose, direction, reach=reach)

    def add(self, sensed: Observation, *, found: bool) -> None:
        step = moved(self._last, sensed.pose)
        self._length += step
        self.lost = 0.0 if found else self.lost + step
        self.turned += wrap_angle(sensed.pose.yaw - self._last.yaw)
        self._last = sensed.pose
        self.is_closed = self._mark.passed(sensed.pose) and self._length > SHORTEST
