"""From what one robot and its client say to each other to topics of ROS 2.

Points of echoes have numbers for the names of what they come from, which a ``Legend``
lists.
"""

import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radarsim.addons.fmcw.image_files import METADATA_BYTES
from radarsim.addons.recording.messages import (
    ECHO,
    TARGET,
    Fields,
    RosMessage,
    TopicMessage,
    camera_info,
    compressed_image,
    grey_image,
    laser_scan,
    make_points,
    occupancy_grid,
    point_cloud,
    pose_stamped,
    string,
    transform,
    twist_stamped,
)
from radarsim.addons.recording.robot_frames import MAP, RobotFrames, below
from radarsim.addons.recording.robot_model import robot_description
from radarsim.autonomy.mapping.export import sensed_window
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.client.robot_info import RobotInfo, ScannerInfo, same_name
from radarsim.geometry import Floats, Pose3
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

OPTICAL_FRAME: Final = "camera_optical"
# Its z axis looks ahead, x to the right and y down (REP-103).
OPTICAL_MOUNT: Final = MOUNT.compose(Pose3(0, 0, 0, -math.pi / 2, 0, -math.pi / 2))


class Legend:
    """Numbers names in the order in which they occur, from 0.

    Attributes:
        has_changed: Whether there are names that ``message`` has not told yet.
    """

    def __init__(self) -> None:
        self.has_changed = True
        self._names: dict[str, dict[str, int]] = {
            "kind": {},
            "object": {},
            "material": {},
        }

    def number(self, field: Literal["kind", "object", "material"], name: str) -> int:
        """Return the number of a name in a field of points."""
        names = self._names[field]
        if name not in names:
            if len(names) > _LARGEST:
                return _LARGEST
            names[name] = len(names)
            self.has_changed = True
        return names[name]

    def message(self) -> RosMessage:
        """Return all names as JSON: a list for each of the fields of points."""
        self.has_changed = False
        names = {key: list(each) for key, each in self._names.items()}
        return string(json.dumps(names))


_LARGEST = 65535  # of 16 bits; it stands for all names after the first 65535

Line = TypeVar("Line", EchoLine, RadarTargets)


