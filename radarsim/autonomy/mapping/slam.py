"""SLAM: estimates the robot's pose by matching each scan with the previous scans.

Theory of operation
===================
The motion since the last scan, as reported by INS or odometry, predicts the pose; the
scan corrects it (``scan_matching``). An INS reports its motion on the axes of the map,
odometry on the axes of the robot. If scans arrive more often than reports, the motion
is extrapolated, and its sigma grows by the possible change of speed. Without INS and
odometry, poses around the last pose and the extrapolated pose are tried, and the best
is refined.

A scan becomes a keyframe, part of the map, when the robot has moved by 0.2 m or turned
by 0.1 rad since the last keyframe. The first scans also become keyframes while the
robot stands: they have the start pose and make the map dense. A place that is seen
again is matched with its first scans, unless the robot has been so far away in between
that its pose may have drifted. In that case a loop closure is searched
(``loop_closure``). It distributes the error over all poses since the first visit
(``pose_graph``), including the poses of earlier scans.

Navigators may use the poses of their scans from this module: stored scans can be
corrected when a loop closes, or when the map is rotated back to its start.
"""

import math
from typing import Final

import numpy as np

from radarsim.autonomy.mapping.loop_closure import (
    ANCHOR_INTERVAL,
    LEAST_TURN,
    MOST_ANCHORINGS,
    Keyframe,
    KeyframeMap,
    find_correction,
)
from radarsim.autonomy.mapping.pose_graph import KeyframeGraph
from radarsim.autonomy.mapping.scan import PlanarScan
from radarsim.autonomy.mapping.scan_matching import (
    Fit,
    ScanPoints,
    best_start,
    fit,
    inward_normals,
)
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.plans import MotionSource
from radarsim.geometry import Pose2, wrap_angle

FIRST_KEYFRAMES: Final = 10  # scans that are always keyframes
MIN_POINTS: Final = 3  # least number of points for a match
SPEED_CHANGE: Final = (0.3, 0.5)  # m/s and rad/s; change of speed between two reports
# standard deviation of an echo's position across its
# beam, m; N / 300 for a radar with side rays N units away
BEAM_SPREAD: Final = 0.08
# standard deviation of the yaw error of odometry per metre, rad/m: the wheels are half
# a metre apart, and their sizes differ by 0.75 %
WHEEL_DRIFT: Final = 0.015
KEYFRAME_STEP: Final = (0.2, 0.1)  # m and rad between keyframes
# largest motion between two scans, m and rad; used without a motion source
SEARCH: Final = (0.12, 0.45)


class MotionReports:
    """The last two reports of a motion source; computes poses at the times of scans.

    The robot keeps moving between two reports, so the motion between the last two
    reports is extrapolated to the time of a scan. The change of speed since then is
    unknown.
    """

    def __init__(self) -> None:
        self._last: tuple[float, Pose2] | None = None  # time, s, and pose
        self._before: tuple[float, Pose2] | None = None
        self._ahead = 0.0  # s from the report to the time of the returned pose
        self._is_new = False  # whether a report has arrived since then

    def add(self, time: float, pose: Pose2) -> None:
        """Add a report of the motion source.

        Args:
            time: Time stamp of the report, s; nan without a stamp.
            pose: Pose in the frame of the source.
        """
        # A speed cannot be computed from two reports with the same time.
        if self._last is None or time != self._last[0]:
            self._before = self._last
        self._last, self._is_new = (time, pose), True

    def at(self, time: float) -> tuple[Pose2, float] | None:
        """Return the source's pose at a scan's time; None before the first report.

        Args:
            time: Time stamp of the scan, s; times of scans increase.

        Returns:
            The pose in the frame of the source, and the extrapolated time, s, in the
            motion since the previously returned pose.
        """
        if self._last is None:
            return None
        last_time, pose = self._last
        before_time, before = self._before or self._last
        interval = last_time - before_time
        ahead = time - last_time
        # Without valid time stamps there is no time
        # difference. Comparisons with nan are false.
        if not (interval > 0 and math.isfinite(ahead)):
            ahead, interval = 0.0, math.inf
        guessed = abs(self._ahead) + abs(ahead) if self._is_new else ahead - self._ahead
        self._ahead, self._is_new = ahead, False
        if ahead == 0:
            return pose, guessed
        # If the source becomes silent, its motion
        # is extrapolated by at most one interval.
        share = max(-1.0, min(ahead / interval, 1.0))
        motion = pose.relative_to(before)
        further = Pose2(share * motion.x, share * motion.y, share * motion.yaw)
        return pose.compose(further), guessed


