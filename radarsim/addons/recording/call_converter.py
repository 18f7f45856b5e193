"""Converts the recorded calls of a ``Host`` into the messages of a bag.

Each call is also stored byte for byte as a message on ``/radarsim/wire/to_client`` or
``to_server``, so that the run can be repeated. The time of a message is the simulated
time of its tick. Each further call in a tick is one nanosecond later, which keeps times
unique and calls in order.
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
CLOCK_GAP: Final = 100  # ticks; a longer pause between calls has no clock messages
TO_CLIENT: Final = "/radarsim/wire/to_client"
TO_SERVER: Final = "/radarsim/wire/to_server"
FROM_HOST: Final = frozenset({EventType.TAKE, EventType.FINISH})


class _Connection:
    """The state of one recorded client."""

    def __init__(self) -> None:
        self.session = Session()
        self.commands = LineBuffer()
        self.robot = ""
        self.topics: RobotTopics | None = None


class CallConverter:
    """Converts the recorded calls of one run, in order."""

    def __init__(self, info: RecordingInfo) -> None:
        """Create a converter without clients; ``info`` is the run's conditions."""
        self._info = info
        self._dialect = get_dialect(info.dialect)
        self._legend = Legend()
        self._connections: dict[int, _Connection] = {}
        self._names: dict[str, str] = {}  # unique topic names, by name of the robot
        self._mounts: dict[str, Fields] = {}  # mounts by frame
        self._time = -1
        self._clock = 0  # tick of the next clock message

    def convert(self, event: RunEvent) -> Iterator[tuple[int, TopicMessage]]:
        """Yield the messages of an event and their times, ns; the call comes last."""
        # Players sort messages by time, so each event gets its own time, 1 ns after the
        # last. A tick has time for far more than a thousand events.
        last, self._time = self._time, max(event.tick * TICK, self._time + 1)
        # Waits take no simulated time, and maps are recorded later than the time they
        # show, so neither advances the clock.
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
                assert connection.topics is not None  # the robot is described first
                yield from connection.topics.of_turn(*unpack(data))
            case EventType.PICTURE:
                yield from self._picture(connection, data, time)
            case EventType.DISCONNECT:
                # Client numbers are never reused, so the entry is not needed any more.
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
        """Create the topics of a robot, or update them when its settings change."""
        name, *lines = text.split("\r\n")
        # If only a setting of the robot has changed, its topics keep their state.
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
            # An incomplete geometry is no error, because scans and poses do not need
            # it.
            unit = self._info.drive_unit
            with suppress(ClientError):
                robot = RobotInfo.from_reports(geo, conf, scanners, unit)
        mounts = connection.topics.describe(robot, scanners, ins_mounts, time)
        yield self._mounted(mounts)
        if robot and geo:
            body = body_of(robot, geo, self._info.robots)
            yield from connection.topics.description(name, body)

    def _mounted(self, mounts: Iterable[Fields]) -> TopicMessage:
        """Store the poses of items on robots; return all poses as one message."""
        self._mounts.update({each.child_frame_id: each for each in mounts})
        # Late subscribers get only the last message, so it contains all mounts.
        return transforms("/tf_static", list(self._mounts.values()), latched=True)

    def _picture(
        self, connection: _Connection, jpeg: bytes, time: float
    ) -> Iterator[TopicMessage]:
        """Yield the pose of the camera on its robot if it is new, then the picture."""
        if connection.topics is not None:
            mount, *messages = connection.topics.of_picture(time, jpeg)
            if mount.child_frame_id not in self._mounts:
                yield self._mounted([mount])
            yield from messages

    def _topic_name(self, robot: str) -> str:
        """Return the unique name that a robot has in the names of topics."""
        if robot not in self._names:
            has_none = same_name(robot, self._info.no_namespace)
            wanted = name = "" if has_none else topic_name(robot)
            count = 1
            while name in self._names.values():
                count += 1
                name = f"{wanted}_{count}"
            # A robot that joins again keeps its topics.
            self._names[robot] = name
        return self._names[robot]

    def _commands(
        self, connection: _Connection, data: bytes, time: float
    ) -> Iterator[TopicMessage]:
        """Yield the commanded motion of each drive command in the bytes."""
        # A host reads no commands after a line that is too long, so none are converted.
        if connection.commands.overflow is not None:
            return
        for line in connection.commands.feed(data):
            if connection.topics is None:
                continue
            # A malformed command is skipped here; its bytes are recorded as a call.
            with suppress(MalformedMessage):
                command = parse_command(line, self._dialect)[0]
                if isinstance(command, Drive):
                    message = connection.topics.of_drive(command, time)
                    if message is not None:
                        yield message
