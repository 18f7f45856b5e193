"""How pages are told of robots: the newest state of all of them is a frame.

A frame is binary. It begins with the length of a JSON header as four bytes, the least
significant first. After the header follow the ranges of all scans as whole centimetres
of two bytes each, likewise; the header tells where those of a scan begin.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from radarsim.addons.web.robot_view import RobotView, SeenScan
from radarsim.addons.web.viewers import encode_json
from radarsim.client.robot_info import no_return
from radarsim.geometry import Pose2, Pose3
from radarsim.plotting.palette import ROBOTS, colour_of
from radarsim.protocol.reports import TargetEchoes
from radarsim.scene.material import Material

NO_RETURN: Final = 65535  # instead of a range in cm


# Of whom robots are that the commander did not spawn.
NOT_OWN: Final = {
    "mine": False,
    "driver": None,
    "hindrance": "it is another program's",
    "safety": None,
    "clearance": None,
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
        selected: Name of the robot whose echoes are told; None for none.
        time: The time that is shown, s; None for that of the newest report.
    """
    robots = [*robots]
    is_many = len(robots) > 1
    parts: list[np.ndarray] = []
    rows = []
    times = []
    for robot in robots:
        pose = robot.pose
        if pose is None:
            continue
        times.append(robot.time)
        speeds = robot.motion() or (0.0, 0.0)
        rows.append(
            {
                "name": robot.name,
                "class": robot.class_name,
                "colour": ROBOTS[robot.number % len(ROBOTS)] if is_many else None,
                **owners.get(robot.name, NOT_OWN),
                "x": round(pose.x, 4),
                "y": round(pose.y, 4),
                "yaw": round(pose.yaw, 5),
                "size": robot.size,
                "touch": any(robot.touched.values()),
                "battery": robot.battery,
                "speeds": [round(speed, 3) + 0.0 for speed in speeds],  # no -0.0
                "scans": [
                    _scan(robot, seen, parts, with_settings=robot.name == selected)
                    for seen in robot.scans.values()
                ],
                "echoes": [
                    {
                        "scanner": seen.scan.name,
                        "t": seen.scan.time,
                        "objects": [_object(each) for each in seen.echoes or ()],
                    }
                    for seen in robot.scans.values()
                    if robot.name == selected
                ],
            }
        )
    if time is None:
        time = max(times, default=-math.inf)
    text = encode_json({"t": time, "robots": rows}).encode()
    ranges = b"".join(part.tobytes() for part in parts)
    return struct.pack("<I", len(text)) + text + ranges


def _scan(
    robot: RobotView, seen: SeenScan, parts: list[np.ndarray], *, with_settings: bool
) -> dict[str, Any]:
    """Describe a scan, and append its ranges to those of the frame."""
    scan, scanner = seen.scan, robot.scanner(seen.scan.name)
    has_return = scan.ranges < no_return(scanner.max_range)
    centimetres = np.minimum(np.rint(scan.ranges * 100), NO_RETURN - 1)
    offset = sum(len(part) for part in parts)
    # Half the bytes of single precision, and as exact as the lines of servers.
    parts.append(np.where(has_return, centimetres, NO_RETURN).astype("<u2"))
    # Where the robot was then: in a turn, the scan would be dragged along.
    pose = seen.pose or Pose2(0.0, 0.0)
    mount = Pose3(pose.x, pose.y, robot.z, yaw=pose.yaw).compose(scanner.mount)
    gaps = len(scan.ranges) - 1
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
        "count": len(scan.ranges),
        # Which are most of a frame, and shown of the selected robot alone.
        "settings": scanner.settings if with_settings else {},
    }


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
