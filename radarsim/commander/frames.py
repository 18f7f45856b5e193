"""A frame: the newest state of all robots in one binary message.

It begins with the length of a JSON header as four bytes, the least significant first.
After the header follow the ranges of all scans as whole centimetres of two bytes each,
likewise; the header tells where those of a scan begin.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.commander.colours import colour_of
from radarsim.commander.robot_view import RobotView, Scanner, SeenScan, ranges_in_cm
from radarsim.commander.viewer import encode_json
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import TargetEchoes
from radarsim.scene.material import Material


@dataclass(frozen=True, slots=True)
class Owner:
    """Whose a robot is.

    Attributes:
        mine: Whether the commander spawned it.
        driver: Name of the viewer that drives it; ``task``, or None.
        hindrance: Why it can do nothing by itself; None if it can.
    """

    mine: bool
    driver: str | None
    hindrance: str | None = None


def encode_frame(
    robots: Iterable[RobotView], owners: Mapping[str, Owner], selected: str | None
) -> bytes:
    """Write a frame.

    Args:
        robots: The robots.
        owners: Whose they are, by their names.
        selected: Name of the robot whose echoes are told; None for none.
    """
    parts: list[np.ndarray] = []
    rows = []
    time = -math.inf
    for robot in robots:
        if robot.pose is None:
            continue
        time = max(time, robot.time)
        with_echoes = robot.name == selected
        rows.append(_robot(robot, robot.pose, owners[robot.name], parts, with_echoes))
    header = {"t": time if math.isfinite(time) else None, "robots": rows}
    text = encode_json(header).encode()
    ranges = b"".join(part.tobytes() for part in parts)
    return struct.pack("<I", len(text)) + text + ranges


def _robot(
    robot: RobotView,
    pose: Pose2,
    owner: Owner,
    parts: list[np.ndarray],
    with_echoes: bool,
) -> dict[str, Any]:
    """Describe a robot, and append the ranges of its scans."""
    newest = [(name, scans[-1]) for name, scans in robot.scans.items()]
    scans = [_scan(robot, robot.scanners[name], seen, parts) for name, seen in newest]
    return {
        "name": robot.name,
        "class": robot.class_name,
        "mine": owner.mine,
        "driver": owner.driver,
        "hindrance": owner.hindrance,
        "x": round(pose.x, 4),
        "y": round(pose.y, 4),
        "yaw": round(pose.yaw, 5),
        "size": robot.size,
        "touch": robot.touched,
        "battery": robot.battery,
        "speeds": [round(speed, 3) + 0.0 for speed in robot.speeds()],
        "scans": scans,
        "echoes": [_echoes(seen) for _, seen in newest] if with_echoes else [],
    }


def _scan(
    robot: RobotView, scanner: Scanner, seen: SeenScan, parts: list[np.ndarray]
) -> dict[str, Any]:
    offset = sum(len(part) for part in parts)
    ranges = ranges_in_cm(seen.scan, scanner.max_range)
    parts.append(ranges)
    pose = seen.pose or Pose2(0.0, 0.0)
    mount = Pose3(pose.x, pose.y, robot.z, yaw=pose.yaw).compose(scanner.mount)
    scan = seen.scan
    gaps = len(ranges) - 1
    return {
        "scanner": scan.name,
        "kind": scanner.medium,
        "t": scan.time,
        "fov": scan.fov,
        # from the number of beams: what the line tells has few digits
        "resolution": scan.fov / gaps if gaps > 0 else scan.resolution,
        "max": scanner.max_range,
        "x": round(mount.x, 4),
        "y": round(mount.y, 4),
        "z": round(mount.z, 4),
        "yaw": round(mount.yaw, 5),
        "offset": offset,
        "count": len(ranges),
        "settings": scanner.settings,
    }


def _echoes(seen: SeenScan) -> dict[str, Any]:
    objects = [_object(each) for each in seen.echoes or ()]
    return {"scanner": seen.scan.name, "t": seen.scan.time, "objects": objects}


def _object(echoes: TargetEchoes) -> dict[str, Any]:
    density = echoes.density if math.isfinite(echoes.density) else None
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
        "density": density,
        "colour": colour_of(material),
        "echoes": sorted(zip(*columns, strict=True), key=lambda row: row[:2]),
    }
