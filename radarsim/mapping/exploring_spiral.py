"""From the start outward in a spiral, where no border is."""

import math
from typing import Final

from radarsim.geometry import Pose2
from radarsim.mapping.exploring import Habits, Walker
from radarsim.mapping.exploring_nearest import LEAST_SCANS
from radarsim.mapping.floor import Point
from radarsim.mapping.grid import SHORT_RANGE, OccupancyGrid
from radarsim.navigation.motion import STAND, Motion, distance
from radarsim.navigation.sensed import Sensed

APART: Final = 1.6 * SHORT_RANGE  # m between two turns, so that nothing is missed
STRIDE: Final = 1.0  # m between two places on the spiral
THERE: Final = 0.8  # m


class CentreOut:
    """Goes round its start in ever wider turns; what is in the way is left out.

    Attributes:
        doing: Always ``spiral``.
        is_done: Whether it has got as far as it is to, or nothing of a whole turn can
            be got to.
    """

    doing = "spiral"

    def __init__(self, habits: Habits) -> None:
        self.is_done = False
        self._habits = habits
        self._walker = Walker(habits)
        self._start: Pose2 | None = None
        self._angle = 0.0
        self._left_out = 0.0
        self._scans = 0

    def step(self, sensed: Sensed, grid: OccupancyGrid) -> Motion:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._start = self._start or sensed.pose
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        there = distance(sensed.pose, *self._place()) < THERE
        if self._walker.look(sensed, grid) or there:
            self._choose(sensed, there=there)
        return self._walker.walk(sensed)

    def _choose(self, sensed: Sensed, *, there: bool) -> None:
        """Find the next place on the spiral that can be got to."""
        floor = self._walker.floor
        assert floor is not None
        reachable = floor.reachable(sensed.pose)
        if there:
            self._left_out = 0.0
            self._go_on()
        while not self.is_done:
            targets = reachable & floor.within(*self._place(), STRIDE / 2)
            if self._walker.plan(sensed, targets):
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
        self.is_done = radius > self._habits.radius
        return step
