"""To the nearest place that is worth it, again and again, until there is none.

The next frontier is where floor that is sensed and drivable meets what no beam has been
in. Who looks for frontiers turns round once first, so that what lies between two beams
of one scan is seen by another. To fill is to see all floor at short range: what a radar
sees of it from afar, and through foliage, it sees with wide gaps between its beams.
"""

import math
from collections.abc import Callable
from typing import Final

from radarsim.exploration.path_follower import (
    LEAST_SCANS,
    ExplorationSettings,
    PathFollower,
)
from radarsim.exploration.traversability import TraversabilityMap
from radarsim.geometry import wrap_angle
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.navigation.control import STAND, Twist
from radarsim.navigation.observation import Observation

FULL: Final = 2 * math.pi
STAYS: Final = 1.5  # m around a target where more of it is worth staying

TargetSelector = Callable[[TraversabilityMap], Mask]


class NearestTargetStrategy:
    """Goes to the nearest of what a choice leaves on the floor.

    Attributes:
        activity: A word for it.
        is_done: Whether nothing is left that can be got to.
    """

    def __init__(
        self,
        settings: ExplorationSettings,
        choice: TargetSelector,
        activity: str,
        *,
        turn: float = 0.0,
    ) -> None:
        """Get ready.

        Args:
            settings: How the robot goes.
            choice: What to go to.
            activity: A word for it.
            turn: How far to turn on the spot first, rad.
        """
        self.activity = activity
        self.is_done = False
        self._turn = turn
        self._yaw = math.nan
        self._speed_limits = settings.speed_limits
        self._choice = choice
        self._walker = PathFollower(settings)
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        if self._turn > 0:
            return self._look_around(observation)
        if self._walker.look(observation, grid):
            assert self._walker.floor is not None
            targets = self._choice(self._walker.floor)
            self.is_done = not self._walker.plan(observation, self._kept(targets))
        return self._walker.walk(observation)

    def _look_around(self, observation: Observation) -> Twist:
        if not math.isnan(self._yaw):
            self._turn -= abs(wrap_angle(observation.pose.yaw - self._yaw))
        self._yaw = observation.pose.yaw
        return Twist(0.0, self._speed_limits.turn)

    def _kept(self, targets: Mask) -> Mask:
        """Stay with what is around the last target as long as anything is."""
        floor, end = self._walker.floor, self._walker.end
        assert floor is not None
        if end is None:
            return targets
        around = targets & floor.within(*end, STAYS)
        return around if around.any() else targets


def _frontiers(floor: TraversabilityMap) -> Mask:
    return floor.frontiers


def frontier_strategy(
    settings: ExplorationSettings, choice: TargetSelector = _frontiers
) -> NearestTargetStrategy:
    """Explore by going to the nearest frontier, of all or of some."""
    return NearestTargetStrategy(settings, choice, "frontier", turn=FULL)


def coverage_strategy(settings: ExplorationSettings) -> NearestTargetStrategy:
    """Explore by going to the nearest floor that was not seen at short range."""
    return NearestTargetStrategy(settings, lambda floor: floor.unvisited, "filling")
