"""Straight on, and off in another direction at every wall, as a simple vacuum robot."""

import math
from typing import Final

import numpy as np

from radarsim.geometry import Pose2, wrap_angle
from radarsim.mapping.exploring import Habits
from radarsim.mapping.grid import OccupancyGrid
from radarsim.navigation.motion import STAND, Motion
from radarsim.navigation.sensed import Sensed

LEAST_TURN: Final = math.radians(30.0)
FACING: Final = math.radians(8.0)
LEGS: Final = 12  # that may show nothing new before it is enough
NEWS: Final = 1.0  # m² that count as something new
_TRIED: Final = math.radians(10.0)


class TurnAway:
    """Turns away at walls, by chance.

    Attributes:
        doing: ``straight`` or ``turning``.
        is_done: Whether all floor that it can get to was seen at short range, or the
            last legs have shown nothing new.
    """

    def __init__(self, habits: Habits, rng: np.random.Generator) -> None:
        self.doing = "straight"
        self.is_done = False
        self._habits = habits
        self._rng = rng
        self._heading: float | None = None
        self._unvisited = math.inf
        self._idle = 0

    def step(self, sensed: Sensed, grid: OccupancyGrid) -> Motion:
        """Take in a scan and the map with it, and decide how to move until the next."""
        habits, yaw = self._habits, sensed.pose.yaw
        if self._heading is None:
            self._heading = yaw
        if self.doing == "turning" and abs(wrap_angle(self._heading - yaw)) < FACING:
            self.doing = "straight"
        ahead = habits.bumpers.towards(sensed, wrap_angle(self._heading - yaw))
        if self.doing == "straight" and ahead.blocked:
            self._judge(sensed.pose, grid)
            self._heading = yaw + self._turn(sensed)
            self.doing = "turning"
        if self.is_done:
            return STAND
        motion = habits.pace.towards(wrap_angle(self._heading - yaw))
        if self.doing == "turning":
            return Motion(0.0, motion.turn)
        return habits.careful(sensed, motion)

    def _turn(self, sensed: Sensed) -> float:
        """Draw a turn to where nothing is in the way, rad; right about if that is not.

        The bumper that has stopped it is some way off, so there is room to turn in.
        """
        turns = np.arange(LEAST_TURN, 2 * math.pi - LEAST_TURN, _TRIED)
        bumpers = self._habits.bumpers
        free = [turn for turn in turns if not bumpers.towards(sensed, turn).blocked]
        return float(self._rng.choice(free)) if free else math.pi

    def _judge(self, pose: Pose2, grid: OccupancyGrid) -> None:
        """Find out at a wall whether it goes on."""
        floor = self._habits.floor(grid)
        left = floor.area(floor.unvisited & floor.reachable(pose))
        shown = self._unvisited - left
        self._idle = 0 if shown > NEWS else self._idle + 1
        self._unvisited = (
            min(self._unvisited, left) if shown > NEWS else self._unvisited
        )
        self.is_done = left == 0 or self._idle >= LEGS
