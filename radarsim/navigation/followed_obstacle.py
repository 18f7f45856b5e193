"""Which beams end on the obstacle that a robot follows, among others beside it.

Points between which the robot does not fit belong to one obstacle. So a robot that goes
around one of two poles does not change to the other where that is as near.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.observation import Observation
from radarsim.navigation.wall_following import FollowMode, WallFollower

LINK: Final = 0.1  # m beyond twice the safety distance: widest gap within an obstacle
NEARER: Final = 0.15  # m by which another obstacle is nearer if it is steered by
_REACH: Final = 0.6  # m that the nearest point may jump between two scans

Point = tuple[float, float]


class FollowedObstacle:
    """Keeps to one obstacle from scan to scan, by its nearest point."""

    def __init__(self, point: Point, follower: WallFollower) -> None:
        """Begin at the point that was hit, m, map frame."""
        self._point = point
        self._follower = follower

    def part_of(self, observation: Observation, mode: FollowMode) -> Observation:
        """Return the scan without the beams that end on other obstacles.

        If another one is clearly nearer on the boundary's hand, or the obstacle is out
        of sight, the whole scan is returned: then what is nearest is followed.

        Args:
            observation: The newest scan.
            mode: How the obstacle is followed.
        """
        ends = _linked_beams(observation, self._point, self._follower.bumpers)
        part = replace(observation, ranges=np.where(ends, observation.ranges, np.inf))
        own = self._follower.boundary(part, mode)
        nearest = self._follower.boundary(observation, mode)
        if nearest is None:
            return observation
        self._point = (own or nearest).point_from(observation.pose)
        if own is None or nearest.distance < own.distance - NEARER:
            return observation
        return part


def _linked_beams(
    observation: Observation, point: Point, bumpers: Bumpers
) -> NDArray[np.bool_]:
    """Return which beams end on the obstacle that a point belongs to, (N,)."""
    gap = 2 * bumpers.safety_distance + LINK
    near = np.flatnonzero(observation.ranges < bumpers.pressed_below + gap)
    angles = observation.bearings[near] + observation.pose.yaw
    pose = complex(observation.pose.x, observation.pose.y)
    ends = pose + observation.ranges[near] * np.exp(1j * angles)
    beams = np.zeros(len(observation.ranges), np.bool_)
    linked = np.abs(ends - complex(*point)) <= _REACH
    links = np.abs(ends[:, None] - ends) <= gap
    while not np.array_equal(grown := links[linked].any(axis=0), linked):
        linked = grown
    beams[near[linked]] = True
    return beams
