"""Anchoring: turns a map back to the start pose, which only the first scans know.

Theory of operation
===================
A robot that stands sees all from one place, and each wall by few beams. What it sees
next is matched with that little, and goes on from there: the map is true in itself, but
turned by some tenths of a degree. Later, when walls have been seen from many places,
the first scans are matched with the map of all others. Where they fit shows by how much
it is off, and all but the first scans are moved by that. It is repeated a few times, as
that map becomes better. A map that is off by less than the first scans can tell stays
where it is.

A map that the robot has left parts of behind is not moved: it may have bent since.
"""

import math
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.mapping.keyframes import KeyframeMap, joined, map_of
from radarsim.mapping.loop_closure import MIN_EVENNESS, MIN_INLIERS
from radarsim.mapping.scan_matching import fit

ANCHOR_INTERVAL: Final = 25.0  # m of path
MOST_ANCHORINGS: Final = 4
LEAST_TURN: Final = math.radians(0.1)  # by which a map has to be off to be moved
MAX_POINTS: Final = 4000  # of the first scans
SIGMA: Final = (0.1, 0.1, 0.05)  # m, m and rad; by how much a map may be off


def find_correction(known: KeyframeMap, first: int) -> Pose2 | None:
    """Find by how much a map is off its start.

    Args:
        known: All keyframes.
        first: How many of them are at the start.

    Returns:
        The pose, map frame, at which the map of all others has its place; None if the
        first ones do not show it.
    """
    keyframes = known.keyframes
    if not all(each.is_local for each in keyframes):
        return None
    start = keyframes[0].pose
    points = joined(keyframes[:first], start, MAX_POINTS)
    sigma: Floats = np.array(SIGMA)
    found = fit(map_of(keyframes[first:]).table, points, start, start, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    return start.compose(Pose2(0.0, 0.0).relative_to(found.pose))
