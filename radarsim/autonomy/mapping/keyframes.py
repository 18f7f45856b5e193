"""Keyframes: the scans that maps of points are made of, and which of them count.

Theory of operation
===================
What was seen near by is consistent with the robot's pose; what it left behind long ago
may not be, as the pose has drifted since. Keyframes therefore leave the local map when
the robot is far away, and come back only when a loop closure has brought both together.
In a room that the scanner sees as a whole nothing is ever left behind.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.autonomy.mapping.point_map import PointMap
from radarsim.autonomy.mapping.scan_matching import ScanPoints
from radarsim.geometry import Floats, Pose2

REACHES: Final = 1.5  # distance at which keyframes are left behind, by the reach
STRIDE: Final = 2.0  # m of path after which keyframes are left behind anew


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

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self.keyframes)

    def add(self, keyframe: Keyframe) -> None:
        """Add a keyframe to the local map, and leave those behind that are far away."""
        self.keyframes.append(keyframe)
        _add(self.points, keyframe)
        # how far keyframes overlap, and so how far away they still belong together
        farthest = np.hypot(*keyframe.points.places.T).max(initial=0.0)
        self.reach = max(self.reach, float(farthest))
        if keyframe.station > self._swept + STRIDE:
            self._swept, far = keyframe.station, False
            for each in self.keyframes:
                away = distance(each.pose, keyframe.pose)
                if each.is_local and away > REACHES * self.reach:
                    each.is_local, far = False, True
            if far:
                self._rebuild()

    def left_behind(self, pose: Pose2, radius: float) -> list[int]:
        """Return the numbers of keyframes near a pose that the local map has not."""
        return [
            number
            for number, each in enumerate(self.keyframes)
            if not each.is_local and distance(each.pose, pose) < radius
        ]

    def move(self, poses: list[Pose2]) -> None:
        """Move all keyframes; those around the last one are local then."""
        local = REACHES * self.reach
        for keyframe, pose in zip(self.keyframes, poses, strict=True):
            keyframe.pose = pose
            keyframe.is_local = distance(pose, poses[-1]) < local
        # points of a map are only sums, from which none can be taken exactly
        self._rebuild()

    def _rebuild(self) -> None:
        self.points = map_of([each for each in self.keyframes if each.is_local])


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


def distance(one: Pose2, other: Pose2) -> float:
    """Return the distance between two poses, m."""
    return math.hypot(one.x - other.x, one.y - other.y)
