"""The reports of a server: classes that encode lines and decode lines.

Reports are in REP-103 frames and SI units and not rounded. Attributes are annotated
with the fields that write and read them; ``dialect`` defines decimals and rounding. A
line is ASCII and never contains an exponent, NaN or an infinity.
``decode_report`` reads the lines of servers of all generations. A time of NaN means
that the line has no time stamp.
"""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import isnan, nan
from typing import Annotated, ClassVar, Final, Self, TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import EchoLine as EchoLine
from radarsim.protocol.echoes import RadarTargets as RadarTargets
from radarsim.protocol.echoes import TargetEchoes as TargetEchoes
from radarsim.protocol.fields import (
    BodyAngles,
    Field,
    Flag,
    FormattedField,
    ItemReport,
    Layouts,
    LineReport,
    Number,
    Numbers,
    Point,
    Pose,
    Rows,
    Segment,
    Series,
    Split,
    Text,
    WheelPose,
    Whole,
)
from radarsim.protocol.fields import SensorReport as SensorReport
from radarsim.protocol.geo_conf import AerialConf as AerialConf
from radarsim.protocol.geo_conf import AerialGeo as AerialGeo
from radarsim.protocol.geo_conf import CameraConf as CameraConf
from radarsim.protocol.geo_conf import CameraLimits as CameraLimits
from radarsim.protocol.geo_conf import EncoderConf as EncoderConf
from radarsim.protocol.geo_conf import IntervalConf as IntervalConf
from radarsim.protocol.geo_conf import ItemConf as ItemConf
from radarsim.protocol.geo_conf import ItemGeo as ItemGeo
from radarsim.protocol.geo_conf import NameConf as NameConf
from radarsim.protocol.geo_conf import RobotConf as RobotConf
from radarsim.protocol.geo_conf import RobotGeo as RobotGeo
from radarsim.protocol.geo_conf import ScannerConf as ScannerConf
from radarsim.protocol.geo_conf import SonarConf as SonarConf
from radarsim.protocol.geo_conf import TouchConf as TouchConf
from radarsim.protocol.geo_conf import decode_conf, decode_geo, is_aerial
from radarsim.protocol.line_template import (
    FLIPPED,
    WHOLE,
    WRAPPED,
    NumberFormat,
    marks,
    printable_name,
)
from radarsim.protocol.message import (
    Message,
    Triple,
    decode_message,
    parse_flag,
    parse_flipped,
    parse_number,
    parse_numbers,
    parse_triple,
    wrapped_pose,
)
from radarsim.protocol.packages import PackageConf as PackageConf
from radarsim.protocol.packages import PackageGeo as PackageGeo
from radarsim.protocol.packages import PackageState as PackageState
from radarsim.protocol.rescue import GasDensity as GasDensity
from radarsim.protocol.rescue import HumanMotion as HumanMotion
from radarsim.protocol.rescue import RfidTags as RfidTags
from radarsim.protocol.rescue import Sound as Sound
from radarsim.protocol.rescue import VictimParts as VictimParts
from radarsim.protocol.watch import ClockTick as ClockTick
from radarsim.protocol.watch import CommandError as CommandError
from radarsim.protocol.watch import RobotJoined as RobotJoined
from radarsim.protocol.watch import RobotLeft as RobotLeft
from radarsim.protocol.watch import Watching as Watching
from radarsim.protocol.watch import is_seen, see_head, split_seen

MOST_KEPT: Final = 4096  # cached templates of scan lines; a robot needs a few
_KEPT: Final[dict[Hashable, tuple[bytes, Sequence[float]]]] = {}
_SIGNS: Final = {"N": 1, "E": 1, "S": -1, "W": -1}
LONGEST_LINE: Final = 4095  # bytes with line end; some clients have buffers of 4096


