"""Frontier and short-range coverage: drive to the nearest target until none is left.

A frontier is where open floor borders on space that no beam has crossed. The robot
turns round once first, so that other beams cross the gaps between those of one scan.
Short-range coverage drives until all floor was seen at short range: from afar, and
through foliage, a radar's beams leave wide gaps.
"""

import math
from collections.abc import Callable
from typing import Final

from radarsim.autonomy.exploration.path_follower import (
    MIN_SCANS,
    ExplorationSettings,
    PathFollower,
)
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import wrap_angle

FULL_TURN: Final = 2 * math.pi
NEIGHBORHOOD: Final = 1.5  # m around a target, where further targets come first

TargetSelector = Callable[[TraversabilityMap], Mask]


class NearestTargetStrategy:
    """Strategy that drives to the nearest of the tiles that a selector returns.

    Attributes:
        activity: Name of the activity.
        is_done: Whether no target is left that can be reached.
    """

    def __init__(
        self,
        settings: ExplorationSettings,
        select_targets: TargetSelector,
        activity: str,
        *,
        turn: float = 0.0,
    ) -> None:
        """Create a strategy.

        Args:
            settings: How the robot drives.
            select_targets: Returns the tiles to drive to.
            activity: Name of the activity.
            turn: Angle to turn on the spot first, rad.
        """
        self.activity = activity
        self.is_done = False
        self._turn = turn
        self._yaw = math.nan
        self._speed_limits = settings.speed_limits
        self._select_targets = select_targets
        self._path_follower = PathFollower(settings)
        self._scans = 0

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Return the twist until the next scan."""
        self._scans += 1
        if self.is_done or self._scans < MIN_SCANS:
            return STOP
        if self._turn > 0:
            return self._turn_round(observation)
        if self._path_follower.update_map(observation, grid):
            assert self._path_follower.floor is not None
            targets = self._prefer_near(self._select_targets(self._path_follower.floor))
            self.is_done = not self._path_follower.plan(observation, targets)
        return self._path_follower.step(observation)

    def _turn_round(self, observation: Observation) -> Twist:
        if not math.isnan(self._yaw):
            self._turn -= abs(wrap_angle(observation.pose.yaw - self._yaw))
        self._yaw = observation.pose.yaw
        return Twist(0.0, self._speed_limits.turn)

    def _prefer_near(self, targets: Mask) -> Mask:
        """Return the targets around the last one, or all if none is there."""
        floor, end = self._path_follower.floor, self._path_follower.end
        assert floor is not None
        if end is None:
            return targets
        near = targets & floor.disc(*end, NEIGHBORHOOD)
        return near if near.any() else targets


def frontier_strategy(
    settings: ExplorationSettings,
    select_targets: TargetSelector = lambda floor: floor.frontiers,
) -> NearestTargetStrategy:
    """Return a strategy that drives to the nearest of all frontiers, or of some."""
    return NearestTargetStrategy(settings, select_targets, "frontier", turn=FULL_TURN)


def coverage_strategy(settings: ExplorationSettings) -> NearestTargetStrategy:
    """Return a strategy that drives to the nearest floor not seen at short range."""
    return NearestTargetStrategy(settings, lambda floor: floor.unvisited, "filling")
