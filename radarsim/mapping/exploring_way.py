"""From place to place, for a way that somebody has chosen."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from radarsim.mapping.exploring import Habits, Walker
from radarsim.mapping.exploring_nearest import LEAST_SCANS
from radarsim.mapping.floor import Point
from radarsim.mapping.grid import OccupancyGrid
from radarsim.navigation.motion import STAND, Motion, distance
from radarsim.navigation.sensed import Sensed

THERE: Final = 0.25  # m


class AlongWay:
    """Goes to some places in turn, as near to each as sensed and open floor leads.

    Attributes:
        doing: Always ``underway``.
        is_done: Whether it has been to all places, or as near as could be.
        left_out: Those that it could not get to, m.
    """

    doing = "underway"

    def __init__(self, habits: Habits, places: Sequence[Point]) -> None:
        """Get ready.

        Args:
            habits: How the robot goes.
            places: Where to, m, map frame.
        """
        self.is_done = False
        self.left_out: list[Point] = []
        self._walker = Walker(habits)
        self._places = list(places)
        self._scans = 0

    def step(self, sensed: Sensed, grid: OccupancyGrid) -> Motion:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        there = distance(sensed.pose, *self._places[0]) < THERE
        if self._walker.look(sensed, grid) or there:
            self.is_done = not self._choose(sensed)
        return STAND if self.is_done else self._walker.walk(sensed)

    def _choose(self, sensed: Sensed) -> bool:
        """Find the next place that can be got nearer to; tells whether there is one."""
        while self._places:
            if distance(sensed.pose, *self._places[0]) >= THERE:
                if self._is_on_way(sensed):
                    return True
                self.left_out.append(self._places[0])
            self._places.pop(0)
        return False

    def _is_on_way(self, sensed: Sensed) -> bool:
        """Plan to get as near to a place as can be; tells whether that is nearer."""
        floor = self._walker.floor
        assert floor is not None
        tiles = floor.nearest(floor.reachable(sensed.pose), *self._places[0])
        across, up = floor.middles()
        for row, column in np.argwhere(tiles):
            left = math.dist((across[column], up[row]), self._places[0])
            gain = distance(sensed.pose, *self._places[0]) - left
            if left < THERE or gain > THERE:
                return self._walker.plan(sensed, tiles)
        return False
