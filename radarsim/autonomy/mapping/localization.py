"""Localization: where a robot is at each scan, for what needs no map but the pose.

The scans are matched with those before (``slam``); the motion in between is that of an
INS. When a loop closes, or the map is turned back to its start, poses of earlier scans
change as well: what was kept by them can be corrected.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from radarsim.autonomy.mapping.scan import scan_of
from radarsim.autonomy.mapping.slam import MotionReports, Slam
from radarsim.client import ScannerInfo
from radarsim.geometry import Pose2
from radarsim.protocol.reports import Ins, RangeScan, TargetEchoes

# Side beams of a radar show the end of a wall beside it, from each side another way:
# what a few points say together is off by that, and where there is little to see an INS
# is better over some metres.
DRIFT: Final = 0.03  # share of the motion
REST_SIGMA: Final = (0.0015, 0.0005)  # m and rad
JUMP: Final = (0.1, 0.03)  # m and rad; what was kept by less still fits what is seen


class Localizer:
    """Finds the pose of each scan of one scanner.

    Attributes:
        slam: Holds the poses, and the points that scans are matched with.
    """

    def __init__(self, scanner: ScannerInfo) -> None:
        """Begin where the INS says first.

        Args:
            scanner: The scanner.
        """
        self.slam = Slam(drift=DRIFT, rest_sigma=REST_SIGMA)
        self._scanner = scanner
        self._motion = MotionReports()
        self._has_jumped = False

    def add_motion(self, report: Ins) -> None:
        """Add a report of the INS."""
        pose = report.pose
        self._motion.add(report.time, Pose2(pose.x, pose.y, pose.yaw))

    def locate(
        self, report: RangeScan, echoes: Sequence[TargetEchoes] | None, time: float
    ) -> Pose2:
        """Return the robot's pose at a scan, map frame.

        Args:
            report: The scan; at least one report of the INS came before.
            echoes: Those of the scan; None if none came.
            time: When it was taken, s; the times of scans increase.
        """
        scan = scan_of(self._scanner, replace(report, time=time), echoes)
        slam, motion = self.slam, self._motion.at(report.time)
        last, revision = slam.pose, slam.revision
        pose = slam.step(scan, *(motion or ()))
        if slam.revision > revision:
            # the scan before, whose pose has moved by the correction alone
            self._has_jumped |= slam.trajectory.poses[-2].is_apart(last, *JUMP)
        return pose

    def pop_jump(self) -> bool:
        """Return whether poses have jumped since this was asked before."""
        has_jumped, self._has_jumped = self._has_jumped, False
        return has_jumped

    def pose_at(self, time: float) -> Pose2:
        """Return the pose of an earlier scan by all that is known now, map frame.

        Args:
            time: When it was taken, s.
        """
        trajectory = self.slam.trajectory
        return trajectory.poses[max(bisect_right(trajectory.times, time) - 1, 0)]
