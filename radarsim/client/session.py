"""One connection's bytes to reports, and questions to bytes; no sockets and no clock.

A server may say anything: what is no line, no report or not of a kind that is known is
counted and skipped. A client that needs an answer asks a ``Question``, which knows the
answer when it sees it among the readings that never stop.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from radarsim.client.robot_info import is_sound
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
    encode_command,
)
from radarsim.protocol.decode import decode_report
from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.reports import (
    EncoderConf,
    Greeting,
    IntervalConf,
    ItemGeo,
    NameConf,
    RangeScan,
    Reading,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
    StartPoses,
    Status,
    TouchConf,
)

ROBOT = "Robot"  # the type by which clients ask about the robot itself
RANGE_SCANNER = "RangeScanner"


def check_timeout(timeout: float) -> None:
    """Refuse a wait of no length.

    Raises:
        ValueError: If it is not above 0 s.
    """
    if not timeout > 0:
        raise ValueError(f"timeout {timeout!r}, expected more than 0 s")


class Session:
    """Everything that one server has said.

    Attributes:
        greeting: None before it has come.
        time: The newest time stamp, s of the server; not a number before the first.
        scans: The newest scan of each scanner, by name.
        unread: How many lines were skipped.
        last: The last line, whatever it was; empty before the first.
    """

    def __init__(self) -> None:
        self.greeting: Greeting | None = None
        self.time = math.nan
        self.scans: dict[str, RangeScan] = {}
        self.unread = 0
        self.last = ""
        self._lines = LineBuffer()

    def receive(self, data: bytes) -> list[Report]:
        """Take what came and give the reports that it completes, in order.

        A report without a time stamp gets the newest one. Never raises.
        """
        reports = []
        for piece in data.splitlines(keepends=True):
            for line in self._lines.feed(piece):
                self.last = line
                report = self._read(line)
                if report is not None:
                    reports.append(report)
            if self._lines.overflow is not None:
                self._lines = LineBuffer()  # the rest of that line is one of no kind
                self.unread += 1
        return reports

    def _read(self, line: str) -> Report | None:
        report = None
        with suppress(MalformedMessage):
            report = decode_report(line)
        if isinstance(report, RangeScan) and not is_sound(report):
            report = None
        if report is None:
            self.unread += 1
        elif isinstance(report, Greeting):
            self.greeting = report
        elif isinstance(report, Reading | Status):
            return self._stamped(report)
        return report

    def _stamped(self, report: Reading | Status) -> Report:
        if math.isnan(report.time):
            report = replace(report, time=self.time)
        elif not report.time < self.time:
            self.time = report.time
        if isinstance(report, RangeScan):
            self.scans[report.name] = report
        return report


@dataclass(frozen=True, slots=True)
class Question:
    """Something to say, and what to wait for then.

    Attributes:
        data: The line; empty if nothing is to be said.
        what: The answer, for an error that it is missing.
        accepts: Whether a report is the answer.
    """

    data: bytes
    what: str
    accepts: Callable[[Report], bool]


def greeting() -> Question:
    """Wait for the greeting, which comes unasked."""
    return Question(b"", "greeting", lambda report: isinstance(report, Greeting))


def start_poses() -> Question:
    """Ask for the start poses of the map."""
    return Question(
        _bytes(GetStartPoses()),
        "start poses",
        lambda report: isinstance(report, StartPoses),
    )


def geometry(kind: str, name: str | None = None) -> Question:
    """Ask for the shape of the robot, or where items are mounted.

    Args:
        kind: ``Robot``, or a type of items such as ``RangeScanner``.
        name: Of one item; None for all of the type.

    Raises:
        ValueError: If a line cannot hold these.
    """

    def accepts(report: Report) -> bool:
        if kind.lower() == ROBOT.lower():
            return isinstance(report, RobotGeo)
        if not isinstance(report, ItemGeo) or not _same(report.type, kind):
            return False
        return _tells_of(name, [mount[0] for mount in report.mounts])

    what = f"GEO of {_named(kind, name)}"
    return Question(_bytes(GetGeo(kind, name)), what, accepts)


def configuration(kind: str, name: str | None = None) -> Question:
    """Ask for the settings of the robot or of items; arguments as in ``geometry``.

    Raises:
        ValueError: If a line cannot hold these.
    """

    def accepts(report: Report) -> bool:
        if kind.lower() == ROBOT.lower():
            return isinstance(report, RobotConf)
        if isinstance(report, NameConf):
            return _same(report.type, kind) and _tells_of(name, report.names)
        if isinstance(report, ScannerConf | IntervalConf | EncoderConf | TouchConf):
            names = [item[0] for item in report.items]
            return _same(report.type, kind) and _tells_of(name, names)
        return False

    what = f"CONF of {_named(kind, name)}"
    return Question(_bytes(GetConf(kind, name)), what, accepts)


def spawn(
    class_name: str,
    *,
    name: str | None = None,
    start: str | None = None,
    pose: Pose2 | Pose3 | None = None,
) -> Question:
    """Ask for a robot; the answer is whatever it says first.

    Args:
        class_name: With or without its package.
        name: None leaves it to the server.
        start: Name of a start pose, or None.
        pose: If there is no ``start``; with neither, the server decides.

    Raises:
        ValueError: If both are given, or a line cannot hold these.
    """
    if start is not None and pose is not None:
        raise ValueError(f"start {start!r} and a pose, expected only one of them")
    if isinstance(pose, Pose2):
        pose = Pose3(pose.x, pose.y, 0.0, yaw=pose.yaw)
    place = {}
    if pose is not None:
        place["position"] = (pose.x, pose.y, pose.z)
        place["rotation"] = (pose.roll, pose.pitch, pose.yaw)
    return Question(
        _bytes(Init(class_name, name, start, **place)),
        f"reading of the robot {class_name!r}",
        lambda report: isinstance(report, Reading | Status),
    )


def drive(left: float, right: float) -> bytes:
    """Order wheel speeds, in the server's unit.

    Raises:
        ValueError: If one is not finite.
    """
    return _bytes(Drive(left, right))


def set_item(kind: str, name: str | None, opcode: str, params: str = "") -> bytes:
    """Give an order to the items of a type, or to the one of a name.

    Raises:
        ValueError: If a line cannot hold these.
    """
    return _bytes(SetItem(kind, name, opcode, params))


def echoes(scanner: str, on: bool = True) -> bytes:
    """Ask a scanner of radarsim for ``EchoLine`` reports, or for no more of them.

    Raises:
        ValueError: If a line cannot hold the name.
    """
    return set_item(RANGE_SCANNER, scanner, "ECHOES", str(on).lower())


def _bytes(command: Command) -> bytes:
    return encode_command(command).encode("ascii") + b"\r\n"


def _same(one: str, other: str) -> bool:
    return one.lower() == other.lower()


def _tells_of(name: str | None, names: "list[str] | tuple[str, ...]") -> bool:
    return name is None or any(_same(name, other) for other in names)


def _named(kind: str, name: str | None) -> str:
    return kind if name is None else f"{kind} {name!r}"
