"""Simple coverage strategies: a spiral from the start outward, and random bounces."""

import math
from typing import Final

import numpy as np

from radarsim.exploration.path_follower import (
    MIN_SCANS,
    ExplorationSettings,
    PathFollower,
)
from radarsim.exploration.traversability import Point
from radarsim.geometry import Pose2, wrap_angle
from radarsim.mapping.occupancy_grid import SHORT_RANGE, OccupancyGrid
from radarsim.navigation.control import STOP, Twist, distance
from radarsim.navigation.observation import Observation

SPACING: Final = 1.6 * SHORT_RANGE  # m between two turns, so that nothing is missed
POINT_SPACING: Final = 1.0  # m along the spiral
ARRIVAL_DISTANCE: Final = 0.8  # m
MIN_TURN: Final = math.radians(30.0)
AIMED: Final = math.radians(8.0)
MAX_IDLE_LEGS: Final = 12  # stretches without anything new after which it is done
MIN_GAIN: Final = 1.0  # m² that count as something new
_TURN_STEP: Final = math.radians(10.0)


class SpiralCoverage:
    """Drives round its start in ever wider turns; unreachable points are left out.

    Attributes:
        activity: Always ``spiral``.
        is_done: Whether it is as far out as it should go, or could reach nothing of a
            whole turn.
    """

    activity = "spiral"

    def __init__(self, settings: ExplorationSettings) -> None:
        self.is_done = False
        self._settings = settings
        self._path_follower = PathFollower(settings)
        self._start: Pose2 | None = None
        self._angle = 0.0
        self._skipped_angle = 0.0
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Return the twist until the next scan."""
        self._start = self._start or observation.pose
        self._scans += 1
        if self.is_done or self._scans < MIN_SCANS:
            return STOP
        has_arrived = distance(observation.pose, *self._point()) < ARRIVAL_DISTANCE
        if self._path_follower.update_map(observation, grid) or has_arrived:
            self._choose(observation, has_arrived=has_arrived)
        return self._path_follower.step(observation)

    def _choose(self, observation: Observation, *, has_arrived: bool) -> None:
        """Find the next point on the spiral that can be reached."""
        floor = self._path_follower.floor
        assert floor is not None
        reachable = floor.reachable(observation.pose)
        if has_arrived:
            self._skipped_angle = 0.0
            self._advance()
        while not self.is_done:
            targets = reachable & floor.disc(*self._point(), POINT_SPACING / 2)
            if self._path_follower.plan(observation, targets):
                return
            self._skipped_angle += self._advance()
            self.is_done |= self._skipped_angle > 2 * math.pi

    def _point(self) -> Point:
        assert self._start is not None
        radius = SPACING * self._angle / (2 * math.pi)
        angle = self._start.yaw + self._angle
        return (
            self._start.x + radius * math.cos(angle),
            self._start.y + radius * math.sin(angle),
        )

    def _advance(self) -> float:
        """Go on to the next point on the spiral; return the angle to it, rad."""
        radius = SPACING * self._angle / (2 * math.pi)
        step = POINT_SPACING / max(radius, POINT_SPACING)
        self._angle += step
        self.is_done = radius > self._settings.radius
        return step


class RandomBounce:
    """Drives straight on, and turns at random at walls, as simple vacuum robots do.

    Attributes:
        activity: ``straight`` or ``turning``.
        is_done: Whether all reachable floor was seen at short range, or the last
            stretches showed nothing new.
    """

    def __init__(self, settings: ExplorationSettings, rng: np.random.Generator) -> None:
        self.activity = "straight"
        self.is_done = False
        self._settings = settings
        self._rng = rng
        self._heading: float | None = None
        self._unvisited_area = math.inf
        self._idle_legs = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Return the twist until the next scan."""
        settings, yaw = self._settings, observation.pose.yaw
        if self._heading is None:
            self._heading = yaw
        if self.activity == "turning" and abs(wrap_angle(self._heading - yaw)) < AIMED:
            self.activity = "straight"
        ahead = settings.bumpers.towards(observation, wrap_angle(self._heading - yaw))
        if self.activity == "straight" and ahead.blocked:
            self._end_leg(observation.pose, grid)
            self._heading = yaw + self._draw_turn(observation)
            self.activity = "turning"
        if self.is_done:
            return STOP
        twist = settings.speed_limits.towards(wrap_angle(self._heading - yaw))
        if self.activity == "turning":
            return Twist(0.0, twist.turn)
        return settings.limit_by_bumpers(observation, twist)

    def _draw_turn(self, observation: Observation) -> float:
        """Draw a random turn to a free direction, rad; half a turn if there is none.

        The bumper has stopped the robot at a distance from the wall, so it can turn
        there.
        """
        turns = np.arange(MIN_TURN, 2 * math.pi - MIN_TURN, _TURN_STEP)
        bumpers = self._settings.bumpers
        free = [
            turn for turn in turns if not bumpers.towards(observation, turn).blocked
        ]
        return float(self._rng.choice(free)) if free else math.pi

    def _end_leg(self, pose: Pose2, grid: OccupancyGrid) -> None:
        """Update ``is_done`` at the end of a straight stretch."""
        floor = self._settings.traversability(grid)
        remaining = floor.area(floor.unvisited & floor.reachable(pose))
        if self._unvisited_area - remaining > MIN_GAIN:
            self._idle_legs = 0
            self._unvisited_area = remaining
        else:
            self._idle_legs += 1
        self.is_done = remaining == 0 or self._idle_legs >= MAX_IDLE_LEGS
