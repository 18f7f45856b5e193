"""Which beams end on one obstacle: those that are linked to a known point of it.

Points between which the robot does not fit belong to one obstacle; so a robot that
follows one of two poles does not change to the other where that comes nearer.
"""

import numpy as np
from numpy.typing import NDArray

from radarsim.navigation.observation import Observation

REACH = 0.6  # m that the nearest point of an obstacle may jump between two scans


def linked_beams(
    observation: Observation,
    point: tuple[float, float],
    *,
    gap: float,
    max_range: float,
) -> NDArray[np.bool_] | None:
    """Return which beams end on the obstacle that a point belongs to.

    Args:
        observation: The newest scan.
        point: A point of the obstacle, m, map frame.
        gap: Largest distance of points of one obstacle from the next, m.
        max_range: Longer beams are left out, m.

    Returns:
        (N,), or None if no beam ends near the point.
    """
    near = np.flatnonzero(observation.ranges < max_range)
    angles = observation.bearings[near] + observation.pose.yaw
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    ends = directions * observation.ranges[near, None]
    ends += observation.pose.x, observation.pose.y
    from_point = np.hypot(*(ends - point).T)
    if from_point.min(initial=np.inf) > REACH:
        return None
    apart = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
    links = apart <= gap
    linked = np.zeros(len(near), np.bool_)
    linked[from_point.argmin()] = True
    while not np.array_equal(grown := links[linked].any(axis=0), linked):
        linked = grown
    beams = np.zeros(len(observation.ranges), np.bool_)
    beams[near[linked]] = True
    return beams