class RobotTopics:
    """The topics of one robot, below its name."""

    def __init__(
        self, name: str, legend: Legend, *, own_localization: bool = False
    ) -> None:
        """Begin with a robot of which nothing else is known.

        Args:
            name: Name of the robot as part of topics; see ``topic_name``. Empty for
                topics and frames that begin with no name.
            legend: The names of what echoes come from, for all robots.
            own_localization: Whether the pose of ``odom`` in ``map`` is left out.
        """
        self._name = name
        self._legend = legend
        self._scanners: tuple[ScannerInfo, ...] = ()
        self._robot: RobotInfo | None = None
        self._ins_mounts: Mapping[str, Pose3] = {}
        self._frames = RobotFrames(name, own_localization=own_localization)
        self._scan_times: dict[str, float] = {}  # of the latest, by scanner
        self._lines: dict[tuple[type[Report], str], list[Any]] = {}
        self._told_spectra: set[str] = set()  # scanners
        self._description = ""

    def describe(
        self,
        robot: RobotInfo | None,
        scanners: Sequence[ScannerInfo],
        ins_mounts: Mapping[str, Pose3],
        time: float,
    ) -> list[Fields]:
        """Use what is known of the robot from now on; return where its scanners are."""
        self._robot, self._scanners = robot, tuple(scanners)
        self._ins_mounts = ins_mounts
        base = self._frame("base_link")
        return [
            transform(time, base, self._frame(each.name), each.mount)
            for each in scanners
        ]

    def description(self, name: str, body: RobotModel) -> Iterator[TopicMessage]:
        """Yield the description of a robot of this name, if it has changed."""
        text = robot_description(name, body, self._scanners, self._frame)
        if text != self._description:
            self._description = text
            topic = self._topic("robot_description")
            yield TopicMessage(topic, string(text), latched=True)

    def of_report(self, report: Report) -> Iterator[TopicMessage]:
        """Yield the messages that a report of the robot becomes; many become none."""
        match report:
            case RangeScan():
                yield self._scan(report)
            case EchoLine():
                yield from self._echo_cloud(report)
            case RadarTargets():
                yield from self._target_cloud(report)
            case Odometry(time, _, pose):
                placed = Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw)
                yield from self._frames.observe(Odometry, time, placed, self._robot)
            case GroundTruth(time, _, pose):
                topic = self._topic("ground_truth")
                yield TopicMessage(topic, pose_stamped(time, MAP, pose))
                yield from self._frames.observe(GroundTruth, time, pose, self._robot)
            case Ins(time, name, pose):
                # An INS reads its own pose, and not that of the robot.
                if name in self._ins_mounts:
                    pose = pose.compose(self._ins_mounts[name].inverse())
                topic = self._topic("ins")
                yield TopicMessage(topic, pose_stamped(time, MAP, pose))
                yield from self._frames.observe(Ins, time, pose, self._robot)
            case _:
                pass

    def of_drive(self, command: Drive, time: float) -> TopicMessage | None:
        """Return the motion that a command asks for; None if it asks for none."""
        robot = self._robot
        speeds = command.left, command.right
        if robot is None or speeds[0] is None or speeds[1] is None:
            return None
        if command.normalized:
            # Normalized commands are percent of the highest wheel speed.
            top = robot.max_wheel_speed / 100
        else:
            top = robot.wheel_radius / robot.drive_scale
        left, right = speeds[0] * top, speeds[1] * top
        turn = (right - left) / robot.wheel_separation
        frame = self._frame("base_link")
        message = twist_stamped(time, frame, (left + right) / 2, turn)
        return TopicMessage(self._topic("cmd_vel"), message)

    def of_turn(
        self, scanner: str, time: float, bin_size: float, rows: NDArray[np.uint8]
    ) -> Iterator[TopicMessage]:
        """Yield a turn of a radar as a picture, after its layout if that is the first.

        Args:
            scanner: Name of the scanner item.
            time: When it began, s.
            bin_size: Distance between range bins, m.
            rows: (A, 11 + B), a row for each direction as images of Oxford's data set
                have them: 11 bytes of time, encoder and validity, and the counts.
        """
        names = topic_name(scanner), "spectrum"
        # Readers need it to place the bins; whoever subscribes later gets it as well.
        if scanner not in self._told_spectra:
            self._told_spectra.add(scanner)
            layout = {"bin_size": bin_size, "metadata_bytes": METADATA_BYTES}
            topic = self._topic(*names, "layout")
            yield TopicMessage(topic, string(json.dumps(layout)), latched=True)
        picture = grey_image(time, self._frame(scanner), rows)
        yield TopicMessage(self._topic(*names), picture)

    def of_picture(
        self, time: float, jpeg: bytes
    ) -> tuple[Fields, TopicMessage, TopicMessage]:
        """Return where the camera is, its picture, and its intrinsics.

        Args:
            time: Simulated time, s.
            jpeg: The picture.

        Raises:
            OSError: If it is no picture.
        """
        frame, base = self._frame(OPTICAL_FRAME), self._frame("base_link")
        with Image.open(io.BytesIO(jpeg), formats=["JPEG"]) as opened:
            info = camera_info(time, frame, *opened.size)
        image = compressed_image(time, frame, jpeg)
        return (
            transform(time, base, frame, OPTICAL_MOUNT),
            TopicMessage(self._topic("camera", "image", "compressed"), image),
            TopicMessage(self._topic("camera", "camera_info"), info),
        )

    def _scan(self, scan: RangeScan) -> TopicMessage:
        known = self._scanner(scan.name)
        gaps = len(scan.ranges) - 1
        before = self._scan_times.get(scan.name, scan.time)
        self._scan_times[scan.name] = scan.time
        message = laser_scan(
            scan.time,
            self._frame(scan.name),
            scan.ranges,
            fov=scan.fov,
            # The resolution is rounded on the wire, which adds up over hundreds of
            # beams.
            resolution=scan.fov / gaps if gaps else scan.resolution,
            min_range=known.min_range if known else 0.0,
            max_range=known.max_range if known else math.inf,
            scan_time=scan.time - before,
        )
        return TopicMessage(self._topic(topic_name(scan.name), "scan"), message)

    def _echo_cloud(self, line: EchoLine) -> Iterator[TopicMessage]:
        """Yield the echoes of a scan once its last line has come."""
        lines, scanner = self._lines_until(line), self._scanner(line.name)
        if not lines or scanner is None:
            return
        points = []
        for echoes in (each.echoes for each in lines if each.echoes is not None):
            kinds = [self._legend.number("kind", kind) for kind in echoes.kinds]
            object_ = self._legend.number("object", echoes.object)
            material = self._legend.number("material", echoes.material)
            columns: dict[str, NDArray[np.generic]] = {
                "intensity": echoes.strength,
                "power": echoes.power,
                "beam": echoes.beams,
                "kind": np.array(kinds),
                "object": np.full(len(kinds), object_),
                "material": np.full(len(kinds), material),
            }
            angles = _angles(scanner, echoes.beams)
            points.append(make_points(ECHO, angles, echoes.ranges, columns))
        # First the names, then the points that have their numbers.
        if self._legend.has_changed:
            yield TopicMessage("/radarsim/legend", self._legend.message(), latched=True)
        # A scan without echoes is a message too: it tells that there were none.
        cloud = np.concatenate([np.zeros(0, ECHO), *points])
        message = point_cloud(line.time, self._frame(line.name), cloud)
        yield TopicMessage(self._topic(topic_name(line.name), "echoes"), message)

    def _target_cloud(self, line: RadarTargets) -> Iterator[TopicMessage]:
        """Yield the targets of a turn once its last line has come."""
        lines, scanner = self._lines_until(line), self._scanner(line.name)
        if not lines or scanner is None:
            return
        beams, ranges, dbm = (
            np.concatenate([getattr(each, name) for each in lines])
            for name in ("beams", "ranges", "dbm")
        )
        columns = {"dbm": dbm, "beam": beams}
        cloud = make_points(TARGET, _angles(scanner, beams), ranges, columns)
        message = point_cloud(line.time, self._frame(line.name), cloud)
        yield TopicMessage(self._topic(topic_name(line.name), "targets"), message)

    def _lines_until(self, line: Line) -> list[Line]:
        """Return all lines of a scan with its last one; nothing before that."""
        key = type(line), line.name.casefold()
        if line.line <= 1:  # the end of the scan before was dropped on its way
            self._lines[key] = []
        lines = self._lines.setdefault(key, [])
        lines.append(line)
        return self._lines.pop(key) if line.line >= line.lines else []

    def _scanner(self, name: str) -> ScannerInfo | None:
        found = [each for each in self._scanners if same_name(each.name, name)]
        return found[0] if found else None

    def _topic(self, *names: str) -> str:
        return "/" + below(self._name, *names)

    def _frame(self, name: str) -> str:
        return below(self._name, name)


