"""Where the robot is: its scans against the map of the scans before.

Theory of operation
===================
The motion since the last scan, as INS or odometry tells it, predicts the pose; the scan
corrects it (``matching``). An INS tells its way on the axes of the map, odometry on
those of the robot. With neither, poses all around the last one and the one that its
motion leads to are tried, and the best of them is corrected.

When the robot has moved by a hand's breadth since the last time, its scan becomes part
of the map, and so do the first ones while it stands, which have the start's pose and
make the map dense. The map does not forget: a place that is seen again is matched
against what was seen first, which closes loops as long as the drift until then is less
than the size of what is matched.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.mapping.point_map import PointMap
from radarsim.mapping.scan import PlanarScan
from radarsim.mapping.scan_matching import Points, best_start, fit
from radarsim.mapping.trajectory import Trajectory

MotionSource: TypeAlias = Literal["ins", "odometry", "none"]

FIRST_SCANS: Final = 10  # are kept wherever the robot is
FEWEST: Final = 3  # points that are worth a try


@dataclass(frozen=True, slots=True)
class SlamSettings:
    """How scans are matched.

    Attributes:
        motion_source: What tells the robot's motion between scans.
        beam_spread: Standard deviation of where across its beam an echo comes from, m.
            That of a radar with side rays N units away is N / 300.
        still: Standard deviations of the seed where it says that nothing moves, m, rad.
        drift: The same as a part of the way and of the turn that it tells.
        keep_way: m between scans that become part of the map.
        keep_turn: rad between them.
        search_way: How far the robot gets between two scans, m; used without a seed.
        search_turn: The same of its turn, rad.
    """

    motion_source: MotionSource = "ins"
    beam_spread: float = 0.08
    still: tuple[float, float] = (0.005, 0.003)
    drift: float = 0.1
    keyframe_distance: float = 0.2
    keyframe_angle: float = 0.1
    search_distance: float = 0.12
    search_angle: float = 0.45


class Slam:
    """Localisation and the map that it needs.

    Attributes:
        pose: Of the robot at the last scan; before the first one where it starts.
        trajectory: All poses, by the times of the scans.
    """

    def __init__(
        self, settings: SlamSettings | None = None, start: Pose2 | None = None
    ) -> None:
        """Begin at a pose.

        Args:
            settings: How to match.
            start: Where the robot is at its first scan, map frame; None for where the
                first seed says, or the origin if there is none.
        """
        self.settings = settings or SlamSettings()
        self.pose = start or Pose2(0.0, 0.0)
        self.trajectory = Trajectory()
        self._starts_at_seed = start is None
        self._map = PointMap()
        self._seed: Pose2 | None = None
        self._motion = Pose2(0.0, 0.0)
        self._kept = self.pose
        self._count = 0

    def step(self, scan: PlanarScan, seed: Pose2 | None = None) -> Pose2:
        """Find out where the robot was when it took a scan.

        Args:
            scan: The next one.
            seed: Where INS or odometry believes to be, in its own frame; only its
                changes count. None if it told nothing: the pose is searched.

        Returns:
            The robot's pose, map frame.
        """
        places, along = scan.points(sure=self.settings.motion_source != "none")
        points = Points(
            places,
            along,
            self.settings.beam_spread,
            scan.sees_through and self.settings.motion_source != "none",
        )
        last = self.pose
        if self._starts_at_seed:
            self.pose = seed or self.pose
        elif len(self.trajectory):
            self.pose = self._next(points, seed)
        self._starts_at_seed = False
        self._motion = self.pose.relative_to(last)
        self._seed = seed
        self.trajectory.add(scan.time, self.pose)
        if len(places) and self._is_to_be_kept():
            self._keep(places)
        return self.pose

    def _next(self, points: Points, seed: Pose2 | None) -> Pose2:
        can_match = len(points.places) >= FEWEST and len(self._map) > 0
        if seed is None or self._seed is None or self.settings.motion_source == "none":
            return self._searched(points) if can_match else self.pose
        predicted, sigma = self._predict(self._seed, seed)
        if not can_match:
            return predicted
        return fit(self._map.table, points, predicted, predicted, sigma)[0]

    def _predict(self, before: Pose2, now: Pose2) -> tuple[Pose2, Floats]:
        """Carry the seed's motion over to the pose; say how far that may be off."""
        turn = wrap_angle(now.yaw - before.yaw)
        dx, dy = now.x - before.x, now.y - before.y
        if self.settings.motion_source == "ins":
            x, y = self.pose.x + dx, self.pose.y + dy
            predicted = Pose2(x, y, wrap_angle(self.pose.yaw + turn))
        else:
            predicted = self.pose.compose(now.relative_to(before))
        way_off, turn_off = self.settings.still
        way_off += self.settings.drift * math.hypot(dx, dy)
        turn_off += self.settings.drift * abs(turn)
        return predicted, np.array([way_off, way_off, turn_off])

    def _searched(self, points: Points) -> Pose2:
        """Find the pose with nothing to go by but how far a robot gets."""
        way, turn = self.settings.search_distance, self.settings.search_angle
        sigma = np.array([way, way, turn])
        turns = np.linspace(-turn, turn, 31)
        ways = np.array([-way, 0.0, way])
        around = [self.pose.compose(Pose2(w, 0.0, t)) for t in turns for w in ways]
        around.append(self.pose.compose(self._motion))
        starts = np.array([[pose.x, pose.y, pose.yaw] for pose in around])
        table = self._map.table
        best = around[best_start(table, points, starts)]
        tries = [fit(table, points, pose, pose, sigma) for pose in (best, around[-1])]
        return max(tries, key=lambda found: found[1])[0]

    def _is_to_be_kept(self) -> bool:
        moved = math.hypot(self.pose.x - self._kept.x, self.pose.y - self._kept.y)
        turned = abs(wrap_angle(self.pose.yaw - self._kept.yaw))
        far = (
            moved > self.settings.keyframe_distance
            or turned > self.settings.keyframe_angle
        )
        return far or self._count < FIRST_SCANS

    def _keep(self, places: Floats) -> None:
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        turn = np.array([[c, s], [-s, c]])
        self._map.add(places @ turn + (self.pose.x, self.pose.y))
        self._kept = self.pose
        self._count += 1
