"""What a robot has told of itself lately."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from radarsim.client.robot_info import RobotInfo, ScannerInfo, beam_angles, same_name
from radarsim.geometry import Floats, Pose2, Pose3, wrap_angle
from radarsim.navigation.observation import from_centre
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    Status,
    Touch,
)

LEAST_GAP: Final = (
    0.01  # m; what is no nearer than this to the largest range is nothing
)
MOST_SCANS: Final = 11  # whose times give the rate
MOTION_WINDOW: Final = 0.5  # s, over which the speed is measured
POSES: Final[tuple[type[GroundTruth | Ins | Odometry], ...]] = (
    GroundTruth,
    Ins,
    Odometry,
)


@dataclass(slots=True)
class RobotState:
    """The newest of each kind, from one robot.

    Attributes:
        facts: Of the robot.
        scanner: The one that is looked at.
        level: Name of the map.
        time: s of the server, not a number before the first report.
        poses: By kind of report.
        touched: By name of the item.
        battery: Time that it lasts, s; None if nobody tells.
        scan: None before the first.
    """

    facts: RobotInfo
    scanner: ScannerInfo
    level: str
    time: float = math.nan
    poses: dict[type, Pose2] = field(default_factory=dict)
    touched: dict[str, bool] = field(default_factory=dict)
    battery: int | None = None
    scan: RangeScan | None = None
    _scan_times: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_SCANS))
    _track: deque[tuple[float, Pose2]] = field(default_factory=deque)

    def take(self, report: Report) -> None:
        """Take in a report; of most kinds there is nothing to be kept."""
        match report:
            case GroundTruth() | Ins() | Odometry():
                self._place(report)
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
        """Give the places where beams of the newest scan ended.

        Returns:
            (N, 2) m from the robot's centre, x ahead and y to its left.
        """
        if self.scan is None:
            return np.zeros((0, 2))
        seen = self.scan.ranges > 0  # a scanner that is blinded reads 0
        bearings, ranges = from_centre(
            self.scan.ranges[seen],
            beam_angles(self.scan)[seen],
            self.scanner.mount,
            self.scanner.max_range - LEAST_GAP,
        )
        ended = np.isfinite(ranges)
        bearings, ranges = bearings[ended], ranges[ended]
        return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])

    def is_blind(self) -> bool:
        """Tell whether the newest scan has no beam that reads more than 0."""
        return self.scan is not None and not (self.scan.ranges > 0).any()

    def scan_rate(self) -> float:
        """Give scans in a second of the server; not a number before the second one."""
        times = self._scan_times
        spent = times[-1] - times[0] if times else 0.0
        return (len(times) - 1) / spent if spent > 0 else math.nan

    def motion(self) -> tuple[float, float] | None:
        """Measure how the robot moves, by the best pose that it tells of.

        Returns:
            Speed ahead, m/s, and turn, rad/s counter-clockwise; None before the
            second pose.
        """
        if len(self._track) < 2:
            return None
        (start, before), (end, after) = self._track[0], self._track[-1]
        spent = end - start
        yaw = before.yaw + wrap_angle(after.yaw - before.yaw) / 2
        way = (after.x - before.x) * math.cos(yaw) + (after.y - before.y) * math.sin(
            yaw
        )
        return way / spent, wrap_angle(after.yaw - before.yaw) / spent

    def _place(self, report: GroundTruth | Ins | Odometry) -> None:
        kind, pose, track = type(report), _flat(report.pose), self._track
        if kind is not self._best():
            self.poses[kind] = pose
            if kind is not self._best():
                return
            track.clear()  # it was that of another kind
        self.poses[kind] = pose
        if track and not report.time > track[-1][0]:
            track.clear()  # another robot, or time that begins anew
        track.append((report.time, pose))
        while report.time - track[0][0] > MOTION_WINDOW:
            track.popleft()

    def _best(self) -> type | None:
        """Give the best kind of pose that has come."""
        return next((kind for kind in POSES if kind in self.poses), None)


def _flat(pose: Pose2 | Pose3) -> Pose2:
    return Pose2(pose.x, pose.y, pose.yaw)
