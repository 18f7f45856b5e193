"""Records the events of a run, from a host or from connections to a server.

A simulation depends only on its scene, configuration and seed, and on the calls of its
host: connections, received bytes and ticks. With the calls and the bytes sent to
clients, a run can be repeated and compared byte by byte. Descriptions of robots are for
readers of the recording, and are not needed to repeat the run. Bytes between clients
and a server in another program are recorded as calls of a host.
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

# Item types whose geometry and configuration a recording describes.
DESCRIBED: Final = ("Robot", "RangeScanner", "INS")


class EventType(IntEnum):
    """Kinds of events: calls of a ``Host``, and descriptions of robots and maps.

    The data of TURN, MAP and VIEW is packed by ``pack``.
    """

    CONNECT = 1
    DISCONNECT = 2
    RECEIVE = 3  # bytes from a client
    TAKE = 4  # bytes for a client
    FINISH = 5  # the last bytes for a client that has ended its input
    WAIT = 6  # ticks in which no simulated time passes; ``client`` counts them
    BEGIN = 7  # simulated time begins
    END = 8  # the recording ends
    ROBOT = 100  # a robot is new or has changed: its name, and its GEO and CONF lines
    TURN = 101  # a revolution of a radar on a client's robot; see ``TurnCollector``
    MAP = 102  # a map made during the run: arguments of ``occupancy_grid``
    VIEW = 103  # a view of the camera on a client's robot; see ``draw_views``
    PICTURE = 104  # a JPEG picture from the camera of a client's robot


class RunEvent(NamedTuple):
    """An event of a run: a call of the host, or a description.

    Attributes:
        type: Kind of the event.
        tick: Number of ticks of simulated time before the event.
        client: Number of the client.
        data: Bytes received from a client or sent to it, or a description.
    """

    type: EventType
    tick: int
    client: int = 0
    data: bytes = b""

    @property
    def is_call(self) -> bool:
        """Whether the event is a host call, which is needed to repeat the run."""
        return self.type <= EventType.END


def pack(*values: Any) -> bytes:
    """Encode values that fit into JSON, followed by one array, as bytes."""
    *head, array = values
    file = io.BytesIO()
    file.write(json.dumps(head).encode() + b"\n")
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def unpack(data: bytes) -> list[Any]:
    """Decode the values and the array that ``pack`` has encoded."""
    file = io.BytesIO(data)
    return [*json.loads(file.readline()), np.load(file, allow_pickle=False)]


class TurnCollector:
    """Collects the received power of an antenna until a revolution is complete."""

    def __init__(self, scanner: str, report: Callable[[bytes], None]) -> None:
        """Wait for the start of a revolution.

        Args:
            scanner: Name of the scanner item.
            report: Called with each complete revolution, as packed arguments of
                ``RobotTopics.of_turn``.
        """
        self._scanner, self._report = scanner, report
        self._began = 0.0  # s; time at which the revolution began
        self._rows: list[NDArray[np.uint8]] = []

    def take(self, sector: Sector, time: float) -> None:
        """Add the received power of a sector, whose first azimuth is at ``time``, s."""
        settings = sector.spectrum.settings
        if sector.first == 0:
            self._began = time
            self._rows.clear()  # discard an unfinished revolution
        elif not self._rows:  # the start of this revolution was missed
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
    """Records the calls of a ``Host``, and descriptions of its robots."""

    def __init__(
        self,
        record: Callable[[RunEvent], None],
        *,
        spectra: bool = False,
        camera_interval: int = 0,
    ) -> None:
        """Create a recorder that passes its events to a function.

        Args:
            record: Called with each event; it must not raise.
            spectra: Whether revolutions of FMCW radars are recorded as well.
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
        # The entry is removed, because it would keep the removed vehicle in memory.
        self._described.pop(client, None)
        self._report(EventType.DISCONNECT, client)

    def receive(self, client: int, data: bytes) -> None:
        """See ``HostObserver.receive``."""
        self._report(EventType.RECEIVE, client, data)

    def execute(self, client: int, vehicle: Vehicle | None) -> None:
        """Describe the robot of a client if it is new, or has new settings."""
        if vehicle is None:
            return
        # A changed setting creates a new configuration, so comparing identities is
        # enough. The comparison has to be fast, because it runs after every packet of
        # every client.
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
        # The description is recorded before the lines to the client, because converting
        # the lines into messages needs it.
        self._report(EventType.ROBOT, client, name + to_bytes(lines))

    def step(self, *, passes: bool) -> None:
        """See ``HostObserver.step``."""
        if not passes:
            self._idle_ticks += 1
            return
        self._report_wait()
        if self._camera_interval and self._tick % self._camera_interval == 0:
            assert self._simulation is not None  # time passes after ``begin``
            self._report_view(self._simulation)
        self._tick += 1

    def take(self, client: int, data: bytes) -> None:
        """See ``HostObserver.take``."""
        self._report(EventType.TAKE, client, data)

    def finish(self, client: int, data: bytes) -> None:
        """See ``HostObserver.finish``."""
        self._report(EventType.FINISH, client, data)

    def end(self) -> None:
        """Record the end of the recording."""
        self._report(EventType.END)

    def _report(self, type_: EventType, client: int = 0, data: bytes = b"") -> None:
        self._report_wait()
        self._record(RunEvent(type_, self._tick, client, data))

    def _report_wait(self) -> None:
        # Idle ticks are counted instead of recorded one by one. A server that is
        # paused, or waits for its engine, has a hundred idle ticks per second.
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
        """Record the revolutions of the radars on a robot."""
        report = partial(self._report, EventType.TURN, client)
        assert self._simulation is not None  # robots exist only after ``begin``
        for antenna in antennas_of(self._simulation).of(vehicle):
            collector = TurnCollector(antenna.mounted.item.name, report)
            # Listeners make the antenna rotate, but observers do not. So the recording
            # does not change the run.
            antenna.observers.append(collector.take)


