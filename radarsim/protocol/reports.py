"""The reports of a server, from lines and to lines.

Reports are in REP-103 frames and SI units and not rounded. A report writes itself:
``encode`` converts to the axes of the wire and takes digits, keys and their order from
the dialect. A line is ASCII, has single blanks, and never contains an exponent, NaN or
an infinity. ``decode_report`` reads the lines of servers of all generations.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from typing import Final, Self, TypeAlias

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import EchoLine, TargetEchoes
from radarsim.protocol.geo_conf import (
    VEHICLE,
    EncoderConf,
    IntervalConf,
    ItemGeo,
    NameConf,
    RobotConf,
    RobotGeo,
    ScannerConf,
    SonarConf,
    TouchConf,
    decode_conf,
    decode_geo,
    select_fields,
)
from radarsim.protocol.line_template import (
    NO_SERIES,
    WHOLE,
    marks,
    template,
)
from radarsim.protocol.message import (
    Message,
    decode_message,
    parse_flipped,
    wrapped_pose,
    wrapped_pose_on_wire,
)
from radarsim.protocol.numbers import parse_flag, parse_number
from radarsim.protocol.periodic_reports import NumberedReport, SensorReport, Split
from radarsim.protocol.sensor_reports import (
    Encoder,
    Gps,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Sonar,
    Tachometer,
    Touch,
)
from radarsim.protocol.targets import RadarTargets
from radarsim.protocol.watch import (
    CommandError,
    RobotJoined,
    RobotLeft,
    Watching,
    is_seen,
    see_head,
    split_seen,
)

__all__ = [
    "CommandError",
    "EchoLine",
    "Encoder",
    "EncoderConf",
    "Gps",
    "Greeting",
    "GroundTruth",
    "Ins",
    "IntervalConf",
    "ItemGeo",
    "NameConf",
    "Odometry",
    "RadarTargets",
    "RangeScan",
    "Report",
    "RobotConf",
    "RobotGeo",
    "RobotJoined",
    "RobotLeft",
    "ScannerConf",
    "SensorReport",
    "Sonar",
    "SonarConf",
    "StartPoses",
    "Status",
    "Tachometer",
    "TargetEchoes",
    "Touch",
    "TouchConf",
    "WatchedLine",
    "Watching",
    "decode_report",
    "to_bytes",
]

LONGEST_LINE: Final = 4095  # bytes with its end; clients read into buffers of 4096


@dataclass(frozen=True, slots=True)
class Greeting:
    """The first line on a connection; ``level`` is the name of the map."""

    level: str

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end."""
        fields = (
            ("Gametype", dialect.gametype),
            ("Level", self.level),
            ("TimeLimit", str(dialect.time_limit)),
        )
        return Message("NFO", fields).encode()


@dataclass(frozen=True, slots=True)
class StartPoses:
    """The start poses of the map by name."""

    poses: tuple[tuple[str, Pose3], ...]

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message, which lists the poses after their count.

        Raises:
            MalformedMessage: If a pose is not readable.
        """
        keys = [key.lower() for key, _ in message.segments]
        lists = message.segments[keys.index("startposes") + 1 :]
        words = [word for key, value in lists for word in (key, *value.split())]
        if len(words) % 3:
            text = f"start poses {' '.join(words)[:80]!r}"
            raise MalformedMessage(
                f"{text}, expected 'name x,y,z roll,pitch,yaw' of each"
            )
        rows = zip(words[::3], words[1::3], words[2::3], strict=True)
        return cls(
            tuple(
                (name, wrapped_pose(parse_flipped(position), parse_flipped(angles)))
                for name, position, angles in rows
            )
        )

    def encode(self, dialect: Dialect) -> str:
        """Write as many poses as fit into one line, without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        join = dialect.start_pose.join
        numbers = [(name, wrapped_pose_on_wire(pose)) for name, pose in self.poses]
        poses = _fitting(
            [f"{name} {join(row[:3])} {join(row[3:])}" for name, row in numbers]
        )
        count = f"NFO {{StartPoses {len(poses)}}}"
        return f"{count} {{{' '.join(poses)}}}" if poses else count


@dataclass(frozen=True, slots=True)
class Status(NumberedReport):
    """The state of a robot.

    Attributes:
        time: Simulated time, s.
        battery: Time that the battery lasts, s.
        light: Whether the headlight is on.
    """

    time: float
    battery: int
    light: bool

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message; without a battery, 0 s are left.

        Raises:
            MalformedMessage: If a field is not readable.
        """
        battery = message.parse_optional("Battery", parse_number)
        light = parse_flag(message.get("LightToggle") or "")
        return cls(message.number_or_nan("Time"), int(battery or 0), light)

    @classmethod
    def build(cls, light: bool, numbers: Iterator[float]) -> Self:
        """Create a status from the time, and the time that the battery lasts."""
        return cls(next(numbers), int(next(numbers)), light)

    @classmethod
    def template(cls, dialect: Dialect, light: bool) -> bytes:
        """Return the template of lines with the light off, or on."""
        return _status_template(dialect, light)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and no series."""
        least = 0 if dialect.battery_runs_out else 1
        numbers = (self.time, max(self.battery, least))
        return _status_template(dialect, self.light), numbers, NO_SERIES


