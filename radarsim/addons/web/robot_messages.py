"""Robots as messages: a frame of all of them, and what one beam of a scan has met.

A frame is binary. It begins with the length of a JSON header as four bytes, the least
significant first. After the header follow the ranges of all scans as whole centimetres
of two bytes each, likewise; the header tells where those of a scan begin.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.addons.web.requests import BadRequest, Explain
from radarsim.addons.web.robot_view import RobotView, SeenScan
from radarsim.addons.web.viewers import encode_json
from radarsim.client.robot_info import no_return
from radarsim.geometry import Pose2, Pose3
from radarsim.plotting.palette import colour_of
from radarsim.protocol.reports import TargetEchoes
from radarsim.scene.material import Material

NO_RETURN: Final = 65535  # instead of a range in cm
ENDS: Final = ("hit", "spent", "rain")  # kinds of echoes that may end a beam
_WORDS: Final = {
    "enter": "enters",
    "leave": "leaves",
    "sheet": "passes a sheet of",
    "hit": "hits",
    "spent": "spent in",
    "rain": "rain shows in",
}


class Owner(NamedTuple):
    """Whose a robot is.

    Attributes:
        mine: Whether the commander spawned it.
        driver: Name of the viewer that drives it; ``task``, or None.
        hindrance: Why it can do nothing by itself; None if it can.
    """

    mine: bool
    driver: str | None
    hindrance: str | None


NOT_OWN: Final = Owner(mine=False, driver=None, hindrance="it is another program's")


def encode_frame(
    robots: Iterable[RobotView], owners: Mapping[str, Owner], selected: str | None
) -> bytes:
    """Write a frame.

    Args:
        robots: The robots.
        owners: Whose they are, by their names; those without are other programs'.
        selected: Name of the robot whose echoes are told; None for none.
    """
    parts: list[np.ndarray] = []
    rows = []
    times = []
    for robot in robots:
        pose = robot.pose
        if pose is None:
            continue
        times.append(robot.time)
        newest = [scans[-1] for scans in robot.scans.values()]
        speeds = robot.motion() or (0.0, 0.0)
        owner = owners.get(robot.name, NOT_OWN)
        rows.append(
            {
                "name": robot.name,
                "class": robot.class_name,
                **owner._asdict(),
                "x": round(pose.x, 4),
                "y": round(pose.y, 4),
                "yaw": round(pose.yaw, 5),
                "size": robot.size,
                "touch": any(robot.touched.values()),
                "battery": robot.battery,
                "speeds": [round(speed, 3) + 0.0 for speed in speeds],  # no -0.0
                "scans": [_scan(robot, seen, parts) for seen in newest],
                "echoes": [
                    {
                        "scanner": seen.scan.name,
                        "t": seen.scan.time,
                        "objects": [_object(each) for each in seen.echoes or ()],
                    }
                    for seen in newest
                    if robot.name == selected
                ],
            }
        )
    time = max(times, default=-math.inf)
    header = {"t": time if math.isfinite(time) else None, "robots": rows}
    text = encode_json(header).encode()
    ranges = b"".join(part.tobytes() for part in parts)
    return struct.pack("<I", len(text)) + text + ranges


def _scan(robot: RobotView, seen: SeenScan, parts: list[np.ndarray]) -> dict[str, Any]:
    """Describe a scan, and append its ranges to those of the frame."""
    scan, scanner = seen.scan, robot.scanner(seen.scan.name)
    has_return = scan.ranges < no_return(scanner.max_range)
    centimetres = np.minimum(np.rint(scan.ranges * 100), NO_RETURN - 1)
    offset = sum(len(part) for part in parts)
    parts.append(np.where(has_return, centimetres, NO_RETURN).astype("<u2"))
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
        "settings": scanner.settings,
    }


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


def explain_beam(robot: RobotView, request: Explain) -> dict[str, Any]:
    """Return the message that explains a beam by the echoes that came with its scan.

    Raises:
        BadRequest: If there is no such scan or beam, or its echoes were not told.
    """
    seen = robot.find_scan(request.scanner, request.t)
    if seen is None:
        at = "" if request.t is None else f" at {request.t:g} s"
        raise BadRequest(f"no scan of {request.scanner!r}{at} is remembered")
    scan, beam, gaps = seen.scan, request.beam, len(seen.scan.ranges) - 1
    if beam > gaps:
        raise BadRequest(f"beam {beam}, expected 0 to {gaps}")
    if seen.echoes is None:
        raise BadRequest(f"no echoes of {request.scanner!r} came with that scan")
    rows: list[dict[str, Any]] = [
        {
            "range": float(target.ranges[i]),
            "kind": target.kinds[i],
            "object": target.object,
            "material": target.material,
            "power": float(target.power[i]),
        }
        for target in seen.echoes
        for i in (target.beams == beam).nonzero()[0].tolist()
    ]
    rows.sort(key=lambda row: row["range"])
    lines = [
        f"{row['range']:.2f} m: {_WORDS.get(row['kind'], row['kind'])}"
        f" {row['object']} ({row['material']}), power {row['power']:.4f}"
        for row in rows
    ]
    reading = float(scan.ranges[beam])
    if reading < no_return(robot.scanner(request.scanner).max_range):
        # Noise and rounding move the reading away from the echo that ended the beam.
        ends = [row for row in rows if row["kind"] in ENDS]
        near = (r for r in ends if math.isclose(r["range"], reading, abs_tol=0.02))
        row = next(near, ends[-1] if ends else None)
        end = {"range": reading, "kind": "hit" if row is None else row["kind"]}
        lines.append(f"reads {reading:.2f} m")
    else:
        end = {"range": None, "kind": "out_of_range"}
        lines.append("reads nothing")
    return {
        "op": "explanation",
        "robot": robot.name,
        "scanner": scan.name,
        "beam": beam,
        "angle": -scan.fov / 2 + (beam * scan.fov / gaps if gaps else 0.0),
        "t": scan.time,
        "rows": rows,
        "end": end,
        "text": "\n".join(lines),
    }
