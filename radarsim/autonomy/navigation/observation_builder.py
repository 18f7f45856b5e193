"""Observations from the reports of a server: scans with their echoes, and poses.

Ranges to drive by: where echoes tell it, to the first thing that blocks a robot.

Theory of operation
===================
The range of a radar beam says where it ended, and thin foliage does not end it: a bush
of 1 m and density .7 takes less than the power that a beam has. Its echoes still tell
where it entered the bush, and that robots do not pass. So of every beam the nearest
echo of what robots cannot pass counts, however thin that is. What robots pass, such as
smoke, counts where a beam ends in it, since nothing beyond has been seen.

Echo lines come before the scan that they belong to. Servers that know no echoes send
none; then ranges alone count.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.control import check_beams
from radarsim.autonomy.navigation.observation import Observation, ScanClock, from_centre
from radarsim.autonomy.navigation.options import PoseSource
from radarsim.client import ScannerInfo, beam_angles
from radarsim.client.robot_info import same_name
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    TargetEchoes,
)

ECHO_WAIT: Final = 0.5  # s without echoes after which ranges alone count
_AIR: Final = "rain"  # a kind of echo of nothing that blocks


class EchoCollector:
    """Collects the echo lines of one scan, which arrive before it."""

    def __init__(self) -> None:
        self._time = math.nan
        self._lines: dict[int, TargetEchoes] = {}
        self._line_count = -1

    def take(self, line: EchoLine) -> None:
        """Add a line; a line of another time starts anew."""
        if not _is_same_time(line.time, self._time):
            self._time, self._lines = line.time, {}
        self._line_count = line.lines
        if line.echoes is not None and 0 < line.line <= line.lines:
            self._lines[line.line] = line.echoes

    def of(self, scan: RangeScan) -> Sequence[TargetEchoes] | None:
        """Return all echoes of a scan; None if any line is missing."""
        is_complete = len(self._lines) == self._line_count
        if not is_complete or not _is_same_time(scan.time, self._time):
            return None
        echoes, self._lines, self._line_count = list(self._lines.values()), {}, -1
        return echoes


def _is_same_time(one: float, other: float) -> bool:
    """Compare time stamps; some servers send none, which are nan."""
    return one == other or (math.isnan(one) and math.isnan(other))


def blocked_ranges(ranges: Floats, beams: NDArray[np.int64], lengths: Floats) -> Floats:
    """Return how far a robot could go along each beam, as far as is known.

    Args:
        ranges: (N,) m; ranges of the scan.
        beams: (M,) beams of the blocking echoes of the same scan.
        lengths: (M,) m; their ranges.

    Returns:
        (N,) m; the nearest echo of what robots cannot pass, at most the range.
    """
    nearest = np.array(ranges, np.float64)
    np.minimum.at(nearest, beams, lengths)
    return nearest


def blocking_echoes(
    beam_count: int, echoes: Sequence[TargetEchoes]
) -> tuple[NDArray[np.int64], Floats]:
    """Return the echoes of what robots cannot pass, near and far.

    Args:
        beam_count: Number of beams of the scan; echoes of no beam are left out.
        echoes: Echoes of the scan.

    Returns:
        Beams and ranges in m, (M,) each.
    """
    beams, lengths = [np.zeros(0, np.int64)], [np.zeros(0)]
    for target in echoes:
        if target.robot_passes:
            continue
        counts = (target.beams >= 0) & (target.beams < beam_count)
        counts &= target.ranges >= 0  # nan compares false
        if _AIR in target.kinds:
            counts &= np.array([kind != _AIR for kind in target.kinds], np.bool_)
        beams.append(target.beams[counts])
        lengths.append(target.ranges[counts])
    return np.concatenate(beams), np.concatenate(lengths)


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
