"""The newest state of a robot, by its reports."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from radarsim.client.robot_info import (
    RobotInfo,
    ScannerInfo,
    beam_angles,
    from_centre,
    same_name,
)
from radarsim.geometry import Floats, Pose2, Pose3, wrap_angle
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    Status,
    Touch,
)

RATE_SCANS: Final = 11  # scans that the scan rate is measured over
MOTION_WINDOW: Final = 0.5  # s that the speed is measured over
POSES: Final[tuple[type[GroundTruth | Ins | Odometry], ...]] = (
    GroundTruth,
    Ins,
    Odometry,
)


@dataclass(slots=True)
class RobotState:
    """The newest report of each kind from one robot.

    Attributes:
        robot_info: Properties of the robot.
        scanner: The scanner that is displayed.
        level: Name of the map.
        time: Server time, s; nan before the first report.
        poses: Newest pose by type of report.
        touched: Whether each touch sensor is pressed, by its name.
        battery: Remaining time of the battery, s; None if unknown.
        scan: The newest scan; None before the first.
    """

    robot_info: RobotInfo
    scanner: ScannerInfo
    level: str
    time: float = math.nan
    poses: dict[type, Pose2] = field(default_factory=dict)
    touched: dict[str, bool] = field(default_factory=dict)
    battery: int | None = None
    scan: RangeScan | None = None
    _scan_times: deque[float] = field(default_factory=lambda: deque(maxlen=RATE_SCANS))
    _track: deque[tuple[float, Pose2]] = field(default_factory=deque)

    def take(self, report: Report) -> None:
        """Process a report; most kinds are ignored."""
        match report:
            case GroundTruth() | Ins() | Odometry():
                self._update_pose(report)
            case Touch(name=name, touched=touched):
                self.touched[name] = touched
            case Status(battery=battery):
                self.battery = battery
            case RangeScan(name=name) if same_name(name, self.scanner.name):
                self.scan = report
                self._scan_times.append(report.time)
            case _:
                return
        self.time = report.time

    def points(self) -> Floats:
        """Return the end points of the newest scan.

        Returns:
            (N, 2) m from the robot's centre, x ahead and y to its left.
        """
        if self.scan is None:
            return np.zeros((0, 2))
        seen = self.scan.ranges > 0  # a blinded scanner reads 0
        bearings, ranges = from_centre(
            self.scan.ranges[seen],
            beam_angles(self.scan)[seen],
            self.scanner.mount,
            self.scanner.max_range,
        )
        ended = np.isfinite(ranges)
        bearings, ranges = bearings[ended], ranges[ended]
        return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])

    def is_blind(self) -> bool:
        """Return whether no beam of the newest scan reads more than 0."""
        return self.scan is not None and not (self.scan.ranges > 0).any()

    def scan_rate(self) -> float:
        """Return scans per second of server time; nan before the second scan."""
        times = self._scan_times
        spent = times[-1] - times[0] if times else 0.0
        return (len(times) - 1) / spent if spent > 0 else math.nan

    def motion(self) -> tuple[float, float] | None:
        """Return the measured motion of the robot, by its best pose sensor.

        Returns:
            Speed ahead, m/s, and turn, rad/s counter-clockwise; None before the
            second pose.
        """
        if len(self._track) < 2:
            return None
        (start, before), (end, after) = self._track[0], self._track[-1]
        spent = end - start
        yaw = before.yaw + wrap_angle(after.yaw - before.yaw) / 2
        direction = (after.x - before.x) * math.cos(yaw) + (
            after.y - before.y
        ) * math.sin(yaw)
        return direction / spent, wrap_angle(after.yaw - before.yaw) / spent

    def _update_pose(self, report: GroundTruth | Ins | Odometry) -> None:
        kind, pose, track = type(report), _pose2(report.pose), self._track
        if kind is not self._best_source():
            self.poses[kind] = pose
            if kind is not self._best_source():
                return
            track.clear()  # it held poses of another sensor
        self.poses[kind] = pose
        if track and not report.time > track[-1][0]:
            track.clear()  # another robot, or a clock that was reset
        track.append((report.time, pose))
        while report.time - track[0][0] > MOTION_WINDOW:
            track.popleft()

    def _best_source(self) -> type | None:
        """Return the best type of pose report received so far."""
        return next((kind for kind in POSES if kind in self.poses), None)


def _pose2(pose: Pose2 | Pose3) -> Pose2:
    return Pose2(pose.x, pose.y, pose.yaw)
