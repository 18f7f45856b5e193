"""The state of one robot, read from the lines to its client, and frames for pages.

A frame is a binary message with the newest state of all robots. It starts with the
length of a JSON header, uint32, little-endian. The ranges of all scans follow the
header, in cm, uint16, little-endian. The header has the index at which the ranges of
each scan start.
"""

import json
import math
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from radarsim.addons.web.requests import BadRequest, Setting
from radarsim.addons.web.viewers import encode_json
from radarsim.client import RobotInfo
from radarsim.client.robot_info import DEFAULT_MOUNT, no_return
from radarsim.client.robot_state import EchoCollector, RobotState
from radarsim.errors import PresetError
from radarsim.geometry import Pose2, Pose3
from radarsim.plotting.palette import ROBOTS, colour_of
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.reports import EchoLine, RangeScan, Report, TargetEchoes
from radarsim.scene.material import Material
from radarsim.simulation.config import SimulationConfig
from radarsim.validation import describe_settings

NO_RETURN: Final = 65535  # replaces the range, cm, of a beam without return


# Ownership fields of a frame for a robot that another client has spawned.
NOT_OWN: Final = {
    "mine": False,
    "driver": None,
    "hindrance": "another client drives it",
    "safety": None,
    "clearance": None,
}


@dataclass(slots=True, eq=False)
class Scanner:
    """One scanner of a robot.

    Attributes:
        name: Name of the scanner in scans.
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
    """A scan with its echoes, if they were sent.

    Attributes:
        scan: The scan.
        pose: Pose of the robot; None if it was not known.
        echoes: The echoes of each object; None if they were not requested.
    """

    scan: RangeScan
    pose: Pose2 | None
    echoes: Sequence[TargetEchoes] | None


class RobotView(RobotState):
    """The newest state of a robot.

    Attributes:
        name: Name of the robot.
        class_name: Name of its class.
        number: The smallest number that no other robot had when this robot joined.
        size: Length and width of the footprint, m.
        scans: The newest scan of each scanner, by its casefolded name.
        scanners: Scanners by their casefolded names.
        listeners: Called with each report.
    """

    def __init__(
        self, name: str, class_name: str, config: SimulationConfig | None
    ) -> None:
        """Create the state of a robot without reports.

        Args:
            name: Name of the robot.
            class_name: Name of its class.
            config: Changed settings of items; None if the server may not be radarsim,
                as other servers may have another class of that name.
        """
        super().__init__()
        self.name = name
        self.class_name = class_name
        self.number = 0
        # The page draws a square of typical size until the size of the robot is known.
        self.size = (0.5, 0.5)
        self.scans: dict[str, SeenScan] = {}
        self.scanners: dict[str, Scanner] = {}
        self.listeners: list[Callable[[Report], None]] = []
        self._echoes: dict[str, EchoCollector] = {}
        self._last_change: tuple[Scanner, dict[str, Any]] | None = None
        if config is not None:
            self.learn_presets(config)

    def learn(self, info: RobotInfo) -> None:
        """Store the dimensions, mounts and ranges that the server has reported."""
        self.size = (info.length, info.width)
        for each in info.scanners:
            scanner = self.scanner(each.name)
            scanner.mount, scanner.max_range = each.mount, each.max_range

    def learn_presets(self, config: SimulationConfig) -> None:
        """Store the size and the scanners of the robot's class, if they are unknown.

        Args:
            config: Robot classes, and changed settings of their items.
        """
        # Known settings are kept, because a viewer may have changed them.
        if any(scanner.settings for scanner in self.scanners.values()):
            return
        with suppress(PresetError):
            model = config.robot(self.class_name)
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

    def scanner(self, name: str) -> Scanner:
        """Return a scanner by name, ignoring case; add the scanner if it is new."""
        return self.scanners.setdefault(name.casefold(), Scanner(name))

    def take(self, report: Report) -> bool:
        """Process a report; return whether the shown state has changed."""
        for listener in tuple(self.listeners):
            listener(report)
        if isinstance(report, EchoLine):
            collector = self._echoes.setdefault(report.name.casefold(), EchoCollector())
            collector.take(report)
            return False  # the scan of the echoes follows
        if isinstance(report, RangeScan):
            key = report.name.casefold()
            self.scanner(report.name)
            echoes = self._echoes[key].of(report) if key in self._echoes else None
            self.scans[key] = SeenScan(report, self.pose, echoes)
        return super().take(report)

    def change_setting(self, request: Setting) -> tuple[str, object]:
        """Change a shown setting; the server uses it from the next scan on.

        Returns:
            Name of the scanner, and the value of the setting.

        Raises:
            BadRequest: If there is no such scanner or setting, or the value is wrong.
        """
        scanner = self.scanners.get(request.scanner.casefold())
        if scanner is None:
            names = [each.name for each in self.scanners.values()]
            raise BadRequest(f"no scanner {request.scanner!r}, expected one of {names}")
        key, value = request.key, request.value
        if value is None and key == "penetration_power":
            value = math.inf  # JSON has no infinity, so null means unlimited
        if not scanner.settings:  # only the server knows the class and checks values
            return scanner.name, value
        # A radar cannot become a laser, because most settings would change their
        # meaning.
        if key == "medium":
            raise BadRequest("the setting 'medium' cannot be changed here")
        settings = {"medium": scanner.medium, **scanner.settings, key: value}
        try:  # strict JSON mode takes arrays for tuples, but no texts for numbers
            changed = SensorSettings.model_validate_json(
                json.dumps(settings), strict=True
            )
        except ValidationError as error:
            problems = describe_settings(error, SensorSettings)
            raise BadRequest(problems[0]) from None
        self._last_change = scanner, scanner.settings
        # Frames contain the settings in this JSON form.
        scanner.settings = changed.model_dump(mode="json", exclude={"medium"})
        scanner.max_range = scanner.settings["max_range"]
        return scanner.name, value

    def undo_setting(self) -> None:
        """Undo the last change of a setting, which the server has refused."""
        if self._last_change is not None:
            scanner, settings = self._last_change
            scanner.settings = settings
            scanner.max_range = scanner.settings["max_range"]
            self._last_change = None

    def describe(
        self, pose: Pose2, parts: list[np.ndarray], *, is_selected: bool
    ) -> dict[str, Any]:
        """Return the robot's part of the header of a frame.

        Args:
            pose: Pose of the robot.
            parts: Ranges of scans in the frame, to which the robot's are appended.
            is_selected: Whether settings and echoes are included, which are large.
        """
        seen = [*self.scans.values()]
        return {
            "x": round(pose.x, 4),
            "y": round(pose.y, 4),
            "yaw": round(pose.yaw, 5),
            "size": self.size,
            "touch": any(self.touched.values()),
            "battery": self.battery,
            # Adding 0.0 replaces -0.0 by 0.0.
            "speeds": [round(each, 3) + 0.0 for each in self.motion() or (0.0, 0.0)],
            "scans": [self._scan(each, parts, is_selected) for each in seen],
            "echoes": [
                {
                    "scanner": each.scan.name,
                    "t": each.scan.time,
                    "objects": [_object(one) for one in each.echoes or ()],
                }
                for each in seen
                if is_selected
            ],
        }

    def _scan(
        self, seen: SeenScan, parts: list[np.ndarray], is_selected: bool
    ) -> dict[str, Any]:
        """Describe a scan, and append the ranges of the scan to the frame's parts."""
        scan, scanner = seen.scan, self.scanner(seen.scan.name)
        has_return = scan.ranges < no_return(scanner.max_range)
        centimetres = np.minimum(np.rint(scan.ranges * 100), NO_RETURN - 1)
        offset = sum(len(part) for part in parts)
        # uint16 takes half the bytes of float32, and servers also round ranges to
        # centimetres.
        parts.append(np.where(has_return, centimetres, NO_RETURN).astype("<u2"))
        # The pose at the time of the scan is used. With the present pose, an old scan
        # would rotate with the robot.
        pose = seen.pose or Pose2(0.0, 0.0)
        mount = Pose3(pose.x, pose.y, self.z, yaw=pose.yaw).compose(scanner.mount)
        gaps = len(scan.ranges) - 1
        return {
            "scanner": scan.name,
            "kind": scanner.medium,
            "t": scan.time,
            "fov": scan.fov,
            # The resolution in the line is rounded, so it is computed from the number
            # of beams.
            "resolution": scan.fov / gaps if gaps > 0 else scan.resolution,
            "max": scanner.max_range,
            "x": round(mount.x, 4),
            "y": round(mount.y, 4),
            "z": round(mount.z, 4),
            "yaw": round(mount.yaw, 5),
            "offset": offset,
            "count": len(scan.ranges),
            "settings": scanner.settings if is_selected else {},
        }


