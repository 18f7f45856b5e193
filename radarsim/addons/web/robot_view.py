"""The state of one robot, by the lines to its client, and frames for pages.

The newest state of all robots is a frame, which is binary. It begins with the length of
a JSON header as four bytes, the least significant first. After the header follow the
ranges of all scans as whole centimetres of two bytes each, likewise; the header has
the offsets of scans.
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

NO_RETURN: Final = 65535  # instead of a range in cm


# Of whom robots are that the commander did not spawn.
NOT_OWN: Final = {
    "mine": False,
    "driver": None,
    "hindrance": "it is another program's",
    "safety": None,
    "clearance": None,
}


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
    """A scan with its echoes, if these were sent.

    Attributes:
        scan: The scan.
        pose: Pose of the robot; None if it was not known.
        echoes: What it met, object by object; None if nobody asked for that.
    """

    scan: RangeScan
    pose: Pose2 | None
    echoes: Sequence[TargetEchoes] | None


class RobotView(RobotState):
    """The newest state of a robot.

    Attributes:
        name: Name of the robot.
        class_name: Name of its class.
        number: Number that no other robot has, the smallest when it came.
        size: Length and width of the footprint, m.
        scans: The newest scan of each scanner, by its casefolded name.
        scanners: Scanners by their casefolded names.
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
        super().__init__()
        self.name = name
        self.class_name = class_name
        self.number = 0
        # Until it is known, the page draws a square of about the usual size.
        self.size = (0.5, 0.5)
        self.scans: dict[str, SeenScan] = {}
        self.scanners: dict[str, Scanner] = {}
        self.listeners: list[Callable[[Report], None]] = []
        self._echoes: dict[str, EchoCollector] = {}
        self._last_change: tuple[Scanner, dict[str, Any]] | None = None
        if config is not None:
            self.learn_presets(config)

    def learn(self, info: RobotInfo) -> None:
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
        # Known settings may have been changed since.
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
        """Return the scanner of a name, in any case; a new one if it is unknown."""
        return self.scanners.setdefault(name.casefold(), Scanner(name))

    def take(self, report: Report) -> bool:
        """Process a report; return whether there is something new to show."""
        for listener in tuple(self.listeners):
            listener(report)
        if isinstance(report, EchoLine):
            collector = self._echoes.setdefault(report.name.casefold(), EchoCollector())
            collector.take(report)
            return False  # its scan follows
        if isinstance(report, RangeScan):
            key = report.name.casefold()
            self.scanner(report.name)
            echoes = self._echoes[key].of(report) if key in self._echoes else None
            self.scans[key] = SeenScan(report, self.pose, echoes)
        return super().take(report)

    def change_setting(self, request: Setting) -> tuple[str, object]:
        """Change a setting, as the server will from the next scan on.

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
            value = math.inf  # JSON knows no infinity; unlimited is null there
        if not scanner.settings:  # those of an unknown class are the server's to check
            return scanner.name, value
        # What a scanner is stays; its settings would mean something else.
        if key == "medium":
            raise BadRequest("medium: cannot be changed here")
        settings = {"medium": scanner.medium, **scanner.settings, key: value}
        try:  # as JSON: its arrays are tuples, and no text is a number
            changed = SensorSettings.model_validate_json(
                json.dumps(settings), strict=True
            )
        except ValidationError as error:
            problems = describe_settings(error, SensorSettings)
            raise BadRequest(problems[0]) from None
        self._last_change = scanner, scanner.settings
        # As they are shown, so that numbers stay numbers.
        scanner.settings = changed.model_dump(mode="json", exclude={"medium"})
        scanner.max_range = scanner.settings["max_range"]
        return scanner.name, value

    def undo_setting(self) -> None:
        """Take back the last change, which the server has refused."""
        if self._last_change is not None:
            scanner, settings = self._last_change
            scanner.settings = settings
            scanner.max_range = scanner.settings["max_range"]
            self._last_change = None

    def describe(
        self, pose: Pose2, parts: list[np.ndarray], *, is_selected: bool
    ) -> dict[str, Any]:
        """Return how it is, for a frame.

        Args:
            pose: Where it is.
            parts: Ranges of scans in the frame, to which its own are appended.
            is_selected: Whether settings and echoes are included, which are most of it.
        """
        seen = [*self.scans.values()]
        return {
            "x": round(pose.x, 4),
            "y": round(pose.y, 4),
            "yaw": round(pose.yaw, 5),
            "size": self.size,
            "touch": any(self.touched.values()),
            "battery": self.battery,
            # No -0.0.
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
        """Describe a scan, and append its ranges to those of the frame."""
        scan, scanner = seen.scan, self.scanner(seen.scan.name)
        has_return = scan.ranges < no_return(scanner.max_range)
        centimetres = np.minimum(np.rint(scan.ranges * 100), NO_RETURN - 1)
        offset = sum(len(part) for part in parts)
        # Half the bytes of single precision, and as exact as the lines of servers.
        parts.append(np.where(has_return, centimetres, NO_RETURN).astype("<u2"))
        # Where the robot was then: in a turn, the scan would be dragged along.
        pose = seen.pose or Pose2(0.0, 0.0)
        mount = Pose3(pose.x, pose.y, self.z, yaw=pose.yaw).compose(scanner.mount)
        gaps = len(scan.ranges) - 1
        return {
            "scanner": scan.name,
            "kind": scanner.medium,
            "t": scan.time,
            "fov": scan.fov,
            # from the number of beams: the resolution of the line has few digits
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
    """Write a frame.

    Args:
        robots: The robots.
        owners: Whose they are, by their names; those without are other programs'.
            Keys as of ``NOT_OWN``: whether the commander spawned it; the name of the
            viewer that drives it, ``task`` or None; why it can do nothing by itself;
            the distance that it keeps from obstacles on its way, and that of a goal
            from obstacles below which it is refused, m.
        selected: Name of the robot whose echoes are included; None for none.
        time: The time that is shown, s; None for that of the newest report.
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