FIRST: Final = 1  # number of the only client of a transport
UNNAMED: Final = "robot"  # name of a robot whose client has not sent a name
_DESCRIPTION: Final = re.compile(
    r"(GEO|CONF)\s*(?=.*?\{\s*Type\s+([^{}]*)\})(?=.*?\{\s*Name\s+(\S+))",
    re.IGNORECASE,  # either order: in udk the robot's CONF begins with its name
)
_TIME: Final = re.compile(rb"\{Time (\d{1,7}(?:\.\d+)?)\}")


@dataclass(slots=True)
class _Connection:
    """The state of a client's connection to the recorded server."""

    robot: str
    sent: LineBuffer = field(default_factory=LineBuffer)
    received: LineBuffer = field(default_factory=LineBuffer)
    descriptions: dict[tuple[str, ...], str] = field(default_factory=dict)


class WireRecorder:
    """Records bytes on connections to a server as calls of a ``Host``.

    The time of a call is the last time that the server has sent. Calls before the first
    reported time are kept until that time is known.

    Attributes:
        time: The last time that the server has sent, s.
    """

    def __init__(self, record: Callable[[RunEvent], None]) -> None:
        """Create a recorder without connections.

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
        """Record the connection of a client whose robot is known.

        Args:
            number: Number of the connection.
            robot: Name of the robot.
        """
        self._describe(number, self._connection(number, robot))

    def end_one(self, number: int) -> None:
        """Record the end of a connection."""
        if self._connections.pop(number, None) is not None:
            self._report(EventType.DISCONNECT, number)

    def sent(self, number: int, data: bytes) -> None:
        """Record bytes that a client sends on a connection."""
        connection = self._connection(number)
        self._report(EventType.RECEIVE, number, data)
        # After a line that is too long, bytes are still recorded but no longer parsed.
        if connection.sent.overflow is not None:
            return
        for line in connection.sent.feed(data):
            if spawned := spawned_robot(line):
                connection.robot = spawned[0] or spawned[1]
                # The descriptions of the old robot do not apply to the new robot.
                connection.descriptions.clear()
                self._describe(number, connection)

    def received(self, number: int, data: bytes) -> None:
        """Record bytes that the server sends on a connection."""
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
        # Clients may request the same descriptions again; only changes are recorded.
        if not connection.descriptions.items() >= set(found):
            connection.descriptions.update(found)
            self._describe(number, connection)

    def end(self) -> None:
        """Record the end of all connections."""
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
        """Store the last time in the server's bytes; ``data`` is None at the end."""
        found = _TIME.findall(data) if data is not None else []
        if found:
            # Robots report one after the other, so times may go back between lines.
            self.time = max(self.time, float(found[-1]))
        # Events before the first reported time get that time. If they got 0 s instead,
        # a recording of a server that has been running for hours would begin with a gap
        # of hours.
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
    """Records the reports of a watched server as calls of a ``Host``.

    Each robot is recorded as a client, to which the lines of the robot are sent.

    Attributes:
        numbers: Client numbers of the present robots, by name.
    """

    def __init__(self, record: Callable[[RunEvent], None]) -> None:
        """Create a recorder without robots; see ``WireRecorder``."""
        super().__init__(record)
        self.numbers: dict[str, int] = {}
        self._last_number = 0

    def take(self, report: Report) -> bytes:
        """Record a report about a robot.

        Returns:
            Queries to send about a new robot. A recording cannot be read without the
            answers, and the robot's own client may not send the queries.
        """
        asked = b""
        match report:
            case RobotJoined(robot, class_name):
                asked = self._join(robot)
                # A spawn command is recorded, because no other event contains the
                # robot's class.
                spawn = questions.spawn(class_name, name=robot)
                self.sent(self.numbers[robot], spawn.data)
            case RobotLeft(robot):
                self._leave(robot)
            case WatchedLine(robot, line):
                if robot not in self.numbers:  # no report says that it joined
                    asked = self._join(robot)
                data = f"{line}\r\n".encode("latin-1", "replace")
                self.received(self.numbers[robot], data)
            case _:
                pass
        return asked

    def _join(self, robot: str) -> bytes:
        self._leave(robot)  # ends a robot of that name that was not reported to leave
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
    """A TCP connection that records all bytes; see ``Transport``."""

    def __init__(self, host: str, port: int, recorder: WireRecorder) -> None:
        """Connect to a server.

        Args:
            host: Host name or address.
            port: TCP port.
            recorder: Recorder that is used for this connection only.
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
    """Return name and class of a robot from an INIT command; either may be empty.

    Args:
        line: A line of a client; the result is None for any other command.
    """
    with suppress(MalformedMessage):
        message = decode_message(line, keeps_closed=True)
        if message.verb.upper() == Init.verb:
            return message.name, (message.get("ClassName") or "").rpartition(".")[2]
    return None
