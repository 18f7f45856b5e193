"""Map merger: finds where the maps of several robots are on the one that they share.

What a robot has seen is compared with what all robots on the shared map have seen. A
map that is not there yet is tried again whenever robots have gone on a little, each
time at another place of its robot's path. One that is there is fitted again now and
then, as what was seen since tells more.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from radarsim.exploration.exploration import Exploration
from radarsim.geometry import Pose2, wrap_angle
from radarsim.mapping.keyframes import Keyframe, KeyframeMap
from radarsim.mapping.map_alignment import VIEWS, align, refine
from radarsim.mapping.shared_map import RobotMap
from radarsim.mapping.slam import FIRST_KEYFRAMES

RETRY: Final = 1.0  # m of path, of it and of others, between two attempts to align one
REFINE: Final = 5.0  # m of path after which an aligned map is fitted anew
NEWS: Final = 0.01, 0.001  # m and rad by which a map has to be off for that to count


class MapMerger:
    """Aligns the maps of robots, of which the first one's is the shared map."""

    def __init__(self, robots: Sequence[Exploration], maps: Sequence[RobotMap]) -> None:
        """Begin with the robots' maps, which may still be empty.

        Args:
            robots: The run of each robot.
            maps: The map of each robot that has joined, in the same order.
        """
        self._robots = robots
        self._maps = maps
        self._next_station = [0.0] * len(robots)
        self._attempts = [0] * len(robots)

    def step(self, number: int) -> None:
        """Align the map of a robot after a scan, if it is time to."""
        map_, known = self._maps[number], self._keyframes(number)
        if number == 0 or len(known) < FIRST_KEYFRAMES:
            return
        station = known.keyframes[-1].station
        # A robot that waits sees nothing new, but others may come to where it was.
        if map_.frame is None:
            station += sum(self._station(k) for k in self._placed())
        if station < self._next_station[number]:
            return
        if map_.frame is not None:
            self._next_station[number] = station + REFINE
            self._refine(number)
            return
        self._next_station[number] = station + RETRY
        if self._try_to_align(number):
            self._next_station[number] = known.keyframes[-1].station + REFINE

    def refine_all(self) -> bool:
        """Fit all aligned maps again; return whether any of them has moved."""
        moved = [self._refine(number) for number in range(1, len(self._maps))]
        return any(moved)

    def finish(self) -> None:
        """Align all maps with what is known at the end."""
        for number in range(1, len(self._maps)):
            if not len(self._keyframes(number)):
                continue
            if self._maps[number].frame is None:
                any(self._try_to_align(number) for _ in range(VIEWS))
            self._refine(number)

    def _try_to_align(self, number: int) -> bool:
        """Find where the robot's map is on the shared one; return whether it is known.

        Each attempt looks at another place.
        """
        map_, attempt = self._maps[number], self._attempts[number]
        self._attempts[number] += 1
        reference = self._reference(number)
        frame = align(reference, self._keyframes(number), map_.frame_pose, attempt)
        if frame is None:
            return False
        map_.align(frame)
        for other in set(range(len(self._maps))) - set(self._placed()):
            self._next_station[other] = 0.0  # what this one has seen may place it, too
        return True

    def _refine(self, number: int) -> bool:
        """Fit an aligned map again; return whether it has moved."""
        map_, reference = self._maps[number], self._reference(number)
        if map_.frame is None or not reference:
            return False
        frame = refine(reference, self._keyframes(number), map_.frame)
        if frame is None or not _differ(frame, map_.frame):
            return False
        map_.align(frame)
        return True

    def _reference(self, number: int) -> list[Keyframe]:
        """Return the keyframes of all other robots that are on the shared map."""
        return [
            Keyframe(
                self._maps[other].frame_pose.compose(each.pose),
                each.points,
                each.station,
            )
            for other in self._placed()
            if other != number
            for each in self._keyframes(other).keyframes
        ]

    def _placed(self) -> list[int]:
        """Return the numbers of the robots that are on the shared map."""
        return [k for k, map_ in enumerate(self._maps) if map_.frame is not None]

    def _station(self, number: int) -> float:
        known = self._keyframes(number)
        return known.keyframes[-1].station if len(known) else 0.0

    def _keyframes(self, number: int) -> KeyframeMap:
        mapper = self._robots[number].mapper
        return KeyframeMap() if mapper is None else mapper.slam.keyframes


def _differ(one: Pose2, other: Pose2) -> bool:
    distance, angle = NEWS
    return (
        bool(np.hypot(one.x - other.x, one.y - other.y) > distance)
        or abs(wrap_angle(one.yaw - other.yaw)) > angle
    )
