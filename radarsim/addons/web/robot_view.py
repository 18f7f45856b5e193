"""What is known of one robot, from the reports that its client is sent."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from radarsim.client import RobotInfo
from radarsim.client.robot_info import DEFAULT_MOUNT, no_return
from radarsim.errors import PresetError
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.presets.robots import RobotModel
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
from radarsim.simulation.config import SimulationConfig

MOTION_WINDOW: Final = 0.5  # s that the speeds are measured over
REMEMBERED_SCANS: Final = 50  # of a scanner, for questions about their beams
POSES: Final = (GroundTruth, Ins, Odometry)


@dataclass(slots=True, eq=False)
class Scanner:
    """One scanner of a robot.

    Attributes:
        name: Name in its scans.
        medium: ``radar`` or ``laser``.
        mount: Pose in the body frame.
        max_range: Range of a beam without return, m.
        settings: Settings by key, as far as they are known.
    """

    name: str
    medium: str = "laser"
    mount: Pose3 = DEFAULT_MOUNT
    max_range: float = math.inf
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class SeenScan:
    """A scan with its echoes, as far as these were told.

    Attributes:
        scan: The scan.
        pose: Pose of the robot; None if it was not known.
        echoes: What it met, object by object; None if nobody asked for that.
    """

    scan: RangeScan
    pose: Pose2 | None
    echoes: tuple[TargetEchoes, ...] | None


class RobotView:
    """The newest state of a robot.

    Attributes:
        name: Name of the robot.
        class_name: Name of its class.
        size: Length and width of the hull, m.
        time: Time of the newest report, s; nan before the first.
        pose: Pose in the map frame by its best sensor; None before the first.
        z: Height of the body frame's origin, m.
        touched: Whether it touches something.
        battery: Time that the battery lasts, s; None if unknown.
        scans: The newest scans of each scanner, the newest last.
        scanners: Scanners by name.
        last_change: The scanner whose settings were changed last, and those before;
            None if none were.
        listeners: Called with each report.
    """

    def __init__(
        self, name: str, class_name: str, config: SimulationConfig | None
    ) -> None:
        """Expect reports.

        Args:
            name: Name of the robot.
            class_name: Name of its class.
            config: How its items differ from their presets; None with another server
                than radarsim, which may have other classes of that name.
        """
        self.name = name
        self.class_name = class_name
        self.size = (0.5, 0.5)
        self.time = math.nan
        self.pose: Pose2 | None = None
        self.z = 0.0
        self.battery: int | None = None
        self.scans: dict[str, deque[SeenScan]] = {}
        self.scanners: dict[str, Scanner] = {}
        self.last_change: tuple[Scanner, dict[str, Any]] | None = None
        self.listeners: list[Callable[[Report], None]] = []
        self._touched: dict[str, bool] = {}
        self._pose_kind = len(POSES)  # index in POSES of where the pose is from
        self._track: deque[tuple[float, Pose2]] = deque()
        self._echoes: dict[str, list[EchoLine]] = {}
        if config is not None:
            self.learn_presets(config)

    @property
    def touched(self) -> bool:
        """Whether any touch sensor is pressed."""
        return any(self._touched.values())

    def describe(self, info: RobotInfo) -> None:
        """Take dimensions, mounts and ranges from the answers of its server."""
        self.size = (info.length, info.width)
        for each in info.scanners:
            scanner = self.scanner(each.name)
            scanner.mount, scanner.max_range = each.mount, each.max_range

    def learn_presets(self, config: SimulationConfig) -> None:
        """Take what the class of that name has, unless that is known already.

        Args:
            config: How its items differ from their presets.
        """
        if not any(scanner.settings for scanner in self.scanners.values()):
            with suppress(PresetError):
                self._describe_by_class(config.robot(self.class_name), config)

    def scanner(self, name: str) -> Scanner:
        """Return the scanner of a name, in any case; a new one if it is unknown."""
        return self.scanners.setdefault(name.casefold(), Scanner(name))

    def take(self, report: Report) -> bool:
        """Process a report; return whether there is something new to show."""
        for listener in tuple(self.listeners):
            listener(report)
        match report:
            case GroundTruth() | Ins() | Odometry():
                self._take_pose(report)
            case RangeScan():
                self._take_scan(report)
            case EchoLine():
                self._take_echoes(report)
                return False  # its scan follows
            case Touch(name=name, touched=touched):
                self._touched[name] = touched
            case Status(battery=battery):
                self.battery = battery
            case _:
                return False
        if not math.isnan(report.time):
            self.time = report.time
        return True

    def speeds(self) -> tuple[float, float]:
        """Return the speed ahead, m/s, and the turn rate to the left, rad/s."""
        if len(self._track) < 2:
            return 0.0, 0.0
        (start, before), (end, after) = self._track[0], self._track[-1]
        spent, turned = end - start, wrap_angle(after.yaw - before.yaw)
        yaw = before.yaw + turned / 2
        ahead = math.cos(yaw) * (after.x - before.x)
        ahead += math.sin(yaw) * (after.y - before.y)
        return ahead / spent, turned / spent

    def find_scan(self, scanner: str, time: float | None) -> SeenScan | None:
        """Return the scan of a time, s, or the newest; None if there is none."""
        scans = self.scans.get(scanner.casefold(), ())
        fitting = (
            seen
            for seen in reversed(scans)
            if time is None or math.isclose(seen.scan.time, time, abs_tol=1e-6)
        )
        return next(fitting, None)

    def _describe_by_class(self, model: RobotModel, config: SimulationConfig) -> None:
        self.size = (model.length, model.width)
        for item in model.items_of("RangeScanner"):
            settings = config.scanner_settings(item)
            self.scanners[item.name.casefold()] = Scanner(
                item.name,
                settings.medium,
                item.mount,
                settings.max_range,
                settings.model_dump(mode="json", exclude={"medium"}),
            )

    def _take_pose(self, report: GroundTruth | Ins | Odometry) -> None:
        kind = POSES.index(type(report))
        if kind > self._pose_kind:
            return
        pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
        track = self._track
        if kind < self._pose_kind or (track and not report.time > track[-1][0]):
            track.clear()  # it held poses of another sensor, or of another robot
        self._pose_kind, self.pose = kind, pose
        if isinstance(report.pose, Pose3):
            self.z = report.pose.z
        track.append((report.time, pose))
        while report.time - track[0][0] > MOTION_WINDOW:
            track.popleft()

    def _take_scan(self, report: RangeScan) -> None:
        key = report.name.casefold()
        lines = self._echoes.pop(key, None)
        echoes = None if lines is None else _complete(lines, report.time)
        seen = SeenScan(report, self.pose, echoes)
        self.scanner(report.name)
        scans = self.scans.setdefault(key, deque(maxlen=REMEMBERED_SCANS))
        scans.append(seen)

    def _take_echoes(self, report: EchoLine) -> None:
        lines = self._echoes.setdefault(report.name.casefold(), [])
        if lines and lines[-1].time != report.time:
            lines.clear()
        lines.append(report)


def _complete(
    lines: Sequence[EchoLine], time: float
) -> tuple[TargetEchoes, ...] | None:
    """Return the echoes of a scan; None if a line is missing, or of another time."""
    if lines[-1].time != time or len(lines) < lines[-1].lines:
        return None
    return tuple(line.echoes for line in lines if line.echoes is not None)


def ranges_in_cm(scan: RangeScan, max_range: float) -> np.ndarray:
    """Return the ranges of a scan in whole cm, (N,) uint16; 65535 for no return."""
    has_return = scan.ranges < no_return(max_range)
    centimetres = np.minimum(np.rint(scan.ranges * 100), 65534)
    return np.where(has_return, centimetres, 65535).astype("<u2")