def _angles(scanner: ScannerInfo, beams: NDArray[np.int64]) -> Floats:
    """Return the directions of beams, rad, counter-clockwise from straight ahead."""
    gaps = scanner.beams - 1
    step = scanner.fov / gaps if gaps else 0.0
    return np.asarray(beams * step - scanner.fov / 2)


def topic_name(name: str) -> str:
    """Return a name as part of a topic of ROS: letters, digits and underscores.

    >>> topic_name("lms 200"), topic_name("2nd")
    ('lms_200', '_2nd')
    """
    letters = [c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name]
    text = "".join(letters) or "_"
    return f"_{text}" if text[0].isdigit() else text


UNKNOWN, FREE, OCCUPIED = -1, 0, 100  # of ``nav_msgs/OccupancyGrid``


def map_topic(
    time: float, cells: NDArray[np.int8], corner: tuple[float, float], resolution: float
) -> TopicMessage:
    """Return the message of ``/map``; see ``occupancy_grid``."""
    grid = occupancy_grid(time, MAP, cells, Pose3(*corner, 0.0), resolution)
    return TopicMessage("/map", grid, latched=True)


def sensed_map(grid: OccupancyGrid, time: float) -> TopicMessage:
    """Return the sensed part of a map; foliage is occupied: robots drive into it.

    Args:
        grid: The map; it has cells.
        time: Simulated time, s.
    """
    levels = np.full(len(CellClass), FREE, np.int8)
    levels[CellClass.UNKNOWN] = UNKNOWN
    levels[[CellClass.OBSTACLE, CellClass.FOLIAGE]] = OCCUPIED
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    corner = x + columns.start * size, y + rows.start * size
    return map_topic(time, levels[grid.classes()[rows, columns]], corner, size)