@cache
def _status_template(dialect: Dialect, light: bool) -> bytes:
    # In each dialect the time is before the battery, as in the numbers of a status.
    values = {
        "Type": VEHICLE,
        "Time": marks(dialect.time),
        "FrontSteer": dialect.steer,
        "RearSteer": dialect.steer,
        "LightToggle": str(light),
        "LightIntensity": dialect.light_intensity[light],
        "Battery": WHOLE,
        "View": "-1",
    }
    return template("STA", select_fields(dialect.status_keys, values))


@dataclass(frozen=True, slots=True)
class WatchedLine:
    """A copy of a line that the client of another robot was sent.

    Attributes:
        robot: Name of the robot.
        line: The line, without its end.
        report: What the line reports; None for an unknown kind of report.
    """

    robot: str
    line: str
    report: "Report | None"

    @classmethod
    def decode(cls, text: str) -> Self:
        """Read the copy, and the report in it.

        Raises:
            MalformedMessage: If it is not a copy, or the report is not readable.
        """
        robot, line = split_seen(text)
        report = None if is_seen(line) else decode_report(line)
        return cls(robot, line, report)

    def encode(self, _: Dialect) -> str:
        """Write the copy without its end."""
        return f"{see_head(self.robot).decode('ascii')}{self.line}"


Report: TypeAlias = (
    Greeting
    | StartPoses
    | Status
    | RangeScan
    | EchoLine
    | RadarTargets
    | GroundTruth
    | Ins
    | Odometry
    | Tachometer
    | Encoder
    | Touch
    | Sonar
    | Gps
    | RobotGeo
    | RobotConf
    | ItemGeo
    | ScannerConf
    | SonarConf
    | IntervalConf
    | EncoderConf
    | TouchConf
    | NameConf
    | RobotJoined
    | RobotLeft
    | CommandError
    | Watching
    | WatchedLine
)

_SENSOR_REPORTS: Final = {
    report.sensor_type.lower(): report
    for report in (
        *(RangeScan, EchoLine, RadarTargets, GroundTruth, Ins),
        *(Odometry, Tachometer, Encoder, Touch, Sonar, Gps),
    )
}


def decode_report(line: str) -> Report | None:
    """Read one line of a server; return None for an unknown kind of report.

    >>> decode_report("NFO {Gametype BotDeathMatch} {Level DM-Yard} {TimeLimit 0}")
    Greeting(level='DM-Yard')

    Raises:
        MalformedMessage: If the line is not a message, or a field of a known report is
            missing or not readable.
    """
    if is_seen(line):
        return WatchedLine.decode(line)
    message = decode_message(line)
    decode = _DECODERS.get(message.verb.upper())
    return decode(message) if decode else None


def to_bytes(lines: Iterable[str]) -> bytes:
    r"""Join lines for sending, each with CRLF.

    >>> to_bytes(["NFO {StartPoses 0}"])
    b'NFO {StartPoses 0}\r\n'
    """
    return "".join([f"{line}\r\n" for line in lines]).encode("ascii", "replace")


def _decode_info(message: Message) -> Report | None:
    if message.get("StartPoses") is not None:
        return StartPoses.decode(message)
    if message.get("Watching") is not None:
        return Watching.decode(message)
    if message.get("Joined") is not None:
        return RobotJoined.decode(message)
    for key, report in (
        ("Level", Greeting),
        ("Left", RobotLeft),
        ("Error", CommandError),
    ):
        text = message.get(key)
        if text is not None:
            return report(text)
    return None


def _decode_reading(message: Message) -> Report | None:
    report = _SENSOR_REPORTS.get((message.get("Type") or "").lower())
    return report.decode(message) if report else None


def _fitting(poses: Sequence[str]) -> Sequence[str]:
    """Return the first poses, as many as fit into one read of a client."""
    limit = LONGEST_LINE - len("NFO {StartPoses 1000} {}\r\n")
    ends = accumulate(len(pose) + 1 for pose in poses)
    return poses[: sum(end - 1 <= limit for end in ends)]


_DECODERS: Final[dict[str, Callable[[Message], Report | None]]] = {
    "NFO": _decode_info,
    "STA": Status.decode,
    "SEN": _decode_reading,
    "GEO": decode_geo,
    "CONF": decode_conf,
}
