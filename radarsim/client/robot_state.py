"""Collects the state of a robot, and the echoes of its scans, from its reports."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    Status,
    TargetEchoes,
    Touch,
)

MOTION_WINDOW: Final = 0.5  # s; interval over which speeds are measured
# Classes of reports that contain a pose of the robot, the most accurate first.
POSES: Final[tuple[type[Report], ...]] = GroundTruth, Ins, Odometry


class RobotState:
    """The newest state of one robot, such as its pose and battery, from reports.

    Attributes:
        time: Time of the newest report, s; nan before the first.
        poses: Newest pose by type of report.
        z: Height of the body frame's origin from the best pose sensor, m.
        touched: Whether each touch sensor is pressed, by the name of the sensor.
        battery: Remaining time of the battery, s; None if unknown.
    """

    def __init__(self) -> None:
        self.time = math.nan
        self.poses: dict[type[Report], Pose2] = {}
        self.z = 0.0
        self.touched: dict[str, bool] = {}
        self.battery: int | None = None
        self._track: deque[tuple[float, Pose2]] = deque()

    @property
    def pose(self) -> Pose2 | None:
        """Newest pose from the robot's best pose sensor; None before the first pose."""
        source = self._best_source()
        return None if source is None else self.poses[source]

    def take(self, report: Report) -> bool:
        """Update the state by a report; return False if the report has no effect."""
        match report:
            case GroundTruth() | Ins() | Odometry():
                self._take_pose(report)
            case Touch(name=name, touched=touched):
                self.touched[name] = touched
            case Status(battery=battery):
                self.battery = battery
            case RangeScan():
                pass
            case _:
                return False
        if not math.isnan(report.time):
            self.time = report.time
        return True

    def motion(self) -> tuple[float, float] | None:
        """Return the robot's motion, computed from poses of its best pose sensor.

        Returns:
            Forward speed, m/s, and yaw rate, rad/s counter-clockwise; None before the
            second pose.
        """
        if len(self._track) < 2:
            return None
        (start, before), (end, after) = self._track[0], self._track[-1]
        elapsed, turned = end - start, wrap_angle(after.yaw - before.yaw)
        # On an arc, the chord between two poses has the mean of their headings.
        yaw = before.yaw + turned / 2
        ahead = math.cos(yaw) * (after.x - before.x)
        ahead += math.sin(yaw) * (after.y - before.y)
        return ahead / elapsed, turned / elapsed

    def _best_source(self) -> type[Report] | None:
        return next((kind for kind in POSES if kind in self.poses), None)

    def _take_pose(self, report: GroundTruth | Ins | Odometry) -> None:
        kind, track, previous = type(report), self._track, self._best_source()
        pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
        self.poses[kind] = pose
        if kind is not self._best_source():
            return
        if isinstance(report.pose, Pose3):
            self.z = report.pose.z
        # The track starts again if the sensor changes, because sensors have different
        # errors, or if time goes back, after a reset of the clock or a new robot.
        if kind is not previous or (track and not report.time > track[-1][0]):
            track.clear()
        track.append((report.time, pose))
        while report.time - track[0][0] > MOTION_WINDOW:
            track.popleft()


class EchoCollector:
    """Collects the echo lines of a scan, which arrive before the scan."""

    def __init__(self) -> None:
        self._time = math.nan
        self._lines: dict[int, TargetEchoes] = {}
        self._line_count = -1

    def take(self, line: EchoLine) -> None:
        """Add an echo line; a line with a new time stamp discards earlier lines."""
        # A server may drop lines on a slow connection, so the number of the last line
        # cannot mark the end of a scan.
        if not _is_same_time(line.time, self._time):
            self._time, self._lines = line.time, {}
        self._line_count = line.lines
        if line.echoes is not None and 0 < line.line <= line.lines:
            self._lines[line.line] = line.echoes

    def of(self, scan: RangeScan) -> Sequence[TargetEchoes] | None:
        """Return the echoes of a scan, an entry per line; None if a line is missing."""
        is_complete = len(self._lines) == self._line_count
        if not is_complete or not _is_same_time(scan.time, self._time):
            return None
        echoes, self._lines, self._line_count = list(self._lines.values()), {}, -1
        return echoes


def _is_same_time(one: float, other: float) -> bool:
    """Compare two time stamps; missing time stamps, which are NaN, count as equal."""
    return one == other or (math.isnan(one) and math.isnan(other))
