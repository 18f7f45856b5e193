"""Records what passes between clients and a server that is another program."""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from radarsim.addons.recording.host_recorder import DESCRIBED, EventType, RunEvent
from radarsim.client import session as questions
from radarsim.client.transport import SocketTransport
from radarsim.errors import MalformedMessage
from radarsim.protocol.commands import Init
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LineBuffer, decode_message
from radarsim.protocol.reports import Report, RobotJoined, RobotLeft, WatchedLine

FIRST: Final = 1  # number of the only client of a transport
UNNAMED: Final = "robot"  # one whose name no client has sent
_DESCRIPTION: Final = re.compile(
    r"(GEO|CONF)\s*(?=.*?\{\s*Type\s+([^{}]*)\})(?=.*?\{\s*Name\s+(\S+))",
    re.IGNORECASE,  # in either order: the robot's CONF begins with its name in udk
)
_TIME: Final = re.compile(rb"\{Time (\d{1,7}(?:\.\d+)?)\}")


@dataclass(slots=True)
class _Connection:
    """What is known of one connection."""

    robot: str
    sent: LineBuffer = field(default_factory=LineBuffer)
    received: LineBuffer = field(default_factory=LineBuffer)
    descriptions: dict[tuple[str, ...], str] = field(default_factory=dict)


class WireRecorder:
    """Turns bytes on connections into calls as of a host, for a recording.

    The time of a call is the last that the server has sent. What comes before the first
    is kept until then.

    Attributes:
        time: The last time that the server has sent, s.
    """

    def __init__(self, record: Callable[[RunEvent], None]) -> None:
        """Begin with no connections.

        Args:
            record: Called with each event; it must not raise.
        """
        self.time = 0.0
        self._record = record
        self._connections: dict[int, _Connection] = {}
        self._early: list[RunEvent] | None = []

    @property
    def tick(self) -> int:
        """The last time that the server has sent, in ticks."""
        return round(100 * self.time)

    def begin(self, number: int, robot: str) -> None:
        """Record that a client connects, whose robot is known.

        Args:
            number: Number of the connection.
            robot: Name of the robot.
        """
        self._describe(number, self._connection(number, robot))

    def end_one(self, number: int) -> None:
        """Record that a connection is closed."""
        if self._connections.pop(number, None) is not None:
            self._report(EventType.DISCONNECT, number)

    def sent(self, number: int, data: bytes) -> None:
        """Record what a client sends on a connection."""
        connection = self._connection(number)
        self._report(EventType.RECEIVE, number, data)
        # The bytes are recorded nevertheless; only what they say is not read any more.
        if connection.sent.overflow is not None:
            return
        for line in connection.sent.feed(data):
            if spawned := spawned_robot(line):
                connection.robot = spawned[0] or spawned[1]
                # Another robot takes the place of the one before; nothing known of that
                # holds.
                connection.descriptions.clear()
                self._describe(number, connection)

    def received(self, number: int, data: bytes) -> None:
        """Record what a client is sent on a connection."""
        connection = self._connection(number)
        self._note_time(data)
        self._report(EventType.TAKE, number, data)
        if connection.received.overflow is not None:
            return
        lines = connection.received.feed(data)
        found = [
            (match.groups(), line)
            for line in lines
            if (match := _DESCRIPTION.match(line))
        ]
        # Servers repeat these answers whenever anybody asks; only news are recorded.
        if not connection.descriptions.items() >= set(found):
            connection.descriptions.update(found)
            self._describe(number, connection)

    def end(self) -> None:
        """Record that no more comes."""
        self._note_time(None)
        for number in self._connections:
            self._report(EventType.DISCONNECT, number)
        self._report(EventType.END)

    def _connection(self, number: int, robot: str = "") -> _Connection:
        if number not in self._connections:
            self._connections[number] = _Connection(robot)
            self._report(EventType.CONNECT, number)
        return self._connections[number]

    def _describe(self, number: int, connection: _Connection) -> None:
        lines = (connection.robot or UNNAMED, *connection.descriptions.values(), "")
        self._report(EventType.ROBOT, number, "\r\n".join(lines).encode())

    def _note_time(self, data: bytes | None) -> None:
        """Read the last time in what the server sends; None for its end."""
        found = _TIME.findall(data) if data is not None else []
        if found:
            # Robots report in turn, and a line may be older than the one before it.
            self.time = max(self.time, float(found[-1]))
        # What came before the first time belongs to that one: at 0 s it would be hours
        # before the rest, if the server has been running for long.
        if self._early is not None and (found or data is None):
            early, self._early = self._early, None
            for event in early:
                self._record(event._replace(tick=self.tick))

    def _report(self, type_: EventType, client: int = 0, data: bytes = b"") -> None:
        event = RunEvent(type_, self.tick, client, data)
        if self._early is None:
            self._record(event)
        else:
            self._early.append(event)


