"""Exploration strategies by name, and ``AutoStrategy``, which chooses among them.

``auto`` chooses a strategy by the sensor readings. If less than half of all directions
have a return, the area is open: the robot drives a spiral from the start, then to
frontiers no farther from the start than the radius of the spiral. Otherwise it drives
to frontiers. With walls all around and no reachable frontier, it follows the walls and
covers the interior.

When a strategy is done, ``auto`` also explores the remaining areas.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.autonomy.exploration.coverage import (
    ContourStrategy,
    RandomBounce,
    SpiralCoverage,
    frontier_strategy,
)
from radarsim.autonomy.exploration.path_follower import (
    MAP_INTERVAL,
    ExplorationSettings,
    Strategy,
)
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import StrategyName

MAX_FRONTIERS: Final = 4  # number of times that frontiers may be chosen
ENCLOSED_SHARE: Final = 0.5  # share of directions with a return in an enclosed area

_STRATEGIES: Final[dict[StrategyName, Callable[[ExplorationSettings], Strategy]]] = {
    StrategyName.CONTOUR: ContourStrategy,
    StrategyName.CENTRE_OUT: SpiralCoverage,
    StrategyName.FRONTIERS: frontier_strategy,
}


def create_strategy(
    name: StrategyName, settings: ExplorationSettings, rng: np.random.Generator
) -> Strategy:
    """Create the exploration strategy with the given name.

    Args:
        name: Name of the strategy.
        settings: Settings of the exploration.
        rng: Random generator for strategies that use chance.
    """
    if name == StrategyName.TURN_AWAY:
        return RandomBounce(settings, rng)
    if name == StrategyName.AUTO:
        return AutoStrategy(settings)
    return _STRATEGIES[name](settings)


class AutoStrategy(Strategy):
    """Chooses a strategy, and replaces it when it is done or no longer suitable.

    Attributes:
        chosen: Strategies chosen so far.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        super().__init__(settings)
        self.activity = "looking"
        self.chosen: list[StrategyName] = []
        self._current: Strategy | None = None
        self._checked = math.nan

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        current = self._current
        if current is None or current.is_done or self._finds_misfit(observation):
            self._choose(observation, grid)
        if self._current is None:
            self.activity = "looking"
            return STOP
        twist = self._current.step(observation, grid)
        self.activity = self._current.activity
        return twist

    def _finds_misfit(self, observation: Observation) -> bool:
        if observation.time < self._checked + MAP_INTERVAL:
            return False
        self._checked = observation.time
        last = self.chosen[-1]
        if last == StrategyName.CENTRE_OUT:
            return is_enclosed(observation)
        is_untried = StrategyName.CENTRE_OUT not in self.chosen
        is_open = not is_enclosed(observation)
        return is_untried and last == StrategyName.FRONTIERS and is_open

    def _choose(self, observation: Observation, grid: OccupancyGrid) -> None:
        """Start the first suitable strategy that was not used too often, or finish."""
        self.is_done, self._current = True, None
        floor = self._settings.traversability(grid)
        enclosed = is_enclosed(observation)
        frontiers = self._frontiers(floor) & floor.reachable(observation.pose)
        # Two strategies could run in turn forever, each leaving floor for the other. So
        # each strategy is started only a limited number of times.
        for name, fits, max_times in (
            (StrategyName.CENTRE_OUT, not enclosed, 1),
            (StrategyName.FRONTIERS, bool(frontiers.any()), MAX_FRONTIERS),
            (StrategyName.CONTOUR, enclosed, 1),
        ):
            if not fits or self.chosen.count(name) >= max_times:
                continue
            self.is_done, self._checked = False, observation.time
            self.chosen.append(name)
            if name == StrategyName.FRONTIERS:
                self._current = frontier_strategy(self._settings, self._frontiers)
            else:
                self._current = _STRATEGIES[name](self._settings)
            return

    def _frontiers(self, floor: TraversabilityMap) -> Mask:
        if StrategyName.CENTRE_OUT not in self.chosen or self._start is None:
            return floor.frontiers
        start, radius = self._start, self._settings.plan.radius
        return floor.frontiers & floor.disc(start.x, start.y, radius)


def is_enclosed(observation: Observation) -> bool:
    """Return whether the robot is in a room: beams in most directions have a return."""
    return bool(np.isfinite(observation.ranges).mean() > ENCLOSED_SHARE)
