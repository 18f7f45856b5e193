"""Observations for navigators: the robot's pose, and the ranges of a scan around it.

Ranges are measured from the robot's centre, about which it turns, so a turn on the spot
changes no distance. If the server sends echoes, they are ranges to the first obstacle
that blocks a robot.

Theory of operation
===================
The range of a radar beam is the distance where the beam ended, and thin foliage does
not end it: a bush of 1 m and density .7 absorbs less than the power of a beam. Robots
cannot pass the bush, and the echoes show where the beam entered it. So in each beam the
nearest echo of an obstacle counts, even if the obstacle is thin. Materials that robots
can pass, such as smoke, count only if a beam ends in them, since the space beyond is
unknown.

Echo lines arrive before the scan that they belong to. Servers without echo support send
none; then only ranges count.

Poses from SLAM are in the map frame, like all other poses and the goals. They may jump
when a loop closes: a controller that stores scans corrects their poses and restarts.
"""

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.mapping.scan import scan_of
from radarsim.autonomy.mapping.slam import MotionReports, Slam
from radarsim.autonomy.plans import PoseSource
from radarsim.client import ScannerInfo, beam_angles
from radarsim.client.robot_info import from_centre, same_name
from radarsim.client.robot_state import EchoCollector
from radarsim.errors import ClientError
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    TargetEchoes,
    Touch,
)

ECHO_WAIT: Final = 0.5  # s without echoes, after which only ranges are used
BEHIND: Final = 0.25  # m beyond a position; a longer beam passes the position
_BESIDE: Final = 0.3  # m from a position, within which beams belong to it
_LEAST_SPREAD: Final = math.radians(2.5)  # least angle from a position to such beams
_AIR: Final = "rain"  # an echo kind that blocks no robot
# A radar's side rays see the end of a wall next to the beam, and the error depends on
# the side. A scan match with few points contains this error. So where few points are
# seen, an INS is more accurate over a few metres.
INS_DRIFT: Final = 0.03  # share of the motion by which an INS drifts
INS_REST_SIGMA: Final = (0.0015, 0.0005)  # m and rad; noise at rest
JUMP: Final = (0.1, 0.03)  # m and rad; smaller corrections are no jumps
POSE_REPORTS: Final[dict[PoseSource, type[Report]]] = {
    PoseSource.INS: Ins,
    PoseSource.ODOMETRY: Odometry,
    PoseSource.GROUND_TRUTH: GroundTruth,
}


class ScanClock:
    """Returns the times of scans from their time stamps, or else from a clock.

    Some servers send no time stamps, or the same stamp again and again.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Create the clock of scans.

        Args:
            clock: Returns the time in s; measures the time that stamps leave out.
        """
        self._clock = clock
        self._stamp = math.nan
        self._last_read = math.nan
        self._offset = 0.0  # s that passed while the stamps stood still

    def time_of(self, stamp: float) -> float:
        """Return the time, s, of the next scan.

        Args:
            stamp: Time stamp of the scan, s; nan without a stamp.
        """
        now = self._clock()
        if math.isnan(self._stamp):
            self._stamp = stamp if math.isfinite(stamp) else now
        elif stamp > self._stamp:
            self._stamp = stamp
        else:
            self._offset += now - self._last_read
        self._last_read = now
        return self._stamp + self._offset


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A scan as seen from the robot's centre, together with the robot's pose.

    Attributes:
        time: Server time, s.
        pose: Estimated pose of the robot, map frame.
        bearings: (N,) rad, counter-clockwise from the robot's front, in [-pi, pi).
        ranges: (N,) m from the robot's centre; ``inf`` for beams without a return.
        farther: (M, 2) bearings, rad, and ranges, m, of further obstacles behind
            those of ``ranges``, seen through thin foliage.
        touched: Whether a touch sensor was pressed since the previous scan.
    """

    time: float
    pose: Pose2
    bearings: Floats
    ranges: Floats
    farther: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    touched: bool = False

    def points(self) -> Floats:
        """Return the end points, (M, 2) m, map frame, of beams with a return."""
        returned = np.isfinite(self.ranges)
        return self._points(self.bearings[returned], self.ranges[returned])

    def blocking_points(self) -> Floats:
        """Return the points, (M, 2) m, map frame, of ``points()`` and ``farther``."""
        return np.vstack([self.points(), self._points(*self.farther.T)])

    def offsets(self, beams: NDArray[np.generic]) -> NDArray[np.complex128]:
        """Return beam ends, (M,) m, as x + iy from the robot along the map's axes."""
        angles = self.bearings[beams] + self.pose.yaw
        offsets: NDArray[np.complex128] = self.ranges[beams] * np.exp(1j * angles)
        return offsets

    def looks_through(self, points: NDArray[np.complex128]) -> NDArray[np.bool_]:
        """Return which positions, (N,), beams have passed through without ending there.

        Beams next to a position count as well: a pole may be between two beams, and a
        radar with side rays sees the pole up to 0.2 m off its position. The result is
        False for positions without any beam.

        Args:
            points: (N,) m, map frame, x + iy.
        """
        offsets = points - complex(self.pose.x, self.pose.y)
        distances = np.abs(offsets)
        bearings = np.angle(offsets) - self.pose.yaw
        spread = np.maximum(np.arctan2(_BESIDE, distances), _LEAST_SPREAD)
        turns = np.abs(wrap_angles(bearings[:, None] - self.bearings))
        is_beside = turns <= spread[:, None]
        goes_on = self.ranges > (distances + BEHIND)[:, None]
        return np.asarray((goes_on | ~is_beside).all(axis=1) & is_beside.any(axis=1))

    def _points(self, bearings: Floats, ranges: Floats) -> Floats:
        angles = bearings + self.pose.yaw
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        points: Floats = directions * ranges[:, None]
        points += self.pose.x, self.pose.y
        return points


