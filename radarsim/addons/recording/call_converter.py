"""From the calls of a host to the messages of a bag.

The calls themselves become messages as well, byte for byte, on the two topics of the
wire, so that a run can be repeated. Their times are simulated: that of the tick, and a
nanosecond more for each call in it, so that no two are equal and their order is kept.
"""

from collections.abc import Iterator
from contextlib import suppress
from typing import Final, NamedTuple

from radarsim.addons.recording.host_recorder import (
    CallKind,
    HostCall,
    MapSnapshot,
    ReceivedTurn,
    RobotDescription,
    RunEvent,
)
from radarsim.addons.recording.messages import (
    TopicMessage,
    Transform,
    clock,
    octets,
    transforms,
)
from radarsim.addons.recording.robot_topics import (
    Legend,
    RobotTopics,
    map_message,
    topic_name,
)
from radarsim.client.robot_info import RobotInfo, ScannerDescriptions, ScannerInfo
from radarsim.client.session import Session
from radarsim.errors import ClientError, MalformedMessage
from radarsim.protocol.commands import Drive, parse_command
from radarsim.protocol.dialect import Dialect, DriveUnit
from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.reports import Report, RobotConf, RobotGeo, decode_report

TICK: Final = 10_000_000  # ns
CLOCK_INTERVAL: Final = 10  # ticks
TO_CLIENT: Final = "/radarsim/wire/to_client"
TO_SERVER: Final = "/radarsim/wire/to_server"
FROM_HOST: Final = frozenset({CallKind.TAKE, CallKind.FINISH})


class TimedMessage(NamedTuple):
    """A message for a topic, and its time, ns."""

    time: int
    message: TopicMessage


class _Connection:
    """What is known of one client."""

    def __init__(self) -> None:
        self.session = Session()
        self.commands = LineBuffer()
        self.robot = ""
        self.topics: RobotTopics | None = None


class CallConverter:
    """Converts calls, one after the other."""

    def __init__(self, dialect: Dialect, drive_unit: DriveUnit) -> None:
        """Begin with no clients.

        Args:
            dialect: Dialect of the server.
            drive_unit: Unit of the commands to drive.
        """
        self._dialect = dialect
        self._drive_unit = drive_unit
        self._legend = Legend()
        self._connections: dict[int, _Connection] = {}
        self._names: dict[str, str] = {}  # of topics, by names of robots
        self._scanner_frames: dict[str, Transform] = {}
        self._time = -1
        self._next_clock = 0

    def convert(self, event: RunEvent) -> Iterator[TimedMessage]:
        """Yield the messages of an event: those of the robot first, then a call."""
        # No two events have the same time, as players sort messages by it; a thousand
        # in a tick are still far from the next one.
        self._time = max(event.tick * TICK, self._time + 1)
        for message in self._messages(event):
            yield TimedMessage(self._time, message)

    def _messages(self, event: RunEvent) -> Iterator[TopicMessage]:
        if isinstance(event, MapSnapshot):
            yield map_message(event)
            return
        # Before simulated time begins there is none to be told.
        idles = isinstance(event, HostCall) and event.kind is CallKind.WAIT
        if not idles and event.tick >= self._next_clock:
            self._next_clock = event.tick + CLOCK_INTERVAL
            yield TopicMessage("/clock", clock(event.tick * TICK / 1e9))
        connection = self._connections.setdefault(event.client, _Connection())
        match event:
            case RobotDescription(tick, _, text):
                yield self._describe(connection, text, tick * TICK / 1e9)
            case ReceivedTurn(_, _, turn):
                assert connection.topics is not None  # it is described before
                yield from connection.topics.of_turn(turn)
            case HostCall(kind, tick, client, data):
                yield from self._of_call(connection, event)
                topic = TO_CLIENT if kind in FROM_HOST else TO_SERVER
                label = f"{kind.name.lower()} {client} {tick}"
                yield TopicMessage(topic, octets(label, data))

    def _of_call(
        self, connection: _Connection, call: HostCall
    ) -> Iterator[TopicMessage]:
        """Yield what a robot senses or is asked to do in a call."""
        match call.kind:
            case CallKind.DISCONNECT:
                del self._connections[call.client]
            case CallKind.TAKE | CallKind.FINISH:
                for report in connection.session.receive(call.data):
                    if connection.topics is not None:
                        yield from connection.topics.of_report(report)
            case CallKind.RECEIVE:
                yield from self._commands(connection, call.data, call.tick * TICK / 1e9)
            case _:
                pass

    def _describe(
        self, connection: _Connection, text: str, time: float
    ) -> TopicMessage:
        """Begin the topics of a robot, or go on with what has changed of it."""
        name, *lines = text.split("\r\n")
        decoded = [decode_report(line) for line in lines if line]
        reports = [report for report in decoded if report is not None]
        # Another setting of the same robot keeps what its topics already know.
        if connection.topics is None or connection.robot != name:
            connection.topics = RobotTopics(self._topic_name(name), self._legend)
            connection.robot = name
        scanners = ScannerDescriptions()
        for report in reports:
            scanners.add(report)
        found = scanners.scanners(connection.session.scans)
        robot = self._robot(reports, found)
        for each in connection.topics.describe(robot, found, time):
            self._scanner_frames[each.child] = each
        # All of them: who subscribes later gets only the last message.
        message = transforms(list(self._scanner_frames.values()))
        return TopicMessage("/tf_static", message, latched=True)

    def _robot(
        self, reports: list[Report], scanners: tuple[ScannerInfo, ...]
    ) -> RobotInfo | None:
        geo = [report for report in reports if isinstance(report, RobotGeo)]
        conf = [report for report in reports if isinstance(report, RobotConf)]
        if geo and conf:
            with suppress(ClientError):
                return RobotInfo.from_reports(
                    geo[0], conf[0], scanners, self._drive_unit
                )
        return None

    def _topic_name(self, robot: str) -> str:
        """Return the name of a robot in topics, which no other robot has."""
        if robot not in self._names:
            wanted = name = topic_name(robot)
            count = 1
            while name in self._names.values():
                count += 1
                name = f"{wanted}_{count}"
            self._names[robot] = name
        return self._names[robot]

    def _commands(
        self, connection: _Connection, data: bytes, time: float
    ) -> Iterator[TopicMessage]:
        """Yield what commands to drive ask for, of those that a host would read."""
        # A host reads nothing after an endless line either.
        if connection.commands.overflow is not None:
            return
        for line in connection.commands.feed(data):
            if connection.topics is None:
                continue
            with suppress(MalformedMessage):
                command = parse_command(line, self._dialect).command
                if isinstance(command, Drive):
                    message = connection.topics.of_drive(command, time)
                    if message is not None:
                        yield message
