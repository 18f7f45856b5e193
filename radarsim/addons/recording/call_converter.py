"""From the calls of a host to the messages of a bag.

The calls themselves become messages as well, byte for byte, on the two topics of the
wire, so that a run can be repeated. Their times are simulated: that of the tick, and a
nanosecond more for each call in it, so that no two are equal and their order is kept.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Final

from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.messages import (
    Fields,
    TopicMessage,
    clock,
    occupancy_grid,
    octets,
    transforms,
)
from radarsim.addons.recording.recorders import EventType, RunEvent, unpack
from radarsim.addons.recording.robot_model import body_of
from radarsim.addons.recording.robot_topics import (
    Legend,
    RobotTopics,
    topic_name,
)
from radarsim.client.robot_info import RobotInfo, ScannerDescriptions, same_name
from radarsim.client.session import Session
from radarsim.errors import ClientError, MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.commands import Drive, parse_command
from radarsim.protocol.dialect import get_dialect
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.reports import Ins, ItemGeo, RobotConf, RobotGeo, decode_report

TICK: Final = 10_000_000  # ns
CLOCK_GAP: Final = 100  # ticks without a call, after which the clock has stopped
TO_CLIENT: Final = "/radarsim/wire/to_client"
TO_SERVER: Final = "/radarsim/wire/to_server"
FROM_HOST: Final = frozenset({EventType.TAKE, EventType.FINISH})


class _Connection:
    """The state of one client."""

    def __init__(self) -> None:
        self.session = Session()
        self.commands = LineBuffer()
        self.robot = ""
        self.topics: RobotTopics | None = None


class CallConverter:
    """Converts calls, one after the other."""

    def __init__(self, info: RecordingInfo) -> None:
        """Begin with no clients, under the conditions of a run."""
        self._info = info
        self._dialect = get_dialect(info.dialect)
        self._legend = Legend()
        self._connections: dict[int, _Connection] = {}
        self._names: dict[str, str] = {}  # of topics, by names of robots
        self._mounts: dict[str, Fields] = {}  # by their frames
        self._time = -1
        self._clock = 0  # tick that it shows next

    def convert(self, event: RunEvent) -> Iterator[tuple[int, TopicMessage]]:
        """Yield the messages of an event, those of the robot before the call itself.

        Each follows its time, ns.
        """
        # No two events have the same time, as players sort messages by it; a thousand
        # in a tick are still far from the next one.
        last, self._time = self._time, max(event.tick * TICK, self._time + 1)
        # Before simulated time begins there is no time, and maps come later.
        if event.type not in (EventType.WAIT, EventType.MAP):
            if event.tick - self._clock > CLOCK_GAP:
                self._clock = event.tick
            for tick in range(self._clock, event.tick + 1):
                yield max(tick * TICK, last), clock(tick / 100)
            self._clock = max(self._clock, event.tick + 1)
        for message in self._messages(event):
            yield self._time, message

    def _messages(self, event: RunEvent) -> Iterator[TopicMessage]:
        type_, tick, client, data = event
        if type_ is EventType.MAP:
            yield occupancy_grid(*unpack(data))
            return
        time = tick * TICK / 1e9
        connection = self._connections.setdefault(client, _Connection())
        match type_:
            case EventType.ROBOT:
                yield from self._describe(connection, data.decode(), time)
            case EventType.TURN:
                assert connection.topics is not None  # it is described before
                yield from connection.topics.of_turn(*unpack(data))
            case EventType.PICTURE:
                yield from self._picture(connection, data, time)
            case EventType.DISCONNECT:
                # Numbers are never given twice; the dict would only grow.
                del self._connections[client]
            case EventType.TAKE | EventType.FINISH:
                for report in connection.session.receive(data):
                    if connection.topics is not None:
                        yield from connection.topics.of_report(report)
            case EventType.RECEIVE:
                yield from self._commands(connection, data, time)
            case _:
                pass
        if event.is_call:
            topic = TO_CLIENT if type_ in FROM_HOST else TO_SERVER
            yield octets(topic, f"{type_.name.lower()} {client} {tick}", data)

    def _describe(
        self, connection: _Connection, text: str, time: float
    ) -> Iterator[TopicMessage]:
        """Begin the topics of a robot, or go on with what has changed of it."""
        name, *lines = text.split("\r\n")
        # Another setting of the same robot keeps what its topics already know.
        if connection.topics is None or connection.robot != name:
            connection.topics = RobotTopics(
                self._topic_name(name),
                self._legend,
                own_localization=self._info.own_localization,
            )
            connection.robot = name
        described, geo, conf = ScannerDescriptions(), None, None
        ins_mounts: dict[str, Pose3] = {}
        for line in filter(None, lines):
            report = decode_report(line)
            if report is None:
                continue
            if isinstance(report, ItemGeo) and same_name(report.type, Ins.sensor_type):
                ins_mounts.update(report.mounts)
                continue
            described.add(report)
            if isinstance(report, RobotGeo):
                geo = geo or report
            elif isinstance(report, RobotConf):
                conf = conf or report
        scanners = described.scanners(connection.session.scans)
        robot = None
        if geo and conf:
            # Without what a robot needs to drive, all but its commands is converted.
            unit = self._info.drive_unit
            with suppress(ClientError):
                robot = RobotInfo.from_reports(geo, conf, scanners, unit)
        mounts = connection.topics.describe(robot, scanners, ins_mounts, time)
        yield self._mounted(mounts)
        if robot and geo:
            body = body_of(robot, geo, self._info.robots)
            yield from connection.topics.description(name, body)

    def _mounted(self, mounts: Iterable[Fields]) -> TopicMessage:
        """Return the mounts of all items; some are new."""
        self._mounts.update({each.child_frame_id: each for each in mounts})
        # All of them: who subscribes later gets only the last message.
        return transforms("/tf_static", list(self._mounts.values()), latched=True)

    def _picture(
        self, connection: _Connection, jpeg: bytes, time: float
    ) -> Iterator[TopicMessage]:
        """Yield a picture of a robot's camera, after where the camera is."""
        if connection.topics is not None:
            mount, *messages = connection.topics.of_picture(time, jpeg)
            if mount.child_frame_id not in self._mounts:
                yield self._mounted([mount])
            yield from messages

    def _topic_name(self, robot: str) -> str:
        """Return the name of a robot in topics, which no other robot has."""
        if robot not in self._names:
            has_none = same_name(robot, self._info.no_namespace)
            wanted = name = "" if has_none else topic_name(robot)
            count = 1
            while name in self._names.values():
                count += 1
                name = f"{wanted}_{count}"
            # A robot that comes again goes on with its own topics.
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
            # What the host does not understand either is only among the bytes of the
            # wire.
            with suppress(MalformedMessage):
                command = parse_command(line, self._dialect)[0]
                if isinstance(command, Drive):
                    message = connection.topics.of_drive(command, time)
                    if message is not None:
                        yield message
