"""Observations from the reports of a server: scans with their echoes, and poses."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from radarsim.client import ScannerInfo, beam_angles
from radarsim.client.robot_info import same_name
from radarsim.geometry import Pose2
from radarsim.navigation.control import check_beams
from radarsim.navigation.echo_ranges import (
    EchoCollector,
    blocked_ranges,
    blocking_echoes,
)
from radarsim.navigation.observation import Observation, ScanClock, from_centre
from radarsim.navigation.options import PoseSource
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)

POSE_REPORTS: Final[dict[PoseSource, type[Report]]] = {
    PoseSource.INS: Ins,
    PoseSource.ODOMETRY: Odometry,
    PoseSource.GROUND_TRUTH: GroundTruth,
}


class ObservationBuilder:
    """Combines scans and poses to observations as their reports arrive.

    Attributes:
        missing: The report that it waits for, for messages.
    """

    def __init__(
        self,
        scanner: ScannerInfo,
        pose_source: PoseSource,
        clock: Callable[[], float],
        *,
        echo_wait: float = 0.0,
    ) -> None:
        """Create a builder.

        Args:
            scanner: The scanner to use.
            pose_source: The sensor that poses are taken from.
            clock: Returns the time in s; used where time stamps do not advance.
            echo_wait: How long scans without echoes are left out, since their echoes
                may still come, s; 0 if the server was not asked for echoes.
        """
        self._scanner = scanner
        self._pose_report = POSE_REPORTS[pose_source]
        self._scan_clock = ScanClock(clock)
        self._pose: Pose2 | None = None
        self._start: Pose2 | None = None
        self._others: set[PoseSource] = set()  # other sources that sent poses
        self._echoes = EchoCollector()
        self._echo_wait = echo_wait
        self._echoes_due = math.nan  # until when scans wait for their echoes, s
        self.missing = f"pose from {pose_source.value}"

    @property
    def cure(self) -> str:
        """The other sources of poses, if the wanted one has sent none."""
        names = [source.value for source in PoseSource if source in self._others]
        if self._pose is not None or not names:
            return ""
        return f"expected poses from {' or '.join(names)}"

    def take(self, report: Report) -> Observation | None:
        """Process a report; return the observation that it completes, if any.

        Raises:
            ClientError: If a scan has so few beams that some bumper may see nothing.
        """
        if isinstance(report, EchoLine):
            if same_name(report.name, self._scanner.name):
                self._echoes.take(report)
            return None
        if isinstance(report, RangeScan):
            if self._pose is None or not same_name(report.name, self._scanner.name):
                return None
            return self._observation(report, self._pose)
        self._update_pose(report)
        return None

    def _update_pose(self, report: Report) -> None:
        """Update the pose; odometry counts from the first pose of any other sensor."""
        pose: Pose2 | None = None
        if isinstance(report, Ins | GroundTruth):
            pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
            self._start = self._start or pose
        elif isinstance(report, Odometry) and self._start is not None:
            pose = self._start.compose(report.pose)
        if not isinstance(report, self._pose_report):
            self._others |= {s for s, t in POSE_REPORTS.items() if type(report) is t}
        elif pose is not None:
            self._pose = pose
            self.missing = f"scan of {self._scanner.name!r}"

    def _observation(self, report: RangeScan, pose: Pose2) -> Observation | None:
        scanner = self._scanner
        check_beams(len(report.ranges), scanner)
        time = self._scan_clock.time_of(report.time)
        echoes = self._echoes.of(report)
        if echoes is not None or math.isnan(self._echoes_due):
            self._echoes_due = time + self._echo_wait
        if echoes is None and time < self._echoes_due:
            return None
        angles, farther = beam_angles(report), np.zeros((0, 2))
        known = report.ranges
        if echoes is not None:
            beams, lengths = blocking_echoes(len(known), echoes)
            known = blocked_ranges(known, beams, lengths)
            behind = lengths > known[beams]
            beams, lengths = beams[behind], lengths[behind]
            farther = np.column_stack(
                from_centre(lengths, angles[beams], scanner.mount, math.inf)
            )
        bearings, ranges = from_centre(known, angles, scanner.mount, scanner.max_range)
        return Observation(time, pose, bearings, ranges, farther)
