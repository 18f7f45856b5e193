"""Decodes bytes from a server and encodes questions, without sockets or clocks.

A server may send anything: a line that is not a known report is counted and skipped. A
``Question`` recognizes its answer within the continuous stream of readings.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final, TypeAlias

from radarsim.client.robot_info import is_plausible, same_name
from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.commands import (
    Command,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    SetItem,
    Watch,
    encode_command,
)
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.reports import (
    CommandError,
    Greeting,
    ItemConf,
    ItemGeo,
    NameConf,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    RobotJoined,
    RobotLeft,
    SensorReport,
    StartPoses,
    Status,
    WatchedLine,
    decode_report,
)
from radarsim.protocol.watch import RobotChoice

ROBOT = "Robot"  # the type for questions about the robot itself
RANGE_SCANNER = "RangeScanner"
SETTING = "SETTING"  # the opcode that changes settings
_TIMED: Final = (SensorReport, Status)  # reports with a time stamp
MOST_WATCHED = 2000  # robots whose latest readings are kept; a server has up to 1024

# A sequence is x, y or x, y, yaw of a Pose2, or the six numbers of a Pose3.
PoseLike: TypeAlias = Pose2 | Pose3 | Sequence[float]


def check_timeout(timeout: float) -> None:
    """Check that a timeout is above 0 s.

    Raises:
        ValueError: If the timeout is not above 0 s.
    """
    if not timeout > 0:
        raise ValueError(f"timeout {timeout!r}, expected more than 0 s")


class Readings:
    """The latest time stamp and the latest scans of one robot.

    Attributes:
        time: Latest time stamp of the server, s; NaN before the first.
        scans: Latest scan of each scanner by name.
    """

    def __init__(self) -> None:
        self.time = math.nan
        self.scans: dict[str, RangeScan] = {}

    def add(self, report: Report) -> Report | None:
        """Store a report and return it; return None for an implausible scan.

        A report without a time stamp gets the latest time stamp of the server.
        """
        if isinstance(report, RangeScan) and not is_plausible(report):
            return None
        if isinstance(report, _TIMED):
            if math.isnan(report.time):
                report = replace(report, time=self.time)
            # With ``not`` in this condition, the time may also be NaN before.
            elif not report.time < self.time:
                self.time = report.time
            if isinstance(report, RangeScan):
                self.scans[report.name] = report
        return report


class Session(Readings):
    """The state of one connection to a server: received reports and readings.

    Attributes:
        time: Latest time stamp of the server, s; NaN before the first.
        scans: Latest scan of each scanner of the client's robot, by name.
        greeting: Greeting of the server; None before it is received.
        newest: Latest report of each type, without reports of watched robots.
        watched: Latest readings of watched robots by name; at most ``MOST_WATCHED``.
        ignored: Prefixes of lines to skip without parsing, which saves time.
        reads_copies: Whether to decode the reports of watched robots, which takes most
            of the time of a watcher.
        unread: Number of skipped lines.
        last: Last line of any kind; empty before the first.
    """

    def __init__(self) -> None:
        super().__init__()
        self.greeting: Greeting | None = None
        self.newest: dict[type, Report] = {}
        self.watched: dict[str, Readings] = {}
        self.ignored: tuple[str, ...] = ()
        self.reads_copies = True
        self.unread = 0
        self.last = ""
        self._lines = LineBuffer()

    @property
    def car(self) -> RobotGeo | None:
        """Geometry of a robot known to steer like a car; None for other robots."""
        geo, conf = self.newest.get(RobotGeo), self.newest.get(RobotConf)
        if not (isinstance(geo, RobotGeo) and isinstance(conf, RobotConf)):
            return None
        return geo if conf.max_steering and geo.name == conf.name else None

    def receive(self, data: bytes) -> list[Report]:
        """Add received bytes, and return the reports of all complete lines in order.

        A report without a time stamp gets the latest time stamp of its robot. Invalid
        lines are skipped and never raise.
        """
        reports = []
        pieces = [data]
        # Data that may make a line too long is fed line by line, so that only the line
        # that is too long is lost.
        if not self._lines.has_room_for(data):
            pieces = data.splitlines(keepends=True)
        for piece in pieces:
            for line in self._lines.feed(piece):
                self.last = line
                if line.startswith(self.ignored):
                    continue
                try:
                    report = decode_report(line, reads_copies=self.reads_copies)
                except MalformedMessage:
                    report = None
                if report is not None:
                    report = self.add(report)
                if report is None:
                    self.unread += 1
                else:
                    self.newest[type(report)] = report
                    reports.append(report)
            if self._lines.overflow is not None:
                # A new buffer skips the rest of the overlong line as an unknown line.
                self._lines = LineBuffer()
                self.unread += 1
        return reports

    def add(self, report: Report) -> Report | None:
        """Store a report of any kind and return it; return None for an invalid scan."""
        match report:
            case Greeting():
                self.greeting = report
            case RobotJoined(robot) | RobotLeft(robot):
                self.watched.pop(robot, None)
            case WatchedLine(robot, _, copy):
                if robot not in self.watched:
                    # A server that keeps reporting new robots must not fill the memory.
                    if len(self.watched) >= MOST_WATCHED:
                        del self.watched[next(iter(self.watched))]
                    self.watched[robot] = Readings()
                seen = None if copy is None else self.watched[robot].add(copy)
                return replace(report, report=seen)
            case _:
                pass
        return super().add(report)


@dataclass(frozen=True, slots=True)
class Question:
    """A question to a server: the line to send, and the answer to wait for.

    Attributes:
        data: Line to send, with its line end.
        what: Name of the answer in error texts.
        accepts: Returns whether a report is the answer.
    """

    data: bytes
    what: str
    accepts: Callable[[Report], bool]


def start_poses() -> Question:
    """Return the question for the start poses of the map."""
    return Question(
        _bytes(GetStartPoses()),
        "start poses",
        lambda report: isinstance(report, StartPoses),
    )


def geometry(kind: str, name: str | None = None, robot: str | None = None) -> Question:
    """Return the question for a robot's dimensions, or its items' mounting poses.

    Args:
        kind: ``Robot``, or a type of items such as ``RangeScanner``.
        name: Name of one item; None for all items of the type.
        robot: Name of another robot, for which radarsim answers with a ``WatchedLine``;
            None for the client's own robot.

    Raises:
        ValueError: If a text cannot be written on a line.
    """

    def accepts(report: Report) -> bool:
        if kind.lower() == ROBOT.lower():
            return isinstance(report, RobotGeo)
        if not isinstance(report, ItemGeo) or not same_name(report.type, kind):
            return False
        return _includes(name, [mount[0] for mount in report.mounts])

    answer = f"GEO of {_named(kind, name)}"
    data = _bytes(GetGeo(kind, name, robot))
    return Question(data, answer, _of_robot(accepts, robot))


def configuration(
    kind: str, name: str | None = None, robot: str | None = None
) -> Question:
    """Return the question for settings of a robot; arguments as in ``geometry``.

    Raises:
        ValueError: If a text cannot be written on a line.
    """

    def accepts(report: Report) -> bool:
        if kind.lower() == ROBOT.lower():
            return isinstance(report, RobotConf)
        if isinstance(report, NameConf):
            return same_name(report.type, kind) and _includes(name, report.names)
        if isinstance(report, ItemConf):
            names = [item[0] for item in report.items]
            return same_name(report.type, kind) and _includes(name, names)
        return False

    answer = f"CONF of {_named(kind, name)}"
    data = _bytes(GetConf(kind, name, robot))
    return Question(data, answer, _of_robot(accepts, robot))


def spawn(
    class_name: str,
    *,
    name: str | None = None,
    start: str | None = None,
    pose: PoseLike | None = None,
    takes_free: bool = False,
) -> Question:
    """Return the request to spawn a robot, whose first report is the answer.

    Args:
        class_name: Class of the robot with or without its package.
        name: Name of the robot; None lets the server choose.
        start: Name of a start pose, or None.
        pose: Pose if ``start`` is None; without both, the server decides.
        takes_free: Whether radarsim takes the first start of the map at which the robot
            has room, if there is one.

    Raises:
        ValueError: If both ``start`` and ``pose`` are given, the pose is malformed, or
            a text cannot be written on a line.
    """
    if start is not None and pose is not None:
        raise ValueError(f"start {start!r} and a pose, expected only one of them")
    pose_fields = {}
    if pose is not None:
        pose = _to_pose3(pose)
        pose_fields["position"] = (pose.x, pose.y, pose.z)
        pose_fields["rotation"] = (pose.roll, pose.pitch, pose.yaw)
    return Question(
        _bytes(Init(class_name, name, start, takes_free=takes_free, **pose_fields)),
        f"reading of the robot {class_name!r}",
        lambda report: isinstance(report, SensorReport | Status),
    )


def _to_pose3(pose: PoseLike) -> Pose3:
    """Convert a pose, also as a sequence of numbers, to a ``Pose3``.

    Raises:
        ValueError: If the pose has another form.
    """
    if isinstance(pose, Pose3):
        return pose
    numbers = (pose.x, pose.y, pose.yaw) if isinstance(pose, Pose2) else pose
    with suppress(TypeError, ValueError):
        if len(numbers) in (2, 3):
            x, y, *yaw = numbers
            numbers = (x, y, 0.0, 0.0, 0.0, *(yaw or [0.0]))
        return Pose3.from_numbers(numbers)
    expected = "expected a Pose2, a Pose3, x, y or x, y, yaw, or six numbers of a Pose3"
    raise ValueError(f"pose {pose!r}, {expected}")


def drive(left: float, right: float, car: RobotGeo | None = None) -> bytes:
    """Return the command that sets a robot's wheel speeds, in the server's unit.

    For a car, the speeds are converted to a speed and a steering angle that give the
    same curve. A car cannot turn on the spot; it drives forward in its tightest circle
    instead.

    Args:
        left: Speed of the left wheels.
        right: Speed of the right wheels.
        car: Geometry of a robot with car-like steering; None for any other robot.

    Raises:
        ValueError: If a speed is not finite.
    """
    if car is None:
        return _bytes(Drive(left, right))
    speed, turn = (left + right) / 2, (right - left) / car.wheel_separation
    if speed == 0.0 and turn != 0.0:
        speed, angle = abs(right - left) / 2, math.copysign(math.pi / 2, turn)
    else:
        angle = math.atan(car.wheel_base * turn / speed) if turn else 0.0
    return _bytes(Drive(speed=speed, front_steer=angle, rear_steer=0.0))


def fly(ahead: float, left: float, up: float, turn: float) -> bytes:
    """Return the command that sets the speeds of a drone, m/s and rad/s (``compat``).

    Raises:
        ValueError: If a number is not finite.
    """
    return _bytes(Drive(linear=ahead, lateral=left, altitude=up, rotational=turn))


def set_item(kind: str, name: str | None, opcode: str, params: str = "") -> bytes:
    """Return the command that sends an opcode to one item, or to all of a type.

    Raises:
        ValueError: If a text cannot be written on a line.
    """
    return _bytes(SetItem(kind, name, opcode, params))


def watch(
    robots: str | Iterable[str] | None,
    echoes: bool | str | Iterable[str],
    *,
    clock: bool = False,
) -> bytes:
    """Return the command that requests copies of lines to robots (``Client.watch``).

    Raises:
        ValueError: If a name is empty, or contains a comma.
    """
    echoing = RobotChoice()
    if not isinstance(echoes, bool):
        echoing = _choose(echoes)
    elif echoes:
        echoing = RobotChoice(None)
    return _bytes(Watch(_choose(robots), echoing, clock))


def echoes(scanner: str, on: bool = True) -> bytes:
    """Return the command that switches a scanner's ``EchoLine`` reports on or off.

    Raises:
        ValueError: If the name cannot be written on a line.
    """
    return set_item(RANGE_SCANNER, scanner, "ECHOES", str(on).lower())


def targets(scanner: str, on: bool = True) -> bytes:
    """Return the command that switches ``RadarTargets`` reports on or off.

    Raises:
        ValueError: If the name cannot be written on a line.
    """
    return set_item(RANGE_SCANNER, scanner, "TARGETS", str(on).lower())


def change_settings(scanner: str | None, settings: Mapping[str, Any]) -> bytes:
    """Return the command that changes settings of one scanner; None means all.

    Raises:
        ValueError: If there are no settings, or a text cannot be written on a line.
    """
    if not settings:
        raise ValueError("no settings, expected at least one")
    params = " ".join(f"{key}={_setting(value)}" for key, value in settings.items())
    return set_item(RANGE_SCANNER, scanner, SETTING, params)


def _setting(value: object) -> str:
    """Return the value of a setting as YAML text."""
    if isinstance(value, list | tuple):
        return f"[{','.join(map(_setting, value))}]"
    if isinstance(value, float) and math.isinf(value):
        return f"{'-' * (value < 0)}.inf"
    # Only None and Booleans are looked up, as 1 and 0 would find True and False.
    words = {None: "null", True: "true", False: "false"}
    return words[value] if value is None or isinstance(value, bool) else str(value)


def _bytes(command: Command) -> bytes:
    return encode_command(command).encode("ascii") + b"\r\n"


def _of_robot(
    accepts: Callable[[Report], bool], robot: str | None
) -> Callable[[Report], bool]:
    """Return a test for the answer to a question, which may name another robot."""
    if robot is None:
        return accepts

    def accepts_copy(report: Report) -> bool:
        # The server answers with an error, without a name, if the robot does not exist.
        if not isinstance(report, WatchedLine):
            return isinstance(report, CommandError)
        if report.report is None or not same_name(report.robot, robot):
            return False
        return accepts(report.report)

    return accepts_copy


def _choose(robots: str | Iterable[str] | None) -> RobotChoice:
    if robots is None:
        return RobotChoice(None)
    names = (robots,) if isinstance(robots, str) else tuple(robots)
    for name in names:
        if not name.strip() or "," in name:
            raise ValueError(f"robot {name[:80]!r}, expected a name without commas")
    return RobotChoice(tuple(map(printable_name, names)))


def _includes(name: str | None, names: "list[str] | tuple[str, ...]") -> bool:
    return name is None or any(same_name(name, other) for other in names)


def _named(kind: str, name: str | None) -> str:
    return kind if name is None else f"{kind} {name!r}"
