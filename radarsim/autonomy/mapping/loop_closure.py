"""Loop closure: recognises a place that the robot has been to before.

Theory of operation
===================
Near keyframes that the local map has left behind, what the robot has seen last is
matched with the map that these make. The pose may have drifted since, in proportion to
the path, so that poses are tried all around the estimated one, and the best is
corrected. It counts only where most points fit, and not in a corridor, which looks the
same everywhere along it.

What a wall looks like depends on where it is seen from. A match from some metres beside
the old place can be off by more than the whole loop is, above all while much of what
the robot sees is not on the old map yet. From there, almost all points must fit;
otherwise the loop closes farther on.

Anchoring: turns a map back to the start pose, which only the first scans know.

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
from dataclasses import dataclass
from itertools import takewhile
from typing import Final, NamedTuple

import numpy as np

from radarsim.autonomy.mapping.keyframes import Keyframe, KeyframeMap, joined, map_of
from radarsim.autonomy.mapping.point_map import Table
from radarsim.autonomy.mapping.scan_matching import Fit, best_start, fit
from radarsim.geometry import Floats, Pose2

MAX_DISTANCE: Final = 4.0  # m from the old keyframe
SAME_PLACE: Final = 2.0  # m from it, beyond which almost all points must fit
MIN_INLIERS_BESIDE: Final = 0.9  # share of the points there
RETRY: Final = 0.5  # m of path between two attempts, each of which takes long
LATEST: Final = 3.0  # m of path whose keyframes are matched together
MAX_POINTS: Final = 600  # of these, that are matched
DRIFT: Final = 0.04  # share of the path by which the pose may be off
MIN_DRIFT, MAX_DRIFT = 0.15, 1.5  # m
TURN_DRIFT: Final = 0.003  # rad/m
MIN_TURN, MAX_TURN = 0.05, 0.2  # rad
STEP, TURN_STEP = 0.15, 0.025  # m and rad between poses that are tried
MIN_INLIERS: Final = 0.6  # share of the points
MIN_EVENNESS: Final = 0.1  # wrong matches along corridors had up to 0.05


class Closure(NamedTuple):
    """A loop that closes.

    Attributes:
        start: Number of an old keyframe.
        pose: Where the last keyframe is by the map around the old one.
        information: (3, 3) information matrix of that pose, on the map's axes.
    """

    start: int
    pose: Pose2
    information: Floats


@dataclass(slots=True)
class LoopCloser:
    """Looks for loops.

    Attributes:
        next_station: Length of the path from which on it looks again, m.
    """

    next_station: float = 0.0

    def closure(self, known: KeyframeMap, latest: Fit) -> Closure | None:
        """Return where the last keyframe is by older ones, if a loop closes.

        Args:
            known: All keyframes.
            latest: The fit of the last one to the local map.
        """
        last = known.keyframes[-1]
        # A corridor looks the same everywhere along it.
        if last.station < self.next_station or latest.evenness < MIN_EVENNESS:
            return None
        near = known.left_behind(last.pose, min(MAX_DISTANCE, known.reach))
        if not near:
            return None
        self.next_station = last.station + RETRY
        x, y = last.pose.x, last.pose.y
        poses = [known.keyframes[number].pose for number in near]
        nearest = near[
            int(np.argmin([(pose.x - x) ** 2 + (pose.y - y) ** 2 for pose in poses]))
        ]
        old = known.keyframes[nearest]
        # The error of a pose grows with the path since, up to a limit: tried poses grow
        # with its third power.
        gap = last.station - old.station
        distance = min(MIN_DRIFT + DRIFT * gap, MAX_DRIFT)
        turn = min(MIN_TURN + TURN_DRIFT * gap, MAX_TURN)
        around = [
            each
            for each in known.keyframes
            if not each.is_local and abs(each.station - old.station) < known.reach
        ]
        table = map_of(around).table
        found = find_pose(table, latest_keyframe(known), distance, turn)
        if found is None:
            return None
        # From beside the old place walls look different, and a match may be off by more
        # than the loop is. Farther on there will be another attempt.
        motion = found.pose.relative_to(old.pose)
        is_beside = math.hypot(motion.x, motion.y) > SAME_PLACE
        if is_beside and found.inliers < MIN_INLIERS_BESIDE:
            return None
        return Closure(nearest, found.pose, found.information)


def find_pose(
    table: Table, keyframe: Keyframe, distance: float, turn: float
) -> Fit | None:
    """Find where a keyframe is on a map, near its pose.

    Args:
        table: The map.
        keyframe: The keyframe, with points of those around it.
        distance: How far its pose may be off, m.
        turn: And its heading, rad.

    Returns:
        The fit; None if too few points fit, or the place is a corridor.
    """
    points, pose = keyframe.points, keyframe.pose
    starts = starts_around(pose, distance, turn)
    # The fit alone finds the nearest optimum, which need not be the best one.
    start = Pose2(*starts[best_start(table, points, starts)].tolist())
    found = fit(table, points, start, pose, np.array([distance, distance, turn]))
    is_sure = found.inliers >= MIN_INLIERS and found.evenness >= MIN_EVENNESS
    return found if is_sure else None


def starts_around(pose: Pose2, distance: float, turn: float) -> Floats:
    """Return poses all around a pose, (S, 3)."""
    shifts = _steps(distance, STEP)
    x, y, yaw = np.meshgrid(shifts, shifts, _steps(turn, TURN_STEP))
    offsets = np.column_stack([x.ravel(), y.ravel(), yaw.ravel()])
    starts: Floats = offsets + np.array([pose.x, pose.y, pose.yaw])
    return starts


def _steps(limit: float, step: float) -> Floats:
    count = int(np.ceil(limit / step))
    steps: Floats = np.arange(-count, count + 1, dtype=np.float64) * step
    return steps


def latest_keyframe(known: KeyframeMap) -> Keyframe:
    """Return the last keyframe with points of those shortly before, too."""
    last = known.keyframes[-1]
    latest = takewhile(
        lambda each: each.station >= last.station - LATEST and each.is_local,
        reversed(known.keyframes),
    )
    points = joined(latest, last.pose, MAX_POINTS)
    return Keyframe(last.pose, points, last.station)


ANCHOR_INTERVAL: Final = 25.0  # m of path
MOST_ANCHORINGS: Final = 4
LEAST_TURN: Final = math.radians(0.1)  # by which a map has to be off to be moved
MAX_FIRST_POINTS: Final = 4000  # of the first scans
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
    # Who has left parts of the map behind may have bent it since; only a loop tells.
    if not all(each.is_local for each in keyframes):
        return None
    start = keyframes[0].pose
    points = joined(keyframes[:first], start, MAX_FIRST_POINTS)
    sigma: Floats = np.array(SIGMA)
    found = fit(map_of(keyframes[first:]).table, points, start, start, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    return start.compose(Pose2(0.0, 0.0).relative_to(found.pose))
