"""Events of a run, recorded by observers of a host, or of connections to a server.

A simulation depends on nothing but its scene, configuration and seed, and on the calls
of its host: who connects, what arrives, and when time passes. With these, and with what
clients were given, a run can be repeated and compared byte by byte. Descriptions of
robots are for those who read the recording; no repetition needs them. Bytes between
clients and a server that is another program become calls as of a host.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass, field
from enum import IntEnum
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.image_files import encoder_counts, put_metadata
from radarsim.addons.fmcw.rotation_schedule import antennas_of
from radarsim.client import session as questions
from radarsim.client.transport import SocketTransport
from radarsim.errors import MalformedMessage
from radarsim.protocol.commands import Init
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LineBuffer, decode_message
from radarsim.protocol.reports import (
    Report,
    RobotJoined,
    RobotLeft,
    WatchedLine,
    to_bytes,
)
from radarsim.server.host import HostObserver
from radarsim.server.host.replies import configuration, geometry
from radarsim.server.views import View

if TYPE_CHECKING:
    from radarsim.addons.fmcw.rotation import Sector
    from radarsim.simulation.config import SimulationConfig
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

# Types of items that a recording describes when their robot is spawned.
DESCRIBED: Final = ("Robot", "RangeScanner", "INS")


class EventType(IntEnum):
    """Kinds of events: calls of a host, and descriptions of a run.

    The data of a revolution, a map and a view are packed by ``pack``.
    """

    CONNECT = 1
    DISCONNECT = 2
    RECEIVE = 3  # bytes of a client
    TAKE = 4  # bytes for a client
    FINISH = 5  # the last bytes for a client that sends no more
    WAIT = 6  # ticks in which no simulated time passes; ``client`` counts them
    BEGIN = 7  # simulated time begins
    END = 8  # the recording ends
    ROBOT = 100  # a robot is new, or has changed: its name, and answers about it
    TURN = 101  # a revolution of a robot's radar; see ``TurnCollector``
    MAP = 102  # a map that is made in the run: arguments of ``occupancy_grid``
    VIEW = 103  # what the camera on the robot of a client looks at; see ``draw_views``
    PICTURE = 104  # a picture of that camera, as JPEG


class RunEvent(NamedTuple):
    """A call of a host, or a description.

    Attributes:
        type: What was done.
        tick: How many ticks of simulated time had passed.
        client: Number of the client.
        data: Bytes that were received from a client, or sent to it, or a description.
    """

    type: EventType
    tick: int
    client: int = 0
    data: bytes = b""

    @property
    def is_call(self) -> bool:
        """Whether the run is repeated with it."""
        return self.type <= EventType.END


def pack(*values: Any) -> bytes:
    """Return values of JSON, and an array after them, as data of an event."""
    *head, array = values
    file = io.BytesIO()
    file.write(json.dumps(head).encode() + b"\n")
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def unpack(data: bytes) -> list[Any]:
    """Return the values that ``pack`` was called with."""
    file = io.BytesIO(data)
    return [*json.loads(file.readline()), np.load(file, allow_pickle=False)]


class TurnCollector:
    """Collects the received power of an antenna until a revolution is complete."""

    def __init__(self, scanner: str, report: Callable[[bytes], None]) -> None:
        """Wait for the beginning of a revolution.

        Args:
            scanner: Name of the scanner item.
            report: Called with each complete revolution: the packed arguments of
                ``RobotTopics.of_turn``.
        """
        self._scanner, self._report = scanner, report
        self._began = 0.0  # s
        self._rows: list[NDArray[np.uint8]] = []

    def take(self, sector: Sector, time: float) -> None:
        """Add the received power of neighbouring azimuths, from a time on, s."""
        settings = sector.spectrum.settings
        if sector.first == 0:
            self._began = time
            self._rows.clear()  # of one that the antenna did not end
        elif not self._rows:  # it began before anybody listened
            return
        rows = np.arange(len(sector.spectrum.counts))
        times = np.rint(1e6 * (time + rows * settings.sweep_time))
        encoder = encoder_counts(settings.azimuths)[sector.first + rows]
        packed = put_metadata(sector.spectrum.counts, times.astype(np.int64), encoder)
        self._rows.append(packed)
        if sector.ends_turn:
            turn = np.concatenate(self._rows)
            self._rows.clear()
            data = pack(self._scanner, self._began, settings.bin_size, turn)
            self._report(data)


class HostRecorder(HostObserver):
    """Reports the calls of a host, and describes its robots."""

    def __init__(
        self,
        record: Callable[[RunEvent], None],
        *,
        spectra: bool = False,
        camera_interval: int = 0,
    ) -> None:
        """Report to a function.

        Args:
            record: Called with each event; it must not raise.
            spectra: Whether revolutions of FMCW radars are reported as well.
            camera_interval: Ticks between two views of the first robot's camera; 0 for
                none.
        """
        self._record = record
        self._camera_interval = camera_interval
        self._spectra = spectra
        self._tick = 0
        self._idle_ticks = 0
        self._simulation: Simulation | None = None
        self._described: dict[int, tuple[Vehicle, SimulationConfig]] = {}

    def begin(self, simulation: Simulation) -> None:
        """See ``HostObserver.begin``."""
        self._simulation = simulation
        self._report(EventType.BEGIN)

    def connect(self, client: int) -> None:
        """See ``HostObserver.connect``."""
        self._report(EventType.CONNECT, client)

    def disconnect(self, client: int) -> None:
        """See ``HostObserver.disconnect``."""
        # Its number does not come again, but vehicles would be kept alive.
        self._described.pop(client, None)
        self._report(EventType.DISCONNECT, client)

    def receive(self, client: int, data: bytes) -> None:
        """See ``HostObserver.receive``."""
        self._report(EventType.RECEIVE, client, data)

    def execute(self, client: int, vehicle: Vehicle | None) -> None:
        """Describe the robot of a client if it is new, or has new settings."""
        if vehicle is None:
            return
        # A changed setting makes another configuration, so that comparing identities is
        # enough; it is done after every packet of every client.
        known, config = self._described.get(client, (None, None))
        if known is vehicle and config is vehicle.config:
            return
        self._described[client] = vehicle, vehicle.config
        if self._spectra and known is not vehicle:
            self._observe_antennas(client, vehicle)
        reports = []
        for kind in DESCRIBED:
            reports.append(geometry(vehicle.model, kind, None))
            reports.append(configuration(vehicle.model, vehicle.config, kind, None))
        dialect = vehicle.config.dialect
        lines = [report.encode(dialect) for report in reports if report is not None]
        name = f"{vehicle.robot.name}\r\n".encode()
        # Before what the robot is sent, as messages are made by its description.
        self._report(EventType.ROBOT, client, name + to_bytes(lines))

    def step(self, *, passes: bool) -> None:
        """See ``HostObserver.step``."""
        if not passes:
            self._idle_ticks += 1
            return
        self._report_wait()
        if self._camera_interval and self._tick % self._camera_interval == 0:
            assert self._simulation is not None  # else no time passes
            self._report_view(self._simulation)
        self._tick += 1

    def take(self, client: int, data: bytes) -> None:
        """See ``HostObserver.take``."""
        self._report(EventType.TAKE, client, data)

    def finish(self, client: int, data: bytes) -> None:
        """See ``HostObserver.finish``."""
        self._report(EventType.FINISH, client, data)

    def end(self) -> None:
        """Report that no more calls come."""
        self._report(EventType.END)

    def _report(self, type_: EventType, client: int = 0, data: bytes = b"") -> None:
        self._report_wait()
        self._record(RunEvent(type_, self._tick, client, data))

    def _report_wait(self) -> None:
        # Idle ticks are counted, not reported one by one: a server can wait for its
        # engine, or be paused, and a hundred times a second, for minutes.
        if self._idle_ticks:
            idle, self._idle_ticks = self._idle_ticks, 0
            self._record(RunEvent(EventType.WAIT, self._tick, idle))

    def _report_view(self, simulation: Simulation) -> None:
        first = simulation.vehicles[0] if simulation.vehicles else None
        for client, (vehicle, _) in self._described.items():
            if vehicle is first:
                view = View.of(simulation)
                data = pack(astuple(view.camera), view.carrier_id, view.boxes.rows)
                self._report(EventType.VIEW, client, data)

    def _observe_antennas(self, client: int, vehicle: Vehicle) -> None:
        """Report the revolutions of the radars on a robot."""
        report = partial(self._report, EventType.TURN, client)
        assert self._simulation is not None  # there is a robot
        for antenna in antennas_of(self._simulation).of(vehicle):
            collector = TurnCollector(antenna.mounted.item.name, report)
            # An observer, no listener: the antenna must not turn because it is
            # recorded.
            antenna.observers.append(collector.take)


FIRST: Final = 1  # number of the only client of a transport
UNNAMED: Final = "robot"  # one whose name no client has sent
_DESCRIPTION: Final = re.compile(
    r"(GEO|CONF)\s*(?=.*?\{\s*Type\s+([^{}]*)\})(?=.*?\{\s*Name\s+(\S+))",
    re.IGNORECASE,  # in either order: the robot's CONF begins with its name in udk
)
_TIME: Final = re.compile(rb"\{Time (\d{1,7}(?:\.\d+)?)\}")


@dataclass(slots=True)
class _Connection:
    """The state of one connection."""

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
    """Turns the reports of a server to its watchers into calls as of a host.

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
        """Record a report about a robot.

        Returns:
            Questions about a robot that is new: its own client need not ask them, and a
            recording cannot be read without the answers.
        """
        asked = b""
        match report:
            case RobotJoined(robot, class_name):
                asked = self._join(robot)
                # No other event has its class.
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
        self._leave(robot)  # one of the same name, whose leaving was not reported
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
