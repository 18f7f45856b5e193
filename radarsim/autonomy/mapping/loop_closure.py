"""Keyframes: the scans that make up point maps, and the detection of loop closures.

Theory of operation
===================
Recently seen points are consistent with the robot's pose; points seen long ago may not
be, since the pose has drifted in between. Keyframes are therefore removed from the
local map when the robot is far away from them, and added again only after a loop
closure has aligned them. In a room that the scanner sees as a whole, no keyframe leaves
the local map.

Loop closure: near keyframes that have left the local map, the latest points are matched
with a map of these keyframes. The pose may have drifted in proportion to the path, so
start poses all around the estimate are tried, and the best is refined. The match counts
only if most points fit. It does not count in a corridor, since scans look the same all
along it. It also does not count if the points fit about as well at the estimated pose,
far away from the best pose, as in a row of niches. A wall looks different from
different positions. So a match a few metres away from the old position can have a
larger error than the whole loop, especially while many of the seen points are not on
the old map yet. There almost all points have to fit. Otherwise the loop is closed
later, farther along the path.

Anchoring: before a robot moves, it sees everything from one position, and each wall
with few beams. The next scans are matched with these few points, and later scans with
the next ones. So the map becomes consistent, but is rotated by some tenths of a degree.
Only the first scans have the exact start pose. After walls have been seen from many
positions, these scans are matched with the map of all other scans. The match gives the
error of this map, and all keyframes except the first ones are corrected by it. This is
repeated a few times while the map improves. A map stays in place if its error is below
the accuracy of the first scans, or if keyframes have left the local map, since it may
have bent since then.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

import numpy as np

from radarsim.autonomy.mapping.scan_matching import (
    Fit,
    PointMap,
    ScanPoints,
    best_start,
    fit,
)
from radarsim.engine import Packed
from radarsim.geometry import Floats, Pose2

REACHES: Final = 1.5  # times the reach: distance at which keyframes leave the local map
STRIDE: Final = 2.0  # m of path between checks for keyframes to leave
MAX_DISTANCE: Final = 4.0  # m between the pose and an old keyframe
SAME_PLACE: Final = 2.0  # m from the old keyframe; beyond it almost all points must fit
MIN_INLIERS_BESIDE: Final = 0.9  # least share of fitting points beyond ``SAME_PLACE``
RETRY: Final = 0.5  # m of path between two attempts, each of which is slow
LATEST: Final = 3.0  # m of path whose keyframes are matched together
MAX_POINTS: Final = 600  # points of these keyframes that are matched
DRIFT: Final = 0.04  # share of the path by which the pose may drift
MIN_DRIFT, MAX_DRIFT = 0.15, 1.5  # m; limits of the possible drift
TURN_DRIFT: Final = 0.003  # rad/m; possible drift of the heading
MIN_TURN, MAX_TURN = 0.05, 0.2  # rad; limits of the possible drift of the heading
STEP, TURN_STEP = 0.15, 0.025  # m and rad between start poses
MIN_INLIERS: Final = 0.6  # least share of fitting points
MIN_EVENNESS: Final = 0.1  # wrong matches along corridors had up to 0.05
APART: Final = 0.4  # m between two distinct poses
MAX_RIVAL: Final = 0.75  # ratio of scores; wrong matches had 0.82 to 1.09
ANCHOR_INTERVAL: Final = 25.0  # m of path between anchorings
MOST_ANCHORINGS: Final = 4
LEAST_TURN: Final = math.radians(0.1)  # smaller rotation errors are not corrected
MAX_FIRST_POINTS: Final = 4000  # points of the first scans
SIGMA: Final = (0.1, 0.1, 0.05)  # m, m and rad; possible error of a map


@dataclass(slots=True)
class Keyframe:
    """A keyframe: a scan that is part of the point map, with its pose.

    Attributes:
        pose: Pose of the robot, map frame.
        points: Points of the scan.
        station: Length of the path up to the scan, m.
        is_local: Whether the scan belongs to the local map.
    """

    pose: Pose2
    points: ScanPoints
    station: float
    is_local: bool = True


class KeyframeMap:
    """All keyframes, and a point map of the keyframes near the robot.

    Attributes:
        keyframes: Keyframes in the order in which they were added.
        points: Map of the points of the local keyframes.
        reach: Distance of the farthest point in any keyframe, m.
    """

    def __init__(self) -> None:
        self.keyframes: list[Keyframe] = []
        self.points = PointMap()
        self.reach = 0.0
        self._swept = 0.0  # station of the last check
        self._next_attempt = 0.0  # station of the next attempt to close a loop

    def add(self, keyframe: Keyframe) -> None:
        """Add a keyframe to the local map, and remove distant keyframes from it."""
        self.keyframes.append(keyframe)
        _add(self.points, keyframe)
        # Two keyframes overlap only if they are closer than the extent of their points.
        farthest = np.hypot(*keyframe.points.places.T).max(initial=0.0)
        self.reach = max(self.reach, float(farthest))
        # Distant keyframes are searched only at intervals, since the map is rebuilt
        # when some of them are removed.
        if keyframe.station > self._swept + STRIDE:
            self._swept, far = keyframe.station, False
            for each in self.keyframes:
                away = each.pose.distance(keyframe.pose)
                if each.is_local and away > REACHES * self.reach:
                    each.is_local, far = False, True
            if far:
                self._rebuild()

    def move(self, poses: list[Pose2]) -> None:
        """Set the poses of all keyframes; those near the last one are local then."""
        local = REACHES * self.reach
        for keyframe, pose in zip(self.keyframes, poses, strict=True):
            keyframe.pose = pose
            keyframe.is_local = pose.distance(poses[-1]) < local
        # The point map stores only sums over points, so it cannot remove single points.
        self._rebuild()

    def _rebuild(self) -> None:
        self.points = map_of([each for each in self.keyframes if each.is_local])

    def find_closure(self, latest: Fit) -> tuple[int, Pose2, Floats] | None:
        """Match the last keyframe with older keyframes, to detect a loop closure.

        Args:
            latest: The fit of the last keyframe to the local map.

        Returns:
            The number of an old keyframe, the pose of the last keyframe by the map
            around the old one, and the (3, 3) information matrix of that pose on the
            map's axes.
        """
        last = self.keyframes[-1]
        # In a corridor a match is ambiguous, since scans look the same all along it.
        if last.station < self._next_attempt or latest.evenness < MIN_EVENNESS:
            return None
        radius = min(MAX_DISTANCE, self.reach)
        distances = [
            math.inf if each.is_local else last.pose.distance(each.pose)
            for each in self.keyframes
        ]
        nearest = int(np.argmin(distances))
        if distances[nearest] >= radius:
            return None
        # The next attempt is delayed after a success as well, since the search is slow.
        self._next_attempt = last.station + RETRY
        old = self.keyframes[nearest]
        # The possible error of the pose grows with the path since the old keyframe. The
        # error is limited, since the number of start poses grows with its third power.
        gap = last.station - old.station
        drift = min(MIN_DRIFT + DRIFT * gap, MAX_DRIFT)
        turn = min(MIN_TURN + TURN_DRIFT * gap, MAX_TURN)
        # Keyframes that are near in space but not along the path may be inconsistent
        # with each other, so only neighbours along the path are used.
        around = [
            each
            for each in self.keyframes
            if not each.is_local and abs(each.station - old.station) < self.reach
        ]
        found = find_pose(map_of(around).table, self._latest(), drift, turn)
        if found is None:
            return None
        # Seen from another position, walls look different, so a match may have a larger
        # error than the pose. The next attempt follows later on the path.
        is_beside = found.pose.distance(old.pose) > SAME_PLACE
        if is_beside and found.inliers < MIN_INLIERS_BESIDE:
            return None
        return nearest, found.pose, found.information

    def _latest(self) -> Keyframe:
        """Return the last keyframe with the points of the keyframes just before it."""
        last = self.keyframes[-1]
        latest = takewhile(
            lambda each: each.station >= last.station - LATEST and each.is_local,
            reversed(self.keyframes),
        )
        points = joined(latest, last.pose, MAX_POINTS)
        return Keyframe(last.pose, points, last.station)


def map_of(keyframes: list[Keyframe]) -> PointMap:
    """Return a point map of all points of the given keyframes."""
    points = PointMap()
    for keyframe in keyframes:
        _add(points, keyframe)
    return points


def joined(keyframes: Iterable[Keyframe], pose: Pose2, most: int) -> ScanPoints:
    """Return the points of several keyframes as if one scan had seen them.

    Args:
        keyframes: At least one keyframe.
        pose: Pose of the joined scan, map frame.
        most: Number of points above which the points are thinned out.
    """
    keyframes = list(keyframes)
    parts: list[tuple[Floats, Floats, Floats]] = []
    for each in keyframes:
        motion = each.pose.relative_to(pose)
        along, normals = (turned(rows, motion.yaw) for rows in each.points[1:3])
        parts.append((moved(each.points.places, motion), along, normals))
    # Only every n-th point is kept, so that each keyframe keeps the same share of its
    # points.
    step = 1 + sum(len(places) for places, *_ in parts) // most
    columns = (np.concatenate(column)[::step] for column in zip(*parts, strict=True))
    places, along, normals = map(np.ascontiguousarray, columns)
    points = keyframes[0].points
    return points._replace(places=places, along=along, normals=normals)


def _add(points: PointMap, keyframe: Keyframe) -> None:
    pose, own = keyframe.pose, keyframe.points
    points.add(moved(own.places, pose), turned(own.normals, pose.yaw))


def moved(places: Floats, pose: Pose2) -> Floats:
    """Transform points, (K, 2) m, from the frame of a pose to its parent frame."""
    result: Floats = turned(places, pose.yaw) + np.array([pose.x, pose.y])
    return result


def turned(vectors: Floats, yaw: float) -> Floats:
    """Return vectors, (K, 2), rotated counter-clockwise by an angle, rad."""
    c, s = math.cos(yaw), math.sin(yaw)
    result: Floats = vectors @ np.array([[c, s], [-s, c]])
    return result


def find_pose(
    table: Packed, keyframe: Keyframe, limit: float, turn: float
) -> Fit | None:
    """Find the pose at which a keyframe fits a map, near the estimated pose.

    Args:
        table: The map.
        keyframe: The keyframe, with points of its neighbours.
        limit: Largest error of its position, m.
        turn: Largest error of its heading, rad.

    Returns:
        The fit; None if too few points fit, in a corridor, or if the keyframe fits
        about as well at its estimated pose.
    """
    points, pose = keyframe.points, keyframe.pose
    starts = _starts_around(pose, limit, turn)
    # The fit finds only the optimum nearest to its start, so it needs a good start.
    start = Pose2(*starts[best_start(table, points, starts)].tolist())
    # The fit may move away from the estimated pose by the pose's possible error.
    sigma = np.array([limit, limit, turn])
    found = fit(table, points, start, pose, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    # Niches, doors or pillars in a row look alike from many poses. If only half of a
    # row is known, the best fit may be at a wrong pose. In this case, the fit at the
    # estimated pose is about as good, and the match is rejected.
    rival = fit(table, points, pose, pose, sigma)
    is_apart = rival.pose.distance(found.pose) > APART
    return None if is_apart and rival.score > MAX_RIVAL * found.score else found


def _starts_around(pose: Pose2, limit: float, turn: float) -> Floats:
    """Return a grid of start poses, (S, 3), around an estimated pose."""
    counts = [math.ceil(limit / STEP)] * 2 + [math.ceil(turn / TURN_STEP)]
    steps = [
        np.arange(-count, count + 1, dtype=np.float64) * step
        for count, step in zip(counts, (STEP, STEP, TURN_STEP), strict=True)
    ]
    offsets = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3)
    starts: Floats = offsets + np.array([pose.x, pose.y, pose.yaw])
    return starts


def find_correction(known: KeyframeMap, first: int) -> Pose2 | None:
    """Find by how much a map has shifted and turned since its first keyframes.

    Args:
        known: All keyframes.
        first: Number of keyframes at the start.

    Returns:
        The correct pose of the map of all other keyframes, map frame; None if the first
        keyframes do not determine it.
    """
    keyframes = known.keyframes
    # Once keyframes have been dropped, the map may
    # be bent, so only a loop closure can correct it.
    if not all(each.is_local for each in keyframes):
        return None
    start = keyframes[0].pose
    points = joined(keyframes[:first], start, MAX_FIRST_POINTS)
    sigma: Floats = np.array(SIGMA)
    found = fit(map_of(keyframes[first:]).table, points, start, start, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    # The inverse is returned, since the map moves and the first keyframes stay.
    return start.compose(Pose2(0.0, 0.0).relative_to(found.pose))