class Greeting(LineReport):
    """The first line from a server; ``level`` is the name of the map."""

    verb: ClassVar[str] = "NFO"
    layouts: ClassVar[Layouts] = {
        "compat": "{Gametype BotDeathMatch} {Level} {TimeLimit 0}",
        "udk": "{Gametype BotDeathMatch} {Level} {TimeLimit 20}",
    }

    level: Annotated[str, Text("Level")]


@dataclass(frozen=True, slots=True)
class StartPoses:
    """The start poses of the map by name."""

    poses: tuple[tuple[str, Pose3], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Create the report from a parsed line with the names and poses of the starts.

        Raises:
            MalformedMessage: If a pose is not readable.
        """
        keys = [key.lower() for key, _ in message.segments]
        lists = message.segments[keys.index("startposes") + 1 :]
        words = [word for key, value in lists for word in (key, *value.split())]
        if len(words) % 3:
            text = f"start poses {' '.join(words)[:80]!r}"
            raise MalformedMessage(
                f"{text}, expected 'name x,y,z roll,pitch,yaw' for each"
            )
        rows = zip(words[::3], words[1::3], words[2::3], strict=True)
        return cls(
            tuple(
                (name, wrapped_pose(parse_flipped(position), parse_flipped(angles)))
                for name, position, angles in rows
            )
        )

    def encode(self, dialect: Dialect) -> str:
        """Encode as many start poses as fit in a line, without a line end.

        Raises:
            ValueError: If a number is not finite.
        """
        join = dialect.start_pose.join_flipped
        numbers = [(name, pose.numbers()) for name, pose in self.poses]
        poses = [f"{name} {join(n[:3])} {join(n[3:], WRAPPED)}" for name, n in numbers]
        # Some clients have a line buffer of limited size, so only the poses that fit
        # are sent. No pose is cut, because clients parse triples of words.
        limit = LONGEST_LINE - len("NFO {StartPoses 1000} {}\r\n")
        ends = accumulate(len(pose) + 1 for pose in poses)
        poses = poses[: sum(end - 1 <= limit for end in ends)]
        count = f"NFO {{StartPoses {len(poses)}}}"
        return f"{count} {{{' '.join(poses)}}}" if poses else count


class BatteryLife(Field[int]):
    """A field with the remaining battery time, s; 0 if the field is missing."""

    def read(self, message: Message) -> int:
        return int(message.parse_optional(self.key, parse_number) or 0)

    def write(self, value: int, dialect: Dialect) -> Sequence[Segment]:
        # UsarCommander stops a robot permanently when it reads a battery time of 0.
        least = 0 if dialect.battery_runs_out else 1
        return (Segment(self.key, WHOLE, (max(value, least),)),)


class SteeringAngles(FormattedField[tuple[float, float] | None]):
    """Two fields with the angles of steered wheels; None for a robot without any.

    On the wire, angles to the right are positive, and both angles of a skid-steered
    robot are 0.
    """

    def __init__(self, key: str, other_key: str) -> None:
        super().__init__(key, "robot")
        self._other_key = other_key

    def read(self, message: Message) -> tuple[float, float] | None:
        front = message.parse_optional(self.key, parse_number) or 0.0
        rear = message.parse_optional(self._other_key, parse_number) or 0.0
        return (0.0 - front, 0.0 - rear) if front or rear else None

    def write(
        self, value: tuple[float, float] | None, dialect: Dialect
    ) -> Sequence[Segment]:
        keys = (self.key, self._other_key)
        if value is None:
            return [Segment(key, dialect.no_steering) for key in keys]
        # Steering angles are positive to the right on the wire, so their signs are
        # inverted.
        text = FLIPPED + marks(self.format(dialect))
        return [
            Segment(k, text, (angle,)) for k, angle in zip(keys, value, strict=True)
        ]


class Headlight(Field[bool]):
    """Two fields with the state of the headlight, written as text of a template."""

    def read(self, message: Message) -> bool:
        return parse_flag(message.get(self.key) or "")

    def write(self, value: bool, _: Dialect) -> Sequence[Segment]:
        intensity = Segment("LightIntensity", "100" if value else "0")
        return (Segment(self.key, str(value)), intensity)


class Status(LineReport):
    """The state of a robot: its battery, headlight and steering.

    Attributes:
        time: Simulated time, s.
        battery: Remaining battery time, s.
        light: Whether the headlight is on.
        steering: Angles of the front and the rear wheels, rad, left positive; None
            without a steering axle.
    """

    verb: ClassVar[str] = "STA"
    layouts: ClassVar[Layouts] = {
        "compat": "{Type GroundVehicle} {Time} {FrontSteer} {RearSteer}"
        " {LightToggle} {LightIntensity} {Battery} {View -1}",
        "udk": "{Time} {Battery} {Type GroundVehicle} {LightToggle}"
        " {LightIntensity 100} {FrontSteer} {RearSteer}",
    }

    time: Annotated[float, Number("Time", "time", default=nan)]
    battery: Annotated[int, BatteryLife("Battery")]
    light: Annotated[bool, Headlight("LightToggle")]
    steering: Annotated[
        tuple[float, float] | None, SteeringAngles("FrontSteer", "RearSteer")
    ] = None


class AerialStatus(Status):
    """The state of a flying robot: its battery and headlight."""

    layouts: ClassVar[Layouts] = {
        "compat": "{Type AerialVehicle} {Time} {LightToggle} {LightIntensity}"
        " {Battery} {View -1}",
        "udk": "{Time} {Battery} {Type AerialVehicle} {LightToggle}"
        " {LightIntensity 100}",
    }


@dataclass(frozen=True, slots=True)
class CrateStates:
    """The names, sizes and poses of crates, as reported to a client.

    Attributes:
        crates: Name, size (length, width, height, m) and pose of each crate.
    """

    crates: tuple[tuple[str, Triple, Pose3], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Create the report from the fields of a parsed line.

        Raises:
            MalformedMessage: If the line does not consist of the four fields of each
                crate in order, or a field is not readable.
        """
        keys = [key.lower() for key, _ in message.segments]
        if keys != ["name", "size", "location", "rotation"] * (len(keys) // 4):
            expected = "Name, Size, Location, Rotation per crate"
            raise MalformedMessage(f"fields {keys!r:.80}, expected {expected}")
        texts = [text for _, text in message.segments]
        rows = zip(*(texts[k::4] for k in range(4)), strict=True)
        return cls(
            tuple(
                (
                    name,
                    parse_triple(size),
                    wrapped_pose(parse_flipped(place), parse_flipped(angles)),
                )
                for name, size, place, angles in rows
            )
        )

    def encode(self, dialect: Dialect) -> str:
        """Encode the report as a line without a line end."""
        join, fields = dialect.robot.join_flipped, []
        for name, size, pose in self.crates:
            numbers = pose.numbers()
            fields.append(
                f" {{Name {printable_name(name)}}} {{Size {dialect.robot.join(size)}}}"
                f" {{Location {join(numbers[:3])}}}"
                f" {{Rotation {join(numbers[3:], WRAPPED)}}}"
            )
        return f"STA{''.join(fields)}"


class RangeScan(ItemReport, eq=False):
    """One scan of a laser or radar, with a range for each beam.

    Attributes:
        resolution: Angle between neighbouring beams, rad.
        fov: Angle between the first beam and the last, rad.
        ranges: (N,) range of each beam, m, counter-clockwise from the right; always
            finite: a beam without return has the maximum range.
    """

    sensor_type: ClassVar[str] = "RangeScanner"

    resolution: Annotated[float, Number("Resolution", "angle")]
    fov: Annotated[float, Number("FOV", "angle")]
    ranges: Annotated[Floats, Series("Range", "ranges")]

    @property
    def angles(self) -> Floats:
        """Angles of the beams, (N,) rad; 0 is ahead of the scanner.

        The angles are computed from the field of view and the number of ranges. The
        resolution has few digits; its error would add up to half a degree over a scan.
        """
        return np.linspace(-self.fov / 2, self.fov / 2, len(self.ranges))

    def split(self, dialect: Dialect) -> Split:
        if isnan(self.time):
            return ItemReport.split(self, dialect)
        key = (dialect, self.name, self.resolution, self.fov, len(self.ranges))
        # Scans make up most of a server's output. Scans of one scanner differ only in
        # time and ranges, so the template of their lines is cached.
        if key not in _KEPT:
            if len(_KEPT) >= MOST_KEPT:
                _KEPT.clear()
            template, numbers, _ = ItemReport.split(self, dialect)
            _KEPT[key] = template, numbers[1:]
        template, fan = _KEPT[key]
        return template, (self.time, *fan), self.ranges


class GroundTruth(ItemReport):
    """The true pose of the robot's body in the map frame."""

    sensor_type: ClassVar[str] = "GroundTruth"

    pose: Annotated[Pose3, Pose("truth")]


class Ins(ItemReport):
    """The pose of the robot, map frame, as its inertial navigation system estimates."""

    sensor_type: ClassVar[str] = "INS"

    pose: Annotated[Pose3, Pose("ins")]


class Odometry(ItemReport):
    """The pose of the robot by wheel odometry, relative to its spawn pose."""

    sensor_type: ClassVar[str] = "Odometry"

    pose: Annotated[Pose2, WheelPose("Pose", "plain")]


class Tachometer(ItemReport):
    """The angular speed of each wheel, rad/s, and its total rotation angle, rad."""

    sensor_type: ClassVar[str] = "Tachometer"

    velocities: Annotated[tuple[float, ...], Numbers("Vel", "plain")]
    positions: Annotated[tuple[float, ...], Numbers("Pos", "plain")]


class Encoder(SensorReport):
    """The name and the tick count of each wheel encoder of a robot."""

    sensor_type: ClassVar[str] = "Encoder"
    item_keys: ClassVar[tuple[str, ...]] = ("Tick",)

    ticks: Annotated[tuple[tuple[str, int], ...], Rows(Text("Name"), Whole("Tick"))]


class Touch(ItemReport):
    """A reading of a touch sensor: whether an object touches the robot."""

    sensor_type: ClassVar[str] = "Touch"
    item_keys: ClassVar[tuple[str, ...]] = ("Touch",)

    touched: Annotated[bool, Flag("Touch")]


class Acceleration(ItemReport):
    """The acceleration of a sensor without gravity, m/s2, along the sensor's axes."""

    sensor_type: ClassVar[str] = "Accel"

    acceleration: Annotated[Triple, Point("Acceleration", "robot")]


class ProperAcceleration(ItemReport):
    """The acceleration of a sensor with gravity, m/s2, along the sensor's axes."""

    sensor_type: ClassVar[str] = "AcceleroMeter"

    acceleration: Annotated[Triple, Point("ProperAcceleration", "robot")]


class Imu(ItemReport):
    """A reading of an inertial measurement unit: accelerations, rates and angles.

    Attributes:
        acceleration: Acceleration, m/s2, along the axes of the sensor.
        rates: Rates of roll, pitch and yaw, rad/s.
        rate_changes: Rates of change of ``rates``, rad/s2.
        angles: Roll, pitch and yaw of the body, rad.
    """

    sensor_type: ClassVar[str] = "IMU"

    acceleration: Annotated[Triple, Point("XYZAcceleration", "robot")]
    rates: Annotated[Triple, Point("AngularVel", "robot")]
    rate_changes: Annotated[Triple, Point("AngularAccel", "robot")]
    angles: Annotated[Triple, BodyAngles("Rotation", "robot")]


class Altitude(ItemReport):
    """The height of the robot above its spawn position and above sea level, m."""

    sensor_type: ClassVar[str] = "AltitudeSensor"

    above_start: Annotated[float, Number("relativeAltitude", "robot")]
    above_sea: Annotated[float, Number("absoluteAltitude", "robot")]


class CompassAngle(FormattedField[float]):
    """A field with an angle from north, rad, which is clockwise on the wire only."""

    def read(self, message: Message) -> float:
        return 0.0 - message.parse(self.key, parse_number)

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        text = FLIPPED + WRAPPED + marks(self.format(dialect))
        return (Segment(self.key, text, (value,)),)


class Compass(ItemReport):
    """The heading of the robot, rad, from north, which is the x axis of the map."""

    sensor_type: ClassVar[str] = "MagneticCompass"

    heading: Annotated[float, CompassAngle("MagneticAngle", "plain")]


class MissionTime(ItemReport):
    """The time since the robot was spawned, in whole minutes."""

    sensor_type: ClassVar[str] = "MissionTime"

    minutes: Annotated[int, Whole("Minutes")]


class Sonar(SensorReport):
    """The ranges of a robot's sonars.

    Attributes:
        ranges: Name and range of each sonar, m; a sonar without return has its maximum
            range.
    """

    sensor_type: ClassVar[str] = "Sonar"
    item_keys: ClassVar[tuple[str, ...]] = ("Range",)

    ranges: Annotated[
        tuple[tuple[str, float], ...], Rows(Text("Name"), Number("Range", "robot"))
    ]


class GlobePosition(Field[tuple[float, float] | None]):
    """A field with latitude and longitude; None if the receiver has no GPS fix."""

    def read(self, message: Message) -> tuple[float, float] | None:
        if message.parse("Fix", parse_number) != 1:
            return None
        latitude = message.parse(self.key, _parse_degrees)
        return latitude, message.parse("Longitude", _parse_degrees)

    def write(
        self, value: tuple[float, float] | None, dialect: Dialect
    ) -> Sequence[Segment]:
        if value is None:
            return (Segment("Fix", "0"),)
        written = []
        for key, angle, letters in zip(
            (self.key, "Longitude"), value, ("NS", "EW"), strict=True
        ):
            letter, *numbers = _split_degrees(angle, letters, dialect.robot)
            text = f"{WHOLE},{marks(dialect.robot)},{letter}"
            written.append(Segment(key, text, numbers))
        return (*written, Segment("Fix", "1"))


class Gps(ItemReport):
    """A reading of a GPS receiver: latitude and longitude of the robot.

    Attributes:
        position: Latitude and longitude, degrees, north and east positive; None without
            a fix.
        satellites: Number of satellites in sight.
    """

    sensor_type: ClassVar[str] = "GPS"

    position: Annotated[tuple[float, float] | None, GlobePosition("Latitude")]
    satellites: Annotated[int, Whole("Satellites")]


@dataclass(frozen=True, slots=True)
class WatchedLine:
    """A copy of a line that the server sent to the client of another robot.

    Attributes:
        robot: Name of the robot.
        line: The line, without its end.
        report: The decoded line; None for an unknown kind of report, or if decoding was
            not requested.
    """

    robot: str
    line: str
    report: "Report | None"

    @classmethod
    def decode(cls, text: str, *, reads_report: bool = True) -> Self:
        """Parse a copied line, and also its report unless ``reads_report`` is False.

        Raises:
            MalformedMessage: If the text is no copied line, or the report is not
                readable.
        """
        robot, line = split_seen(text)
        is_read = reads_report and not is_seen(line)
        report = decode_report(line) if is_read else None
        return cls(robot, line, report)

    def encode(self, _: Dialect) -> str:
        """Return the copied line, prefixed by ``SEE {Robot name}``, without its end."""
        return f"{see_head(self.robot).decode('ascii')}{self.line}"


Report: TypeAlias = LineReport | StartPoses | CrateStates | WatchedLine

# Keys of NFO lines. The first of these keys that is in a line determines its class.
_INFOS: Final = (
    *(("StartPoses", StartPoses), ("Clock", ClockTick), ("Watching", Watching)),
    *(("Joined", RobotJoined), ("Level", Greeting), ("Left", RobotLeft)),
    ("Error", CommandError),
)
# Classes of all sensor reports in this module, by the value of ``Type`` in the line.
_SENSOR_REPORTS: Final[dict[str, type[SensorReport]]] = {
    each.sensor_type.lower(): each
    for each in list(globals().values())
    if isinstance(each, type)
    and issubclass(each, SensorReport)
    and hasattr(each, "sensor_type")
}


def decode_report(line: str, *, reads_copies: bool = True) -> Report | None:
    """Parse a line from a server; return None for an unknown kind of report.

    Args:
        line: The line.
        reads_copies: Whether to decode the reports in copied lines of other robots.

    >>> decode_report("NFO {Gametype BotDeathMatch} {Level DM-Yard} {TimeLimit 0}")
    Greeting(level='DM-Yard')

    Raises:
        MalformedMessage: If the line is not a message, or a field of a known report is
            missing or not readable.
    """
    if is_seen(line):
        return WatchedLine.decode(line, reads_report=reads_copies)
    message = decode_message(line)
    decode = _DECODERS.get(message.verb.upper())
    return decode(message) if decode else None


def to_bytes(lines: Iterable[str]) -> bytes:
    r"""Encode lines as bytes to send, with CRLF after each line.

    >>> to_bytes(["NFO {StartPoses 0}"])
    b'NFO {StartPoses 0}\r\n'
    """
    return "".join([f"{line}\r\n" for line in lines]).encode("ascii", "replace")


def _decode_info(message: Message) -> Report | None:
    for key, report in _INFOS:
        if message.get(key) is not None:
            return report.decode(message)
    return None


def _decode_status(message: Message) -> Report:
    if message.get("Size") is not None:  # only crates have a size
        return CrateStates.decode(message)
    return (AerialStatus if is_aerial(message) else Status).decode(message)


def _decode_reading(message: Message) -> Report | None:
    report = _SENSOR_REPORTS.get((message.get("Type") or "").lower())
    return report.decode(message) if report else None


def _split_degrees(
    angle: float, letters: str, minutes_format: NumberFormat
) -> tuple[str, float, float]:
    """Split a latitude or longitude into a letter for its sign, degrees and minutes.

    Raises:
        ValueError: If the angle is not finite.
    """
    degrees, minutes = divmod(abs(angle) * 60, 60)
    written = minutes
    # Formatting is slow, so it is used only if rounding may give 0 or 60 minutes.
    if not 0.1 < minutes < 59.9:
        written = float(minutes_format.format(minutes))
        if written == 60.0:
            degrees, minutes = degrees + 1, 0.0
    is_negative = angle < 0 and (degrees > 0 or written > 0)
    return letters[is_negative], degrees, minutes


def _parse_degrees(text: str) -> float:
    """Parse a latitude or longitude in degrees and minutes, with N, S, E or W.

    Raises:
        MalformedMessage: If the text is not two numbers and a letter.
    """
    numbers, _, letter = text.rpartition(",")
    sign = _SIGNS.get(letter.strip().upper())
    if sign is None:
        raise MalformedMessage(
            f"{text[:80]!r}, expected degrees, minutes, and N, S, E or W"
        )
    degrees, minutes = parse_numbers(numbers, 2)
    return sign * (degrees + minutes / 60)


_DECODERS: Final[dict[str, Callable[[Message], Report | None]]] = {
    "NFO": _decode_info,
    "STA": _decode_status,
    "MISSTA": PackageState.decode,
    "ASTA": PackageState.decode,
    "SEN": _decode_reading,
    "GEO": decode_geo,
    "CONF": decode_conf,
}
