"""SLAM: estimates the robot's pose by matching each scan with the scans before.

Theory of operation
===================
The motion since the last scan, as INS or odometry reports it, predicts the pose; the
scan corrects it (``scan_matching``). An INS reports its motion on the axes of the map,
odometry on those of the robot. Where scans come more often than reports, the motion
goes on as it was, and its sigma grows by what the speed may have changed meanwhile.
With neither, poses all around the last one and the pose that its motion leads to are
tried, and the best of them is corrected.

A scan becomes a keyframe, part of the map, when the robot has moved by a hand's breadth
since the last keyframe; so do the first scans while it stands, which have the start's
pose and make the map dense. A place that is seen again is matched against what was seen
first, unless the robot has been so far away in between that its pose may have drifted.
Then the loop is looked for (``loop_closure``), and when it closes, the error is spread
over all poses since (``pose_graph``), also those of earlier scans.

Navigators may take the poses of their scans from here: what they have kept by them can
be corrected when a loop closes, or the map is turned back to its start.
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

FIRST_KEYFRAMES: Final = 10  # scans that are keyframes wherever the robot is
MIN_POINTS: Final = 3  # points that are worth matching
SPEED_CHANGE: Final = (0.3, 0.5)  # m/s and rad/s, of a robot between two reports
# m; standard deviation of where across its beam an echo comes from: N / 300 for a radar
# with side rays N units away
BEAM_SPREAD: Final = 0.08
# rad/m; standard deviation of the turn that odometry does not measure: wheels half a
# metre apart whose sizes differ by 0.75 %
WHEEL_DRIFT: Final = 0.015
KEYFRAME_STEP: Final = (0.2, 0.1)  # m and rad between keyframes
# m and rad that a robot gets between two scans, where no source reports its motion
SEARCH: Final = (0.12, 0.45)


class MotionReports:
    """The last two reports of a motion source, and the motion at the times of scans.

    Scans between two reports are taken while the robot moves on: the motion between the
    last two reports is continued up to the time of the scan. By how much the robot has
    changed its speed since is unknown.
    """

    def __init__(self) -> None:
        self._last: tuple[float, Pose2] | None = None  # s, and the pose
        self._before: tuple[float, Pose2] | None = None
        self._ahead = 0.0  # s; of the last pose that was returned, after its report
        self._is_new = False  # whether a report has come since

    def add(self, time: float, pose: Pose2) -> None:
        """Add a report.

        Args:
            time: Of its time stamp, s; nan if it has none.
            pose: In the frame of the source.
        """
        # Two reports of one time tell no speed.
        if self._last is None or time != self._last[0]:
            self._before = self._last
        self._last, self._is_new = (time, pose), True

    def at(self, time: float) -> tuple[Pose2, float] | None:
        """Return the pose at the time of a scan; None before the first report.

        Args:
            time: Of the time stamp of the scan, s; times of scans increase.

        Returns:
            The pose in the frame of the source, and the time, s, of the motion since
            the pose before that was continued and not reported.
        """
        if self._last is None:
            return None
        last_time, pose = self._last
        before_time, before = self._before or self._last
        interval = last_time - before_time
        ahead = time - last_time
        # Stamps that are missing, or do not advance, tell nothing; nan compares false.
        if not (interval > 0 and math.isfinite(ahead)):
            ahead, interval = 0.0, math.inf
        guessed = abs(self._ahead) + abs(ahead) if self._is_new else ahead - self._ahead
        self._ahead, self._is_new = ahead, False
        if ahead == 0:
            return pose, guessed
        # By a source that falls silent the robot does not go on for long.
        share = max(-1.0, min(ahead / interval, 1.0))
        motion = pose.relative_to(before)
        further = Pose2(share * motion.x, share * motion.y, share * motion.yaw)
        return pose.compose(further), guessed


class Slam:
    """Localisation, and the map of points that it needs.

    Attributes:
        motion_source: Where the robot's motion between scans is read from.
        map: The keyframes, and the local map that is made of them.
        start: Pose of the robot at its first scan, map frame; None for the first pose
            of the motion source, or the origin if there is none.
        pose: Pose of the robot at the last scan.
        trajectory: The pose at the time of each scan.
        dead_reckoning: The same by the motion source alone, which never sees a scan.
        closures: Number of loops closed.
        revision: How often the poses before changed, too: at each loop, and when the
            map was turned back to its start.
    """

    def __init__(
        self,
        motion_source: MotionSource = "ins",
        start: Pose2 | None = None,
        *,
        drift: float = 0.1,
        rest_sigma: tuple[float, float] = (0.005, 0.001),
    ) -> None:
        """Begin without scans.

        Args:
            motion_source: Where the robot's motion between scans is read from.
            start: See the attribute.
            drift: Standard deviation of the reported motion as a share of its length
                and turn.
            rest_sigma: Standard deviations of that of a robot at rest, m and rad.
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
        """Estimate where the robot was when it took a scan.

        Args:
            scan: The next scan.
            prior: Pose by the motion source, in its own frame; only its changes count.
                None if it reported nothing: the pose is searched.
            guessed: Time of the motion since the last scan that it did not report, but
                that was continued, s.

        Returns:
            The robot's pose, map frame.
        """
        has_source = self.motion_source != "none"
        # Without a motion source every point is needed, also those where power ran out.
        # They move with the robot in foliage, so that no spot can be relied on then.
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
        # The first scans count wherever the robot is: they alone have the start's pose.
        is_keyframe = len(places) > 0 and self._is_keyframe()
        if is_keyframe:
            self.map.add(Keyframe(self.pose, points, self._length))
            self._graph.add(self.pose)
        # After the keyframe: the pose of its own scan moves with it as well.
        self._graph.follow(self.pose)
        # Last of all, as ``_move`` takes all poses from the graph, this one too.
        if is_keyframe:
            self._close_loop()
            self._anchor()
        return self.pose

    def _close_loop(self) -> None:
        if self._fit is None:
            return
        closure = self.map.find_closure(self._fit)
        # the graph refuses a closure that contradicts those before
        closed = None if closure is None else self._graph.close(*closure)
        if closed is not None:
            self.closures += 1
            self._move(closed)

    def _next_pose(
        self, points: ScanPoints, prior: Pose2 | None, guessed: float
    ) -> Pose2:
        can_match = len(points.places) >= MIN_POINTS and len(self.map.keyframes) > 0
        has_source = self.motion_source != "none"
        # A motion needs the poses of two scans; without it the pose is searched for.
        if prior is None or self._prior is None or not has_source:
            return self._search(points) if can_match else self.pose
        # Reports are off by a share of the motion, and a little at rest.
        before, drift = self._prior, self._drift
        predicted = self._moved(self.pose, before, prior)
        length = math.hypot(prior.x - before.x, prior.y - before.y)
        sigma_distance, sigma_turn = self._rest_sigma
        sigma_distance += drift * length
        sigma_turn += drift * abs(wrap_angle(prior.yaw - before.yaw))
        # Wheels of two sizes turn a robot that drives straight on, always to the same
        # side: a surer prior bends the map. An INS does not know of wheels.
        if self.motion_source == "odometry":
            sigma_turn += WHEEL_DRIFT * length
        sigma_distance += guessed * SPEED_CHANGE[0]
        sigma_turn += guessed * SPEED_CHANGE[1]
        sigma = np.array([sigma_distance, sigma_distance, sigma_turn])
        if not can_match:
            # The scan shows nothing, so the whole error of the motion is left.
            self._graph.learn(sigma, np.zeros((3, 3)))
            return predicted
        table = self.map.points.table
        self._fit = fit(table, points, predicted, predicted, sigma)
        self._graph.learn(sigma, self._fit.information)
        return self._fit.pose

    def _moved(self, pose: Pose2, before: Pose2, after: Pose2) -> Pose2:
        """Return a pose after the motion from one reported pose to another."""
        # Odometry measures on the axes of the robot; an INS has a heading of its own,
        # and reports motions on the axes of the map.
        if self.motion_source != "ins":
            return pose.compose(after.relative_to(before))
        x, y = pose.x + after.x - before.x, pose.y + after.y - before.y
        return Pose2(x, y, wrap_angle(pose.yaw + after.yaw - before.yaw))

    def _search(self, points: ScanPoints) -> Pose2:
        """Find the pose, knowing only how far a robot gets between scans."""
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
        # The best start of a sample can lead to a local optimum; unchanged motion is
        # tried too.
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
        # A loop has tied the map to its start already.
        if self.closures or len(self.map.keyframes) <= FIRST_KEYFRAMES:
            return
        correction = find_correction(self.map, FIRST_KEYFRAMES)
        if correction is None:
            return
        # Off by less than the first scans can tell: it stays where it is, for good.
        if self._anchorings == 1 and abs(correction.yaw) < LEAST_TURN:
            self._anchorings = MOST_ANCHORINGS
            return
        self._move(self._graph.move(FIRST_KEYFRAMES, correction))

    def _move(self, poses: list[Pose2]) -> None:
        self.revision += 1
        self.map.move(poses)
        self.pose = poses[-1]
        # The trajectory itself stays: stored scans know their poses by it and a number.
        self.trajectory.poses = self._graph.trajectory()
