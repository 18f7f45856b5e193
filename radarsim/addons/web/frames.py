"""A frame: the newest state of all robots in one binary message.

It begins with the length of a JSON header as four bytes, the least significant first.
After the header follow the ranges of all scans as whole centimetres of two bytes each,
likewise; the header tells where those of a scan begin.

When frames are sent: soon after something is new, and not too often.
"""

import asyncio
import math
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from radarsim.addons.web.robot_view import RobotView, Scanner, SeenScan, ranges_in_cm
from radarsim.addons.web.viewer import Viewer, encode_json
from radarsim.geometry import Pose2, Pose3
from radarsim.plotting.palette import colour_of
from radarsim.protocol.reports import TargetEchoes
from radarsim.scene.material import Material

INTERVAL: Final = 0.1  # s between two frames, on average at least
COALESCED: Final = 0.004  # s; what arrives together is in one frame


class FrameSender:
    """Sends frames to the viewers that are ready for one."""

    def __init__(
        self,
        viewers: Mapping[str, Viewer],
        make_frame: Callable[[str | None], bytes],
    ) -> None:
        """Create a sender; to be called in the event loop.

        Args:
            viewers: The viewers, which may come and go.
            make_frame: Returns the newest frame, with the echoes of the robot of a
                name, or of none.
        """
        self._viewers = viewers
        self._make_frame = make_frame
        self._loop = asyncio.get_running_loop()
        self._version = 1  # of what frames show
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def changed(self) -> None:
        """Show soon what is new."""
        self._version += 1
        if self._timer is None:
            due = max(self._loop.time() + COALESCED, self._due)
            self._timer = self._loop.call_at(due, self._send)

    def acknowledge(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that has shown the one before, if it is old."""
        viewer.is_ready = True
        self.catch_up(viewer)

    def catch_up(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that is ready, if the one that it has is old."""
        if self._timer is None and _can_take(viewer) and viewer.shown < self._version:
            self.send_to(viewer)

    def send_to(self, viewer: Viewer) -> None:
        """Send a frame to one viewer."""
        viewer.send_frame(self._make_frame(viewer.selected), self._version)

    def _send(self) -> None:
        """Send a frame to all viewers that are ready, and set when the next is due."""
        self._timer = None
        # One that is late puts off no other: else frames would follow scans, which
        # come as often, by that time for ever.
        self._due = max(self._loop.time(), self._due + INTERVAL)
        frames: dict[str | None, bytes] = {}
        for viewer in self._viewers.values():
            if _can_take(viewer):
                if viewer.selected not in frames:
                    frames[viewer.selected] = self._make_frame(viewer.selected)
                viewer.send_frame(frames[viewer.selected], self._version)


def _can_take(viewer: Viewer) -> bool:
    return viewer.is_ready and viewer.is_looking


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