class WatchRecorder(WireRecorder):
    """Turns what a server tells who watches its robots into calls as of a host.

    Each robot is a client that is sent its lines.

    Attributes:
        numbers: Numbers of the clients, by the names of robots that are there.
    """

    def __init__(self, record: Callable[[RunEvent], None]) -> None:
        """Begin with no robots; see ``WireRecorder``."""
        super().__init__(record)
        self.numbers: dict[str, int] = {}
        self._last_number = 0

    def take(self, report: Report) -> bytes:
        """Record what a report tells of a robot.

        Returns:
            Questions about a robot that is new: its own client need not ask them, and a
            recording cannot be read without the answers.
        """
        asked = b""
        match report:
            case RobotJoined(robot, class_name):
                asked = self._join(robot)
                # Of which class it is, is told nowhere else.
                spawn = questions.spawn(class_name, name=robot)
                self.sent(self.numbers[robot], spawn.data)
            case RobotLeft(robot):
                self._leave(robot)
            case WatchedLine(robot, line):
                if robot not in self.numbers:  # not every news has come
                    asked = self._join(robot)
                data = f"{line}\r\n".encode("latin-1", "replace")
                self.received(self.numbers[robot], data)
            case _:
                pass
        return asked

    def _join(self, robot: str) -> bytes:
        self._leave(robot)  # one of the same name, whose leaving was not told
        self._last_number += 1
        self.numbers[robot] = self._last_number
        self.begin(self._last_number, robot)
        name = printable_name(robot)
        return b"".join(
            ask(kind, robot=name).data
            for ask in (questions.geometry, questions.configuration)
            for kind in DESCRIBED
        )

    def _leave(self, robot: str) -> None:
        number = self.numbers.pop(robot, None)
        if number is not None:
            self.end_one(number)


class RecordedTransport(SocketTransport):
    """A TCP connection that records what passes; see ``Transport``."""

    def __init__(self, host: str, port: int, recorder: WireRecorder) -> None:
        """Connect.

        Args:
            host: Name or address.
            port: TCP port.
            recorder: Records it; of no other connection.
        """
        super().__init__(host, port)
        self._recorder = recorder

    def send(self, data: bytes) -> None:
        """See ``Transport.send``."""
        super().send(data)
        self._recorder.sent(FIRST, data)

    def receive(self, timeout: float) -> bytes:
        """See ``Transport.receive``."""
        data = super().receive(timeout)
        self._recorder.received(FIRST, data)
        return data


def spawned_robot(line: str) -> tuple[str, str] | None:
    """Return the name and the class in a command to spawn a robot, each may be empty.

    Args:
        line: A line of a client; None is returned for any other command.
    """
    with suppress(MalformedMessage):
        message = decode_message(line, keeps_closed=True)
        if message.verb.upper() == Init.verb:
            return message.name, (message.get("ClassName") or "").rpartition(".")[2]
    return None