def encode_frame(
    robots: Iterable[RobotView],
    owners: Mapping[str, Mapping[str, Any]],
    selected: str | None,
    time: float | None = None,
) -> bytes:
    """Return a frame as bytes.

    Args:
        robots: The robots.
        owners: Owner entries by the names of robots; ``NOT_OWN`` is the default.
            ``mine``: whether the commander spawned the robot. ``driver``: name of the
            viewer that drives it, ``task`` or None. ``hindrance``: why it cannot run
            tasks, or None. ``safety``: its safety distance on paths, m.
            ``clearance``: least distance of a goal from obstacles, m.
        selected: Name of the robot whose echoes are included; None for none.
        time: The time that is shown, s; None for the time of the newest report.
    """
    shown = [(robot, robot.pose) for robot in robots]
    parts: list[np.ndarray] = []
    rows = [
        {
            "name": robot.name,
            "class": robot.class_name,
            "colour": ROBOTS[robot.number % len(ROBOTS)] if len(shown) > 1 else None,
            **owners.get(robot.name, NOT_OWN),
            **robot.describe(pose, parts, is_selected=robot.name == selected),
        }
        for robot, pose in shown
        if pose is not None
    ]
    if time is None:
        times = (robot.time for robot, pose in shown if pose is not None)
        time = max(times, default=-math.inf)
    text = encode_json({"t": time, "robots": rows}).encode()
    ranges = b"".join(part.tobytes() for part in parts)
    return struct.pack("<I", len(text)) + text + ranges


def _object(echoes: TargetEchoes) -> dict[str, Any]:
    material = Material(echoes.material, echoes.density, solid=not echoes.robot_passes)
    columns = (
        echoes.beams.tolist(),
        np.round(echoes.ranges, 3).tolist(),
        echoes.kinds,
        np.round(echoes.power, 4).tolist(),
        np.round(echoes.strength, 4).tolist(),
    )
    return {
        "name": echoes.object,
        "material": echoes.material,
        "density": echoes.density,
        "colour": colour_of(material),
        "echoes": sorted(zip(*columns, strict=True), key=lambda row: row[:2]),
    }
