"""What is left of an area when a strategy has nothing more to do."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from radarsim.exploration.path_follower import ExplorationSettings
from radarsim.exploration.strategies import is_enclosed
from radarsim.exploration.traversability import Point
from radarsim.geometry import Pose2
from radarsim.mapping.occupancy_grid import OccupancyGrid
from radarsim.navigation.observation import Observation

LEAST_AREA = 0.25  # m² of floor that is worth telling


class Unexplored(NamedTuple):
    """What is left, a place for each piece, m, map frame.

    Attributes:
        frontiers: Where floor that the robot can reach borders on the unknown.
        cut_off: Floor where the robot would fit, but to which no passage leads.
    """

    frontiers: list[Point]
    cut_off: list[Point]


def find_unexplored(
    observations: Sequence[Observation],
    grid: OccupancyGrid,
    settings: ExplorationSettings,
    start: Pose2,
) -> Unexplored:
    """Find what is left; where no walls enclose the area, within its radius.

    Args:
        observations: The latest one of each robot.
        grid: The map.
        settings: How the robot explores.
        start: Where it began.
    """
    floor = settings.traversability(grid)
    reachable = np.any([floor.reachable(each.pose) for each in observations], axis=0)
    within = np.ones_like(reachable)
    if not is_enclosed(observations[0]):
        within = floor.disc(start.x, start.y, settings.radius)
    return Unexplored(
        floor.places_of(floor.frontiers & reachable & within, 0.0),
        floor.places_of(floor.open & ~reachable & within, LEAST_AREA),
    )
