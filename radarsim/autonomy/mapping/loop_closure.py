"""Keyframes: the scans that maps of points are made of, and the loops that they close.

Theory of operation
===================
What was seen near by is consistent with the robot's pose; what it left behind long ago
may not be, as the pose has drifted since. Keyframes therefore leave the local map when
the robot is far away, and come back only when a loop closure has brought both together.
In a room that the scanner sees as a whole nothing is ever left behind.

Loop closure: near keyframes that the local map has left behind, what the robot has seen
last is matched with the map that these make. The pose may have drifted since, in
proportion to the path, so that poses are tried all around the estimated one, and the
best is corrected. It counts only where most points fit, and not in a corridor, which
looks the same everywhere along it, nor where the points fit about as well at the
estimated pose, far from the best one, as in a row of niches. What a wall looks like
depends on where it is seen from: a match from some metres off the old place can be
off by more than the whole loop is, above all while much of what the robot sees is not
on the old map yet. From there, almost all points must fit; otherwise the loop closes
farther on.

Anchoring: a robot that stands sees all from one place, and each wall by few beams. What
it sees next is matched with that little, and goes on from there: the map is true in
itself, but turned by some tenths of a degree. Later, when walls have been seen from
many places, the first scans, which alone know the start pose, are matched with the map
of all others. Where they fit shows by how much it is off, and all but the first scans
are moved by that. It is repeated a few times, as that map becomes better. A map that is
off by less than the first scans can tell stays where it is, and so does one that the
robot has left parts of behind: it may have bent since.
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

REACHES: Final = 1.5  # distance at which keyframes are left behind, by the reach
STRIDE: Final = 2.0  # m of path after which keyframes are left behind again
MAX_DISTANCE: Final = 4.0  # m from the old keyframe
SAME_PLACE: Final = 2.0  # m from it, beyond which almost all points must fit
MIN_INLIERS_BESIDE: Final = 0.9  # share of the points there
RETRY: Final = 0.5  # m of path between two attempts, since each takes long
LATEST: Final = 3.0  # m of path whose keyframes are matched together
MAX_POINTS: Final = 600  # of these, that are matched
DRIFT: Final = 0.04  # share of the path by which the pose may be off
MIN_DRIFT, MAX_DRIFT = 0.15, 1.5  # m
TURN_DRIFT: Final = 0.003  # rad/m
MIN_TURN, MAX_TURN = 0.05, 0.2  # rad
STEP, TURN_STEP = 0.15, 0.025  # m and rad between poses that are tried
MIN_INLIERS: Final = 0.6  # share of the points
MIN_EVENNESS: Final = 0.1  # wrong matches along corridors had up to 0.05
APART: Final = 0.4  # m between two poses that are not the same
MAX_RIVAL: Final = 0.75  # score of one by the other's; at wrong ones 0.82 to 1.09
ANCHOR_INTERVAL: Final = 25.0  # m of path
MOST_ANCHORINGS: Final = 4
LEAST_TURN: Final = math.radians(0.1)  # by which a map has to be off to be moved
MAX_FIRST_POINTS: Final = 4000  # of the first scans
SIGMA: Final = (0.1, 0.1, 0.05)  # m, m and rad; by how much a map may be off


@dataclass(slots=True)
class Keyframe:
    """A scan that is part of the map.

    Attributes:
        pose: Pose of the robot, map frame.
        points: Points of the scan.
        station: Length of the path until there, m.
        is_local: Whether it is part of the local map.
    """

    pose: Pose2
    points: ScanPoints
    station: float
    is_local: bool = True


class KeyframeMap:
    """All keyframes, and a map of the points of the local ones.

    Attributes:
        keyframes: Keyframes in the order in which they were added.
        points: Map of the local ones.
        reach: Distance of the farthest point that any keyframe has seen, m.
    """

    def __init__(self) -> None:
        self.keyframes: list[Keyframe] = []
        self.points = PointMap()
        self.reach = 0.0
        self._swept = 0.0  # station
        self._next_attempt = 0.0  # station from which on it looks for a loop again

    def add(self, keyframe: Keyframe) -> None:
        """Add a keyframe to the local map, and leave those behind that are far away."""
        self.keyframes.append(keyframe)
        _add(self.points, keyframe)
        # how far keyframes overlap, and so how far away they still belong together
        farthest = np.hypot(*keyframe.points.places.T).max(initial=0.0)
        self.reach = max(self.reach, float(farthest))
        # Only now and then: a map that some keyframes leave is rebuilt.
        if keyframe.station > self._swept + STRIDE:
            self._swept, far = keyframe.station, False
            for each in self.keyframes:
                away = each.pose.distance(keyframe.pose)
                if each.is_local and away > REACHES * self.reach:
                    each.is_local, far = False, True
            if far:
                self._rebuild()

    def move(self, poses: list[Pose2]) -> None:
        """Move all keyframes; those around the last one are local then."""
        local = REACHES * self.reach
        for keyframe, pose in zip(self.keyframes, poses, strict=True):
            keyframe.pose = pose
            keyframe.is_local = pose.distance(poses[-1]) < local
        # points of a map are only sums, from which none can be taken exactly
        self._rebuild()

    def _rebuild(self) -> None:
        self.points = map_of([each for each in self.keyframes if each.is_local])

    def find_closure(self, latest: Fit) -> tuple[int, Pose2, Floats] | None:
        """Return where the last keyframe is by older ones, if a loop closes.

        Args:
            latest: The fit of the last one to the local map.

        Returns:
            The number of an old keyframe, the pose of the last one by the map around
            it, and the (3, 3) information matrix of that pose on the map's axes.
        """
        last = self.keyframes[-1]
        # A corridor looks the same everywhere along it.
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
        # Whether a loop closes or not: to look for one is what takes long.
        self._next_attempt = last.station + RETRY
        old = self.keyframes[nearest]
        # The error of a pose grows with the path since, up to a limit: tried poses grow
        # with its third power.
        gap = last.station - old.station
        drift = min(MIN_DRIFT + DRIFT * gap, MAX_DRIFT)
        turn = min(MIN_TURN + TURN_DRIFT * gap, MAX_TURN)
        # Near along the path, not only in space: these are consistent with each other.
        around = [
            each
            for each in self.keyframes
            if not each.is_local and abs(each.station - old.station) < self.reach
        ]
        found = find_pose(map_of(around).table, self._latest(), drift, turn)
        if found is None:
            return None
        # From some metres off walls look different, and a match may be off by more
        # than the loop is. Farther on there will be another attempt.
        is_beside = found.pose.distance(old.pose) > SAME_PLACE
        if is_beside and found.inliers < MIN_INLIERS_BESIDE:
            return None
        return nearest, found.pose, found.information

    def _latest(self) -> Keyframe:
        """Return the last keyframe with points of those shortly before, too."""
        last = self.keyframes[-1]
        latest = takewhile(
            lambda each: each.station >= last.station - LATEST and each.is_local,
            reversed(self.keyframes),
        )
        points = joined(latest, last.pose, MAX_POINTS)
        return Keyframe(last.pose, points, last.station)


def map_of(keyframes: list[Keyframe]) -> PointMap:
    """Return a map of the points of some keyframes."""
    points = PointMap()
    for keyframe in keyframes:
        _add(points, keyframe)
    return points


def joined(keyframes: Iterable[Keyframe], pose: Pose2, most: int) -> ScanPoints:
    """Return the points of some keyframes as one scan.

    Args:
        keyframes: At least one keyframe.
        pose: Pose of the scan, map frame.
        most: Number of points from which on only some of them are returned.
    """
    keyframes = list(keyframes)
    parts: list[tuple[Floats, Floats, Floats]] = []
    for each in keyframes:
        motion = each.pose.relative_to(pose)
        along, normals = (turned(rows, motion.yaw) for rows in each.points[1:3])
        parts.append((moved(each.points.places, motion), along, normals))
    # every second, third and so on, so that all keyframes keep their share
    step = 1 + sum(len(places) for places, *_ in parts) // most
    columns = (np.concatenate(column)[::step] for column in zip(*parts, strict=True))
    places, along, normals = map(np.ascontiguousarray, columns)
    points = keyframes[0].points
    return points._replace(places=places, along=along, normals=normals)


def _add(points: PointMap, keyframe: Keyframe) -> None:
    pose, own = keyframe.pose, keyframe.points
    points.add(moved(own.places, pose), turned(own.normals, pose.yaw))


def moved(places: Floats, pose: Pose2) -> Floats:
    """Return places in the frame of a pose in that of the pose itself, (K, 2) m."""
    result: Floats = turned(places, pose.yaw) + np.array([pose.x, pose.y])
    return result


def turned(vectors: Floats, yaw: float) -> Floats:
    """Return vectors turned counter-clockwise, (K, 2)."""
    c, s = math.cos(yaw), math.sin(yaw)
    result: Floats = vectors @ np.array([[c, s], [-s, c]])
    return result


def find_pose(
    table: Packed, keyframe: Keyframe, limit: float, turn: float
) -> Fit | None:
    """Find where a keyframe is on a map, near its pose.

    Args:
        table: The map.
        keyframe: The keyframe, with points of those around it.
        limit: How far its pose may be off, m.
        turn: And its heading, rad.

    Returns:
        The fit; None if too few points fit, the place is a corridor, or the keyframe
        fits about as well where it seems to be.
    """
    points, pose = keyframe.points, keyframe.pose
    starts = _starts_around(pose, limit, turn)
    # The fit alone finds the nearest optimum, which need not be the best one.
    start = Pose2(*starts[best_start(table, points, starts)].tolist())
    # The estimate holds the pose no tighter than it may be off.
    sigma = np.array([limit, limit, turn])
    found = fit(table, points, start, pose, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    # Niches, doors or pillars in a row look alike from many poses. A row that is only
    # half known fits best at a wrong one, and about as well at the estimated pose.
    rival = fit(table, points, pose, pose, sigma)
    is_apart = rival.pose.distance(found.pose) > APART
    return None if is_apart and rival.score > MAX_RIVAL * found.score else found


def _starts_around(pose: Pose2, limit: float, turn: float) -> Floats:
    """Return poses all around a pose, (S, 3)."""
    counts = [math.ceil(limit / STEP)] * 2 + [math.ceil(turn / TURN_STEP)]
    steps = [
        np.arange(-count, count + 1, dtype=np.float64) * step
        for count, step in zip(counts, (STEP, STEP, TURN_STEP), strict=True)
    ]
    offsets = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3)
    starts: Floats = offsets + np.array([pose.x, pose.y, pose.yaw])
    return starts


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
    # Who has left parts of the map behind may have bent it since; only a loop shows it.
    if not all(each.is_local for each in keyframes):
        return None
    start = keyframes[0].pose
    points = joined(keyframes[:first], start, MAX_FIRST_POINTS)
    sigma: Floats = np.array(SIGMA)
    found = fit(map_of(keyframes[first:]).table, points, start, start, sigma)
    if found.inliers < MIN_INLIERS or found.evenness < MIN_EVENNESS:
        return None
    # The inverse, since not the first keyframes are moved but the map of all others.
    return start.compose(Pose2(0.0, 0.0).relative_to(found.pose))
