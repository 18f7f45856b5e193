"""Converts the lines between one robot and its client into ROS 2 topics.

The points of echoes refer to objects and materials by number; a ``Legend`` lists their
names. Frames follow REP-105: the parent of ``base_link`` is ``odom``, in which a robot
moves without jumps. The parent of ``odom`` is ``map``; the transform between them
corrects the drift of odometry.
"""

import io
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radarsim.addons.fmcw.image_files import METADATA_BYTES
from radarsim.addons.recording.messages import (
    ECHO,
    MAP,
    TARGET,
    Fields,
    Points,
    TopicMessage,
    camera_info,
    compressed_image,
    grey_image,
    laser_scan,
    odometry,
    point_cloud,
    pose_stamped,
    radar_scan,
    string,
    transform,
    transforms,
    twist_stamped,
)
from radarsim.addons.recording.robot_model import robot_description
from radarsim.autonomy.mapping.export import sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.client.robot_info import RobotInfo, ScannerInfo, same_name
from radarsim.geometry import Pose3, wrap_angle
from radarsim.presets.robots import RobotModel
from radarsim.protocol.commands import Drive
from radarsim.protocol.echoes import EchoLine, RadarTargets
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)
from radarsim.server.views import MOUNT

SOURCES = (Odometry, Ins, GroundTruth)  # sensors for the pose in ``odom``, best first
REFERENCES = (GroundTruth, Ins)  # sensors for the pose in ``map``, best first
# A motion faster than this multiple of the top speed is a jump, such as a reset of
# odometry.
JUMP = 2.0
OPTICAL_FRAME: Final = "camera_optical"
# The z axis points ahead, x to the right and y down (REP-103).
OPTICAL_MOUNT: Final = MOUNT.compose(Pose3(0, 0, 0, -math.pi / 2, 0, -math.pi / 2))


class Legend:
    """Assigns numbers to names in the order in which they occur, from 0."""

    def __init__(self) -> None:
        keys = ("kind", "object", "material")
        self._names: dict[str, dict[str, int]] = {key: {} for key in keys}
        self._published = -1  # number of names in the last message

    def number(self, field: Literal["kind", "object", "material"], name: str) -> int:
        """Return the number of a name in a field; a new name gets the next number."""
        names = self._names[field]
        return names.setdefault(name, len(names))

    def news(self) -> Iterator[TopicMessage]:
        """If there are new names, yield all names as JSON, a list for each field."""
        count = sum(map(len, self._names.values()))
        if count != self._published:
            self._published = count
            names = {key: list(each) for key, each in self._names.items()}
            yield string("/radarsim/legend", json.dumps(names))


class RobotFrames:
    """Computes the odometry and the frames of one robot from its pose sensors."""

    def __init__(self, name: str, *, own_localization: bool) -> None:
        """Create the frames of a robot whose sensors have not reported yet.

        Args:
            name: Name of the robot, the prefix of its frames and topics; empty for
                no prefix.
            own_localization: Whether the transform from ``map`` to ``odom`` is left
                out.
        """
        odom = below(name, "odom")
        self._topic = f"/{odom}"
        self._odom, self._base = odom, below(name, "base_link")
        self._own_localization = own_localization
        self._readings: dict[type, tuple[float, Pose3]] = {}
        self._knows_all = False

    def observe(
        self, kind: type, time: float, pose: Pose3, robot: RobotInfo | None
    ) -> Iterator[TopicMessage]:
        """Process a reading of a pose sensor; yield odometry and transforms.

        Args:
            kind: Report type of the sensor: one of ``SOURCES``.
            time: Simulated time, s.
            pose: Pose of the robot: in ``odom`` if from odometry, else in ``map``.
            robot: The robot, if it is known.
        """
        before = self._readings.get(kind)
        self._readings[kind] = time, pose
        # When any sensor reports for the second time, every sensor has reported once.
        # Before that, a better source of poses may still be missing.
        self._knows_all |= before is not None and time > before[0]
        source = next(each for each in SOURCES if each in self._readings)
        if kind is not source or not self._knows_all:
            return
        motion = (0.0, 0.0) if before is None else _motion(before, time, pose)
        if robot is not None:
            fastest = abs(motion[0]) + abs(motion[1]) * robot.wheel_separation / 2
            if fastest > JUMP * robot.top_speed:
                motion = 0.0, 0.0
        frames = [transform(time, self._odom, self._base, pose)]
        yield odometry(self._topic, time, self._odom, self._base, pose, motion)
        reference = next((r for r in REFERENCES if r in self._readings), None)
        if reference is not None and not self._own_localization:
            # Both poses belong to the same tick, because servers send ground truth, INS
            # and odometry in this order.
            place = self._readings[reference][1].compose(pose.inverse())
            frames.append(transform(time, MAP, self._odom, place))
        yield transforms("/tf", frames)


