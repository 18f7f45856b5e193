"""The strategies by name, and the one that chooses among the others.

``auto`` looks at what is sensed and what is not. Where less than half of all directions
end at something there is no border: it goes from the centre out, and then to frontiers
no farther from its start than that has led. Otherwise it goes to frontiers. With walls
all round and nothing unknown that it can get to, it goes along the walls and fills the
interior.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.exploration.contour import ContourStrategy
from radarsim.exploration.coverage import RandomBounce, SpiralCoverage
from radarsim.exploration.frontier import frontier_strategy
from radarsim.exploration.options import StrategyName
from radarsim.exploration.path_follower import (
    LEAST_SCANS,
    LOOK_EVERY,
    ExplorationSettings,
    Strategy,
)
from radarsim.exploration.traversability import TraversabilityMap
from radarsim.geometry import Pose2
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.navigation.control import STAND, Twist
from radarsim.navigation.observation import Observation

BORDERED: Final = 0.5  # share of directions that end at something


_CHOICES: Final[dict[StrategyName, Callable[[ExplorationSettings], Strategy]]] = {
    StrategyName.CONTOUR: ContourStrategy,
    StrategyName.CENTRE_OUT: SpiralCoverage,
    StrategyName.FRONTIERS: frontier_strategy,
}


def create_strategy(
    name: StrategyName, settings: ExplorationSettings, rng: np.random.Generator
) -> Strategy:
    """Make a strategy.

    Args:
        name: Which.
        settings: How the robot goes.
        rng: For the one that goes by chance.
    """
    if name == StrategyName.TURN_AWAY:
        return RandomBounce(settings, rng)
    return (
        AutoStrategy(settings)
        if name == StrategyName.AUTO
        else _CHOICES[name](settings)
    )


class AutoStrategy:
    """Chooses a strategy, and another one when that is done or does not fit any more.

    Attributes:
        is_done: Whether there is nothing more to choose.
        chosen: Those that it has chosen so far.
    """

    def __init__(self, settings: ExplorationSettings) -> None:
        self.is_done = False
        self.chosen: list[StrategyName] = []
        self._settings = settings
        self._now: Strategy | None = None
        self._start: Pose2 | None = None
        self._looked = math.nan
        self._scans = 0

    @property
    def activity(self) -> str:
        """What the chosen one is at."""
        return "looking" if self._now is None else self._now.activity

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Take in a scan and the map with it, and decide how to move until the next."""
        self._scans += 1
        self._start = self._start or observation.pose
        if self.is_done or self._scans < LEAST_SCANS:
            return STAND
        if self._now is None or self._now.is_done or self._is_elsewhere(observation):
            self._choose(observation, grid)
        return STAND if self._now is None else self._now.step(observation, grid)

    def _is_elsewhere(self, observation: Observation) -> bool:
        """Tell whether a border has turned up where none was, or the other way."""
        if observation.time < self._looked + LOOK_EVERY:
            return False
        self._looked = observation.time
        last = self.chosen[-1]
        if last == StrategyName.CENTRE_OUT:
            return is_enclosed(observation)
        is_new = StrategyName.CENTRE_OUT not in self.chosen
        return (
            is_new and last == StrategyName.FRONTIERS and not is_enclosed(observation)
        )

    def _choose(self, observation: Observation, grid: OccupancyGrid) -> None:
        name = self._best(observation, grid)
        self.is_done, self._now = name is None, None
        if name is None:
            return
        self.chosen.append(name)
        self._looked = observation.time
        if name == StrategyName.FRONTIERS:
            self._now = frontier_strategy(self._settings, self._frontiers)
        else:
            self._now = _CHOICES[name](self._settings)

    def _best(
        self, observation: Observation, grid: OccupancyGrid
    ) -> StrategyName | None:
        """Choose one that fits, each no more often than makes sense."""
        floor, bordered = self._settings.floor(grid), is_enclosed(observation)
        left = self._frontiers(floor) & floor.reachable(observation.pose)
        for name, fits, often in (
            (StrategyName.CENTRE_OUT, not bordered, 1),
            (StrategyName.FRONTIERS, bool(left.any()), 2),
            (StrategyName.CONTOUR, bordered, 1),
        ):
            if fits and self.chosen.count(name) < often:
                return name
        return None

    def _frontiers(self, floor: TraversabilityMap) -> Mask:
        if StrategyName.CENTRE_OUT not in self.chosen or self._start is None:
            return floor.frontiers
        start, radius = self._start, self._settings.radius
        return floor.frontiers & floor.within(start.x, start.y, radius)


def is_enclosed(observation: Observation) -> bool:
    """Tell whether most directions end at something."""
    return bool(np.isfinite(observation.ranges).mean() > BORDERED)
