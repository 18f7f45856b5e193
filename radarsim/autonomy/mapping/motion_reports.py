"""Reported motion at the times of scans, which may come more often than reports.

Scans between two reports of an INS or of odometry are taken while the robot moves on.
The motion between the last two reports is continued up to the time of the scan. What is
not known then is by how much the robot has changed its speed since.
"""

import math
from typing import NamedTuple

from radarsim.geometry import Pose2


class ReportedPose(NamedTuple):
    """A pose by the motion source.

    Attributes:
        pose: In the frame of the source.
        guessed: Time in s of the motion since the pose before that is no report's.
    """

    pose: Pose2
    guessed: float


class MotionReports:
    """The last two reports of a motion source."""

    def __init__(self) -> None:
        self._last: tuple[float, Pose2] | None = None  # s, and the pose
        self._before: tuple[float, Pose2] | None = None
        self._ahead = 0.0  # s; of the last pose that was told, after its report
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

    def at(self, time: float) -> ReportedPose | None:
        """Return the pose at the time of a scan; None before the first report.

        Args:
            time: Of the time stamp of the scan, s; times of scans increase.
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
            return ReportedPose(pose, guessed)
        # By a source that falls silent the robot does not go on for long.
        share = max(-1.0, min(ahead / interval, 1.0))
        motion = pose.relative_to(before)
        further = Pose2(share * motion.x, share * motion.y, share * motion.yaw)
        return ReportedPose(pose.compose(further), guessed)