class RobotTopics:
    """Converts the reports and commands of one robot into topics under its name."""

    def __init__(
        self, name: str, legend: Legend, *, own_localization: bool = False
    ) -> None:
        """Create the topics of a robot that is not described yet.

        Args:
            name: Name of the robot in topics; see ``topic_name``. Empty for topics and
                frames without a prefix.
            legend: Numbers of objects, materials and kinds of echoes, for all robots.
            own_localization: Whether the transform from ``map`` to ``odom`` is left
                out.
        """
        self._name = name
        self._legend = legend
        self._scanners: tuple[ScannerInfo, ...] = ()
        self._robot: RobotInfo | None = None
        self._ins_mounts: Mapping[str, Pose3] = {}
        self._frames = RobotFrames(name, own_localization=own_localization)
        self._scan_times: dict[str, float] = {}  # time of the last scan, by scanner
        self._lines: dict[tuple[type[Report], str], list[Any]] = {}
        self._announced_spectra: set[str] = set()  # scanners whose layout was published
        self._description = ""

    def describe(
        self,
        robot: RobotInfo | None,
        scanners: Sequence[ScannerInfo],
        ins_mounts: Mapping[str, Pose3],
        time: float,
    ) -> list[Fields]:
        """Set the robot's description; return the mounting poses of its scanners."""
        self._robot, self._scanners = robot, tuple(scanners)
        self._ins_mounts = ins_mounts
        base = self._frame("base_link")
        return [
            transform(time, base, self._frame(each.name), each.mount)
            for each in scanners
        ]

    def description(self, name: str, body: RobotModel) -> Iterator[TopicMessage]:
        """Yield the URDF of the robot if it has changed; ``name`` is the full name."""
        text = robot_description(name, body, self._scanners, self._frame)
        if text != self._description:
            self._description = text
            yield string(self._topic("robot_description"), text)

    def of_report(self, report: Report) -> Iterator[TopicMessage]:
        """Yield the messages for a report of the robot; many reports have none."""
        match report:
            case RangeScan():
                yield self._scan(report)
            case EchoLine() | RadarTargets():
                yield from self._cloud(report)
            case Odometry(time, _, pose):
                placed = Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw)
                yield from self._frames.observe(Odometry, time, placed, self._robot)
            case GroundTruth(time, _, pose):
                yield pose_stamped(self._topic("ground_truth"), time, MAP, pose)
                yield from self._frames.observe(GroundTruth, time, pose, self._robot)
            case Ins(time, name, pose):
                # An INS reports its own pose, not the pose of the robot.
                if name in self._ins_mounts:
                    pose = pose.compose(self._ins_mounts[name].inverse())
                yield pose_stamped(self._topic("ins"), time, MAP, pose)
                yield from self._frames.observe(Ins, time, pose, self._robot)
            case _:
                pass

    def of_drive(self, command: Drive, time: float) -> TopicMessage | None:
        """Return a drive command as ``cmd_vel``, or None if it has no wheel speeds."""
        robot = self._robot
        speeds = command.left, command.right
        if robot is None or speeds[0] is None or speeds[1] is None:
            return None
        if command.normalized:
            # Normalized commands are in percent of the highest wheel speed.
            top = robot.max_wheel_speed / 100
        else:
            top = robot.wheel_radius / robot.drive_scale
        left, right = speeds[0] * top, speeds[1] * top
        turn = (right - left) / robot.wheel_separation
        topic, frame = self._topic("cmd_vel"), self._frame("base_link")
        return twist_stamped(topic, time, frame, (left + right) / 2, turn)

    def of_turn(
        self, scanner: str, time: float, bin_size: float, rows: NDArray[np.uint8]
    ) -> Iterator[TopicMessage]:
        """Yield a radar revolution as an image, and the layout before the first image.

        Args:
            scanner: Name of the scanner item.
            time: Start of the revolution, s.
            bin_size: Distance between range bins, m.
            rows: (A, 11 + B), one row for each azimuth, as in the Oxford Radar RobotCar
                data set: 11 bytes of time, encoder and validity, and B counts.
        """
        names = topic_name(scanner), "spectrum"
        # Subscribers need the layout to compute the ranges of bins; it is latched.
        if scanner not in self._announced_spectra:
            self._announced_spectra.add(scanner)
            layout = {"bin_size": bin_size, "metadata_bytes": METADATA_BYTES}
            yield string(self._topic(*names, "layout"), json.dumps(layout))
        yield grey_image(self._topic(*names), time, self._frame(scanner), rows)

    def of_picture(
        self, time: float, jpeg: bytes
    ) -> tuple[Fields, TopicMessage, TopicMessage]:
        """Return the pose of the camera on the robot, its picture and its intrinsics.

        Args:
            time: Simulated time, s.
            jpeg: The picture.

        Raises:
            OSError: If the data is no JPEG picture.
        """
        frame, base = self._frame(OPTICAL_FRAME), self._frame("base_link")
        topic = self._topic("camera", "camera_info")
        with Image.open(io.BytesIO(jpeg), formats=["JPEG"]) as opened:
            info = camera_info(topic, time, frame, *opened.size)
        topic = self._topic("camera", "image", "compressed")
        image = compressed_image(topic, time, frame, jpeg)
        return transform(time, base, frame, OPTICAL_MOUNT), image, info

    def _scan(self, scan: RangeScan) -> TopicMessage:
        known = self._scanner(scan.name)
        gaps = len(scan.ranges) - 1
        before = self._scan_times.get(scan.name, scan.time)
        self._scan_times[scan.name] = scan.time
        return laser_scan(
            self._topic(topic_name(scan.name), "scan"),
            scan.time,
            self._frame(scan.name),
            scan.ranges,
            fov=scan.fov,
            # The resolution in the line is rounded, and its error would add up over
            # hundreds of beams, so the angle between beams is computed from the field
            # of view.
            resolution=scan.fov / gaps if gaps else scan.resolution,
            min_range=known.min_range if known else 0.0,
            max_range=known.max_range if known else math.inf,
            scan_time=scan.time - before,
        )

    def _cloud(self, line: EchoLine | RadarTargets) -> Iterator[TopicMessage]:
        """Yield the points of a scan once its last line has arrived."""
        lines, scanner = self._lines_until(line), self._scanner(line.name)
        if not lines or scanner is None:
            return
        # A scan without echoes becomes an empty cloud.
        cloud = np.concatenate([self._points(each, scanner) for each in lines])
        name, frame = topic_name(line.name), self._frame(line.name)
        last = "targets"
        if isinstance(line, EchoLine):
            last = "echoes"
            yield from self._legend.news()  # names are published before the points
        else:
            topic = self._topic(name, "radar_scan")
            yield radar_scan(topic, line.time, frame, cloud)
        yield point_cloud(self._topic(name, last), line.time, frame, cloud)

    def _points(self, line: EchoLine | RadarTargets, scanner: ScannerInfo) -> Points:
        """Return the points of a line in the frame of its scanner."""
        if isinstance(line, RadarTargets):
            beams, ranges = line.beams, line.ranges
            points = np.zeros(len(beams), TARGET)
            points["dbm"] = line.dbm
        elif line.echoes is None:
            return np.zeros(0, ECHO)
        else:
            echoes, number = line.echoes, self._legend.number
            beams, ranges = echoes.beams, echoes.ranges
            points = np.zeros(len(beams), ECHO)
            points["intensity"], points["power"] = echoes.strength, echoes.power
            points["kind"] = [number("kind", kind) for kind in echoes.kinds]
            points["object"] = number("object", echoes.object)
            points["material"] = number("material", echoes.material)
        gaps = scanner.beams - 1
        step = scanner.fov / gaps if gaps else 0.0
        angles = beams * step - scanner.fov / 2  # relative to the forward axis
        points["beam"] = beams
        points["x"], points["y"] = ranges * np.cos(angles), ranges * np.sin(angles)
        return points

    def _lines_until(self, line: EchoLine | RadarTargets) -> list[Any]:
        """Return all lines of a scan when its last line arrives, else an empty list."""
        key = type(line), line.name.casefold()
        if line.line <= 1:  # the end of the last scan was lost
            self._lines[key] = []
        lines = self._lines.setdefault(key, [])
        lines.append(line)
        return self._lines.pop(key) if line.line >= line.lines else []

    def _scanner(self, name: str) -> ScannerInfo | None:
        found = (each for each in self._scanners if same_name(each.name, name))
        return next(found, None)

    def _topic(self, *names: str) -> str:
        return "/" + below(self._name, *names)

    def _frame(self, name: str) -> str:
        return below(self._name, name)