def wrap_angles(angles: Floats) -> Floats:
    """Wrap angles to [-pi, pi), rad."""
    # ``numpy.remainder`` takes three times as long.
    turns = np.floor((angles + math.pi) / (2 * math.pi))
    wrapped: Floats = angles - 2 * math.pi * turns
    return wrapped


def check_beams(count: int, scanner: ScannerInfo) -> None:
    """Raise an error for a scan with so few beams that a bumper may have none.

    Args:
        count: Number of beams of the scan.
        scanner: The scanner that sent the scan.

    Raises:
        ClientError: If fewer than half of the announced beams came.
    """
    if count < scanner.beams / 2:
        text = f"scan of {count} ranges from {scanner.name[:80]!r}"
        raise ClientError(f"{text}, expected {scanner.beams}")


def blocking_echoes(
    beam_count: int, echoes: Sequence[TargetEchoes]
) -> tuple[NDArray[np.int64], Floats]:
    """Return the echoes of all obstacles that block robots.

    Args:
        beam_count: Number of beams of the scan; other beam numbers are ignored.
        echoes: Echoes of the scan.

    Returns:
        Beam numbers and ranges in m, (M,) each.
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


class ScanReader(ABC):
    """Base class of readers that turn the reports of one scanner into observations.

    Attributes:
        scanner: The scanner.
        missing: The report that the reader waits for, for messages.
    """

    missing: str

    def __init__(
        self, scanner: ScannerInfo, clock: Callable[[], float], echo_wait: float
    ) -> None:
        """Create a reader of reports.

        Args:
            scanner: The scanner to use.
            clock: Returns the time in s; used if time stamps do not advance.
            echo_wait: Time for which scans without echoes are dropped, since their
                echoes may still arrive, s; 0 if no echoes were requested.
        """
        self.scanner = scanner
        self._scan_clock = ScanClock(clock)
        self._echoes = EchoCollector()
        self._echo_wait = echo_wait
        self._echoes_due = math.nan  # s; end of the wait for echoes

    @property
    @abstractmethod
    def hint(self) -> str:
        """Hint for error messages: what to use if a report is missing; may be empty."""

    def take(self, report: Report) -> Observation | None:
        """Process a report; return the observation that it completes, if any."""
        if not isinstance(report, EchoLine | RangeScan):
            self._take_other(report)
        elif same_name(report.name, self.scanner.name):
            if isinstance(report, RangeScan):
                return self._take_scan(report)
            self._echoes.take(report)
        return None

    @abstractmethod
    def _take_scan(self, report: RangeScan) -> Observation | None: ...

    @abstractmethod
    def _take_other(self, report: Report) -> None: ...

    def _time_and_echoes(
        self, report: RangeScan
    ) -> tuple[float, Sequence[TargetEchoes] | None, bool]:
        """Return the time, s, and the echoes of a scan, and whether echoes are missing.

        Once a server has sent echoes, a scan without echoes has lost them.
        """
        time, echoes = self._scan_clock.time_of(report.time), self._echoes.of(report)
        # The time limit for echoes starts at the
        # first scan, even if the scan has no echoes.
        if echoes is not None or math.isnan(self._echoes_due):
            self._echoes_due = time + self._echo_wait
        return time, echoes, echoes is None and time < self._echoes_due


class ObservationBuilder(ScanReader):
    """Combines scans and poses of a robot into observations."""

    def __init__(
        self,
        scanner: ScannerInfo,
        pose_source: PoseSource,
        clock: Callable[[], float],
        *,
        echo_wait: float = 0.0,
    ) -> None:
        """Create a builder of observations.

        Args:
            scanner: The scanner to use.
            pose_source: The source of the poses.
            clock: Returns the time in s; used if time stamps do not advance.
            echo_wait: Time for which scans without echoes are dropped, s.
        """
        super().__init__(scanner, clock, echo_wait)
        self._slam: Slam | None = None
        if pose_source is PoseSource.SLAM:
            self._slam = Slam(drift=INS_DRIFT, rest_sigma=INS_REST_SIGMA)
            pose_source = PoseSource.INS  # SLAM needs the motion between scans
        self._motion = MotionReports()
        self._has_jumped = False
        self._pose_report = POSE_REPORTS[pose_source]
        self._pose: Pose2 | None = None
        self._start: Pose2 | None = None
        self._others: set[PoseSource] = set()  # other sources that sent poses
        self._pressed: dict[str, bool] = {}  # state of each touch sensor, by name
        self._touched = False  # whether a touch sensor was pressed since the last scan
        self.missing = f"pose from {pose_source.value}"

    @property
    def hint(self) -> str:
        """Hint that names other sources of poses, if the requested source sent none."""
        names = [source.value for source in PoseSource if source in self._others]
        if self._pose is not None or not names:
            return ""
        return f"set the pose source to {' or '.join(names)}"

    def _take_other(self, report: Report) -> None:
        if isinstance(report, Touch):
            self._pressed[report.name] = report.touched
            self._touched |= report.touched
        else:
            self._update_pose(report)

    def pop_jump(self) -> bool:
        """Return whether poses of earlier scans have changed since the last call."""
        has_jumped, self._has_jumped = self._has_jumped, False
        return has_jumped

    def corrected(self, observation: Observation) -> Observation:
        """Return an earlier scan with the newest estimate of its pose."""
        if self._slam is None:
            return observation
        trajectory = self._slam.trajectory
        number = max(bisect_right(trajectory.times, observation.time) - 1, 0)
        return replace(observation, pose=trajectory.poses[number])

    def _update_pose(self, report: Report) -> None:
        """Update the pose; odometry is relative to the first pose of another sensor."""
        pose: Pose2 | None = None
        if isinstance(report, Ins | GroundTruth):
            pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
            self._start = self._start or pose
            if isinstance(report, Ins):
                self._motion.add(report.time, pose)
        elif isinstance(report, Odometry) and self._start is not None:
            pose = self._start.compose(report.pose)
        # If the requested poses are missing, a message proposes these other sources.
        if not isinstance(report, self._pose_report):
            self._others |= {s for s, t in POSE_REPORTS.items() if type(report) is t}
        elif pose is not None:
            self._pose = pose
            self.missing = f"scan of {self.scanner.name!r}"

    def _take_scan(self, report: RangeScan) -> Observation | None:
        scanner, pose = self.scanner, self._pose
        if pose is None:
            return None
        check_beams(len(report.ranges), scanner)
        time, echoes, lacks_echoes = self._time_and_echoes(report)
        # SLAM also needs scans without echoes, since
        # it matches the next scan with these scans.
        if self._slam is not None:
            pose = self._locate(self._slam, report, echoes, time)
        # In a scan without echoes, thin foliage would
        # look like a gap that the robot can pass.
        if lacks_echoes:
            return None
        angles, farther = beam_angles(report), np.zeros((0, 2))
        known = np.array(report.ranges, np.float64)
        if echoes is not None:
            # Each beam ends at its nearest echo of an obstacle, or else at its range.
            beams, lengths = blocking_echoes(len(known), echoes)
            np.minimum.at(known, beams, lengths)
            # Farther echoes are stored separately:
            # planners use them, and bumpers do not.
            behind = lengths > known[beams]
            beams, lengths = beams[behind], lengths[behind]
            farther = np.column_stack(
                from_centre(lengths, angles[beams], scanner.mount, math.inf)
            )
        bearings, ranges = from_centre(known, angles, scanner.mount, scanner.max_range)
        # Touch sensors report less often than scanners, so their last state is kept.
        touched, self._touched = self._touched, any(self._pressed.values())
        return Observation(time, pose, bearings, ranges, farther, touched)

    def _locate(
        self,
        slam: Slam,
        report: RangeScan,
        echoes: Sequence[TargetEchoes] | None,
        time: float,
    ) -> Pose2:
        """Return the pose at a scan by SLAM; note whether it changes earlier poses."""
        scan = scan_of(self.scanner, replace(report, time=time), echoes)
        last, revision = slam.pose, slam.revision
        pose = slam.step(scan, *(self._motion.at(report.time) or ()))
        if slam.revision > revision:
            # Only a correction changes the pose of the previous scan, so a change of
            # that pose shows a correction.
            self._has_jumped |= slam.trajectory.poses[-2].is_apart(last, *JUMP)
        return pose