class Slam:
    """SLAM: matches scans with a point map to locate the robot, and extends the map.

    Attributes:
        motion_source: Source of the robot's motion between scans.
        map: The keyframes, and the local map of their points.
        start: Pose of the robot at its first scan, map frame; None for the first pose
            of the motion source, or the origin without a source.
        pose: Pose of the robot at the last scan.
        trajectory: The pose at the time of each scan.
        dead_reckoning: The pose by the motion source alone at the time of each scan.
        closures: Number of closed loops.
        revision: Number of changes of earlier poses, at each loop closure, and when the
            map is rotated back to its start.
    """

    def __init__(
        self,
        motion_source: MotionSource = "ins",
        start: Pose2 | None = None,
        *,
        drift: float = 0.1,
        rest_sigma: tuple[float, float] = (0.005, 0.001),
    ) -> None:
        """Create an empty map.

        Args:
            motion_source: Source of the robot's motion between scans.
            start: See the attribute.
            drift: Standard deviation of the reported motion, relative to its length and
                turn.
            rest_sigma: Standard deviations of the reported motion at rest, m and rad.
        """
        self.motion_source = motion_source
        self.map = KeyframeMap()
        self.start = start
        self.pose = start or Pose2(0.0, 0.0)
        self.trajectory = Trajectory()
        self.dead_reckoning = Trajectory()
        self.closures, self.revision = 0, 0
        self._drift, self._rest_sigma = drift, rest_sigma
        self._anchorings = 0
        self._graph = KeyframeGraph()
        self._prior: Pose2 | None = None
        self._motion = Pose2(0.0, 0.0)
        self._fit: Fit | None = None
        self._length = 0.0

    def step(
        self, scan: PlanarScan, prior: Pose2 | None = None, guessed: float = 0.0
    ) -> Pose2:
        """Estimate the pose of the robot at the time of a scan.

        Args:
            scan: The next scan.
            prior: Pose by the motion source, in its own frame; only its changes count.
                None without a report: then the pose is searched.
            guessed: Extrapolated time in the motion since the last scan, s.

        Returns:
            The robot's pose, map frame.
        """
        has_source = self.motion_source != "none"
        # Without a motion source all points are needed, even the ends
        # of beams whose power is used up. In foliage such points move
        # with the robot, so single points are not reliable.
        places, along = scan.points(sure=has_source)
        uses_spots = scan.sees_through and has_source
        normals = inward_normals(places, along)
        points = ScanPoints(places, along, normals, BEAM_SPREAD, uses_spots)
        last = self.pose
        if len(self.trajectory):
            self.pose = self._next_pose(points, prior, guessed)
        else:
            self.pose = last = self.start or prior or self.pose
        self._motion = self.pose.relative_to(last)
        self._length += math.hypot(self._motion.x, self._motion.y)
        if has_source:
            poses = self.dead_reckoning.poses
            reckoned = poses[-1] if poses else self.pose
            if poses and prior is not None and self._prior is not None:
                reckoned = self._moved(reckoned, self._prior, prior)
            self.dead_reckoning.add(scan.time, reckoned)
        self._prior = prior
        self.trajectory.add(scan.time, self.pose)
        # The first scans are always keyframes, since
        # only these have the exact start pose.
        is_keyframe = len(places) > 0 and self._is_keyframe()
        if is_keyframe:
            self.map.add(Keyframe(self.pose, points, self._length))
            self._graph.add(self.pose)
        # The keyframe is added first, so that the pose of its scan moves with it.
        self._graph.follow(self.pose)
        # This is the last step, since ``_move`` takes all
        # poses from the graph, including the newest one.
        if is_keyframe:
            self._close_loop()
            self._anchor()
        return self.pose

    def _close_loop(self) -> None:
        if self._fit is None:
            return
        closure = self.map.find_closure(self._fit)
        # The graph rejects a closure that contradicts earlier closures.
        closed = None if closure is None else self._graph.close(*closure)
        if closed is not None:
            self.closures += 1
            self._move(closed)

    def _next_pose(
        self, points: ScanPoints, prior: Pose2 | None, guessed: float
    ) -> Pose2:
        can_match = len(points.places) >= MIN_POINTS and len(self.map.keyframes) > 0
        has_source = self.motion_source != "none"
        # The motion between two scans needs a reported pose at each. Without these
        # poses, the pose is searched.
        if prior is None or self._prior is None or not has_source:
            return self._search(points) if can_match else self.pose
        # A reported motion has an error in proportion
        # to the motion, plus a small constant error.
        before, drift = self._prior, self._drift
        predicted = self._moved(self.pose, before, prior)
        length = math.hypot(prior.x - before.x, prior.y - before.y)
        sigma_distance, sigma_turn = self._rest_sigma
        sigma_distance += drift * length
        sigma_turn += drift * abs(wrap_angle(prior.yaw - before.yaw))
        # Wheels of different sizes turn a robot that should drive
        # straight, always to the same side. A smaller sigma would
        # bend the map. An INS does not have this error.
        if self.motion_source == "odometry":
            sigma_turn += WHEEL_DRIFT * length
        sigma_distance += guessed * SPEED_CHANGE[0]
        sigma_turn += guessed * SPEED_CHANGE[1]
        sigma = np.array([sigma_distance, sigma_distance, sigma_turn])
        if not can_match:
            # The scan gives no information, so the whole error of the motion remains.
            self._graph.learn(sigma, np.zeros((3, 3)))
            return predicted
        table = self.map.points.table
        self._fit = fit(table, points, predicted, predicted, sigma)
        self._graph.learn(sigma, self._fit.information)
        return self._fit.pose

    def _moved(self, pose: Pose2, before: Pose2, after: Pose2) -> Pose2:
        """Return a pose moved by the motion between two reported poses."""
        # Odometry measures motions along the axes of the robot. An INS knows its
        # heading, and measures motions along the axes of the map.
        if self.motion_source != "ins":
            return pose.compose(after.relative_to(before))
        x, y = pose.x + after.x - before.x, pose.y + after.y - before.y
        return Pose2(x, y, wrap_angle(pose.yaw + after.yaw - before.yaw))

    def _search(self, points: ScanPoints) -> Pose2:
        """Search for the robot's pose, within the largest motion between two scans."""
        distance, turn = SEARCH
        sigma = np.array([distance, distance, turn])
        candidates = [
            self.pose.compose(Pose2(step, 0.0, angle))
            for angle in np.linspace(-turn, turn, 31)
            for step in np.array([-distance, 0.0, distance])
        ]
        candidates.append(self.pose.compose(self._motion))
        starts = np.array([[pose.x, pose.y, pose.yaw] for pose in candidates])
        table = self.map.points.table
        best = candidates[best_start(table, points, starts)]
        # The best start may lead to a local optimum, so
        # the fit also starts at the extrapolated pose.
        fits = [
            fit(table, points, pose, pose, sigma) for pose in (best, candidates[-1])
        ]
        self._fit = max(fits, key=lambda each: each.score)
        self._graph.learn(sigma, self._fit.information)
        return self._fit.pose

    def _is_keyframe(self) -> bool:
        if len(self.map.keyframes) < FIRST_KEYFRAMES:
            return True
        return self.pose.is_apart(self.map.keyframes[-1].pose, *KEYFRAME_STEP)

    def _anchor(self) -> None:
        due = (self._anchorings + 1) * ANCHOR_INTERVAL
        if self._anchorings >= MOST_ANCHORINGS or self._length < due:
            return
        self._anchorings += 1
        # After a loop closure, the map is already aligned with its start.
        if self.closures or len(self.map.keyframes) <= FIRST_KEYFRAMES:
            return
        correction = find_correction(self.map, FIRST_KEYFRAMES)
        if correction is None:
            return
        # The first scans have an error themselves, so a smaller error is not corrected.
        if self._anchorings == 1 and abs(correction.yaw) < LEAST_TURN:
            self._anchorings = MOST_ANCHORINGS
            return
        self._move(self._graph.move(FIRST_KEYFRAMES, correction))

    def _move(self, poses: list[Pose2]) -> None:
        self.revision += 1
        self.map.move(poses)
        self.pose = poses[-1]
        # The trajectory object is kept, since stored
        # scans refer to poses by their numbers.
        self.trajectory.poses = self._graph.trajectory()