def below(robot: str, *names: str) -> str:
    """Prefix the name of a frame or a topic with the name of its robot, if any.

    >>> below("R1", "lms200", "scan"), below("", "odom")
    ('R1/lms200/scan', 'odom')
    """
    return "/".join((robot, *names) if robot else names)


def _motion(
    before: tuple[float, Pose3], time: float, pose: Pose3
) -> tuple[float, float]:
    """Return forward speed, m/s, and turn rate, rad/s, on an arc between two poses."""
    began, start = before
    turned = wrap_angle(pose.yaw - start.yaw)
    heading = start.yaw + turned / 2
    dx, dy = pose.x - start.x, pose.y - start.y
    chord = dx * math.cos(heading) + dy * math.sin(heading)
    if not time > began:
        return 0.0, 0.0
    arc = chord / float(np.sinc(turned / (2 * math.pi)))
    return arc / (time - began), turned / (time - began)


def topic_name(name: str) -> str:
    """Convert a name to letters, digits and underscores, as ROS topics require.

    >>> topic_name("lms 200"), topic_name("2nd")
    ('lms_200', '_2nd')
    """
    text = re.sub("[^A-Za-z0-9_]", "_", name) or "_"
    return f"_{text}" if text[0].isdigit() else text


UNKNOWN, FREE, OCCUPIED = -1, 0, 100  # cell values of ``nav_msgs/OccupancyGrid``


def sensed_map(
    grid: OccupancyGrid,
) -> tuple[tuple[float, float], float, NDArray[np.int8]]:
    """Return the sensed part of a map: corner, m, resolution, m, and cells, (R, C).

    The results are arguments of ``occupancy_grid``. The map must have sensed cells.
    Foliage is occupied, because robots collide with it.
    """
    levels = np.full(len(CellClass), FREE, np.int8)
    levels[CellClass.UNKNOWN] = UNKNOWN
    levels[[CellClass.OBSTACLE, CellClass.FOLIAGE]] = OCCUPIED
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    corner = x + columns.start * size, y + rows.start * size
    return corner, size, levels[grid.classes()[rows, columns]]
