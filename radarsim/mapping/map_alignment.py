"""Map alignment: finds where a robot's map is on that of others.

Theory of operation
===================
What a robot has seen last is matched with a map of the points of others, at poses all
around the one that the start poses of the robots give; as a loop closure, the match
counts only where most points fit, and not in a corridor. From then on the robot's whole
map is fitted from time to time, as the maps that overlap grow.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from radarsim.geometry import Pose2
from radarsim.mapping.keyframes import Keyframe, KeyframeMap, joined, map_of
from radarsim.mapping.loop_closure import MIN_EVENNESS, find_pose, latest_keyframe
from radarsim.mapping.scan_matching import fit

MAX_DISTANCE: Final = 1.5  # m by which the first guess may be off
MAX_TURN: Final = 0.2  # rad
MAX_POINTS: Final = 3000  # of a whole map
MIN_FITTING: Final = 300  # points of a whole map that have to fit
SIGMA: Final = (0.2, 0.2, 0.03)  # m, m and rad; of a frame that is known


def align(
    reference: Sequence[Keyframe], known: KeyframeMap, guess: Pose2
) -> Pose2 | None:
    """Find where a robot's map is on another one, knowing about where it is.

    Args:
        reference: Keyframes of the other map, their poses on it.
        known: Keyframes of the robot.
        guess: About where the origin of its map is on the other one, within 1.5 m and
            11°, seen from the robot's last keyframe.

    Returns:
        The pose of its origin; None if the maps do not overlap enough to be sure.
    """
    latest = latest_keyframe(known)
    own = latest.pose
    table = map_of(list(reference)).table
    there = Keyframe(guess.compose(own), latest.points, latest.station)
    found = find_pose(table, there, MAX_DISTANCE, MAX_TURN)
    return None if found is None else _frame(found.pose, own)


def refine(
    reference: Sequence[Keyframe], known: KeyframeMap, frame: Pose2
) -> Pose2 | None:
    """Fit a robot's whole map to another one, on which it is known.

    Args:
        reference: Keyframes of the other map, their poses on it.
        known: Keyframes of the robot.
        frame: Pose of its origin on the other map.

    Returns:
        A better pose; None if the maps do not overlap enough.
    """
    own = known.keyframes[-1].pose
    points = joined(known.keyframes, own, MAX_POINTS)
    start = frame.compose(own)
    found = fit(map_of(list(reference)).table, points, start, start, np.array(SIGMA))
    fitting = found.inliers * len(points.places)
    if fitting < MIN_FITTING or found.evenness < MIN_EVENNESS:
        return None
    return _frame(found.pose, own)


def _frame(pose: Pose2, own: Pose2) -> Pose2:
    """Return the pose of a map's origin by the pose of a robot on another map."""
    return pose.compose(Pose2(0.0, 0.0).relative_to(own))
