"""From the start outward in a spiral, where no border is."""

import math
from typing import Final

import numpy as np

from radarsim.exploration.path_follower import (
    LEAST_SCANS,
    ExplorationSettings,
    PathFollower,
)
from radarsim.exploration.traversability import Point
from radarsim.geometry import Pose2, wrap_angle
from radarsim.mapping.occupancy_grid import SHORT_RANGE, OccupancyGrid
from radarsim.navigation.control import STAND, Twist, distance
from radarsim.navigation.observation import Observation

APART: Final = 1.6 * SHORT_RANGE  # m between two turns, so that nothing is missed
STRIDE: Final = 1.0  # m between two places on the spiral
THERE: Final = 0.8  # m


class SpiralCoverage:
    """Goes round its start in ever wider turns; what is in the way is left out.

    Attributes:
        activity: Always ``spiral``.
        is_done: Whether it has got as far as it is to, or nothing of a whole turn can
            be got to.
    """

    activity = "spiral"

    def __init__(self, settings: ExplorationSettings) -> None:
        self.is_done = False
        self._settings = settings
        self._walker = PathFollower(settings)
        self._start: Pose2 | None = None
        self._angle = 0.0
        self._left_out = 0.0
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._start = self._start or observation.pose
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        there = distance(observation.pose, *self._place()) < THERE
        if self._walker.look(observation, grid) or there:
            self._choose(observation, there=there)
        return self._walker.walk(observation)

    def _choose(self, observation: Observation, *, there: bool) -> None:
        """Find the next place on the spiral that can be got to."""
        floor = self._walker.floor
        assert floor is not None
        reachable = floor.reachable(observation.pose)
        if there:
            self._left_out = 0.0
            self._go_on()
        while not self.is_done:
            targets = reachable & floor.within(*self._place(), STRIDE / 2)
            if self._walker.plan(observation, targets):
                return
            self._left_out += self._go_on()
            self.is_done |= self._left_out > 2 * math.pi

    def _place(self) -> Point:
        assert self._start is not None
        radius = APART * self._angle / (2 * math.pi)
        angle = self._start.yaw + self._angle
        return (
            self._start.x + radius * math.cos(angle),
            self._start.y + radius * math.sin(angle),
        )

    def _go_on(self) -> float:
        """Go to the next place on the spiral; gives the angle to it, rad."""
        radius = APART * self._angle / (2 * math.pi)
        step = STRIDE / max(radius, STRIDE)
        self._angle += step
        self.is_done = radius > self._settings.radius
        return step


# Section from mapping.exploring_turning.
# Straight on, and off in another direction at every wall, as a simple vacuum robot.

LEAST_TURN: Final = math.radians(30.0)
FACING: Final = math.radians(8.0)
LEGS: Final = 12  # that may show nothing new before it is enough
NEWS: Final = 1.0  # m² that count as something new
_TRIED: Final = math.radians(10.0)


class RandomBounce:
    """Turns away at walls, by chance.

    Attributes:
        activity: ``straight`` or ``turning``.
        is_done: Whether all floor that it can get to was seen at short range, or the
            last legs have shown nothing new.
    """

    def __init__(self, settings: ExplorationSettings, rng: np.random.Generator) -> None:
        self.activity = "straight"
        self.is_done = False
        self._settings = settings
        self._rng = rng
        self._heading: float | None = None
        self._unvisited = math.inf
        self._idle = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        settings, yaw = self._settings, observation.pose.yaw
        if self._heading is None:
            self._heading = yaw
        if self.activity == "turning" and abs(wrap_angle(self._heading - yaw)) < FACING:
            self.activity = "straight"
        ahead = settings.bumpers.towards(observation, wrap_angle(self._heading - yaw))
        if self.activity == "straight" and ahead.blocked:
            self._judge(observation.pose, grid)
            self._heading = yaw + self._turn(observation)
            self.activity = "turning"
        if self.is_done:
            return STAND
        twist = settings.speed_limits.towards(wrap_angle(self._heading - yaw))
        if self.activity == "turning":
            return Twist(0.0, twist.turn)
        return settings.careful(observation, twist)

    def _turn(self, observation: Observation) -> float:
        """Draw a turn to where nothing is in the way, rad; right about if that is not.

        The bumper that has stopped it is some way off, so there is room to turn in.
        """
        turns = np.arange(LEAST_TURN, 2 * math.pi - LEAST_TURN, _TRIED)
        bumpers = self._settings.bumpers
        free = [
            turn for turn in turns if not bumpers.towards(observation, turn).blocked
        ]
        return float(self._rng.choice(free)) if free else math.pi

    def _judge(self, pose: Pose2, grid: OccupancyGrid) -> None:
        """Find out at a wall whether it goes on."""
        floor = self._settings.floor(grid)
        left = floor.area(floor.unvisited & floor.reachable(pose))
        shown = self._unvisited - left
        self._idle = 0 if shown > NEWS else self._idle + 1
        self._unvisited = (
            min(self._unvisited, left) if shown > NEWS else self._unvisited
        )
        self.is_done = left == 0 or self._idle >= LEGS
