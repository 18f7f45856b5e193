"""What is recorded of a run, so that it can be repeated, and who listens to a host.

A simulation depends on nothing but its scene, configuration and seed, and on the calls
of its host: who connects, what arrives, and when time passes. With these, and with what
clients were given, a run can be repeated and compared byte by byte. What else is told
of robots is for those who read the recording; no repetition needs it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from enum import IntEnum
from typing import TYPE_CHECKING, Final, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antennas import antennas_of
from radarsim.addons.fmcw.turn_collector import RecordedTurn, TurnCollector
from radarsim.protocol.reports import to_bytes
from radarsim.server.host import HostObserver
from radarsim.server.host.replies import configuration, geometry

if TYPE_CHECKING:
    from radarsim.simulation.config import SimulationConfig
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

# Types of items that a recording describes when their robot is spawned.
DESCRIBED: Final = ("Robot", "RangeScanner")


class CallKind(IntEnum):
    """What is done to a host."""

    CONNECT = 1
    DISCONNECT = 2
    RECEIVE = 3  # bytes of a client
    TAKE = 4  # bytes for a client
    FINISH = 5  # the last bytes for a client that sends no more
    WAIT = 6  # ticks before simulated time begins; ``client`` counts them
    BEGIN = 7  # simulated time begins
    END = 8  # the recording ends


class HostCall(NamedTuple):
    """One call of a host.

    Attributes:
        kind: What was done.
        tick: How many ticks of simulated time had passed.
        client: Number of the client.
        data: Bytes that were received from a client, or sent to it.
    """

    kind: CallKind
    tick: int
    client: int = 0
    data: bytes = b""


class RobotDescription(NamedTuple):
    """What is known of the robot of a client: if it is new, or something has changed.

    Attributes:
        tick: As in ``HostCall``.
        client: Number of the client.
        text: Lines that end with CRLF: the robot's name, and answers of the server
            about it.
    """

    tick: int
    client: int
    text: str


class ReceivedTurn(NamedTuple):
    """A turn of a radar on the robot of a client.

    Attributes:
        tick: As in ``HostCall``.
        client: Number of the client.
        turn: What it received.
    """

    tick: int
    client: int
    turn: RecordedTurn


class MapSnapshot(NamedTuple):
    """A map that is made in the run.

    Attributes:
        tick: As in ``HostCall``.
        time: Simulated time of the last scan in it, s.
        corner: x and y of its south-west corner, m.
        resolution: Side of a cell, m.
        cells: (R, C) int8, -1 unknown, 0 free to 100 occupied; the first row is the
            southernmost.
    """

    tick: int
    time: float
    corner: tuple[float, float]
    resolution: float
    cells: NDArray[np.int8]

    def to_bytes(self) -> bytes:
        """Return all but the tick."""
        head = (self.time, self.corner, self.resolution, self.cells.shape)
        return json.dumps(head).encode() + b"\n" + self.cells.tobytes()

    @classmethod
    def from_bytes(cls, tick: int, data: bytes) -> Self:
        """Read what ``to_bytes`` has returned."""
        head, _, cells = data.partition(b"\n")
        time, (x, y), resolution, shape = json.loads(head)
        array = np.frombuffer(cells, np.int8).reshape(shape)
        return cls(tick, time, (x, y), resolution, array)


RunEvent: TypeAlias = HostCall | RobotDescription | ReceivedTurn | MapSnapshot


class HostRecorder(HostObserver):
    """Reports the calls of a host, and describes its robots."""

    def __init__(
        self, record: Callable[[RunEvent], None], *, spectra: bool = False
    ) -> None:
        """Report to a function.

        Args:
            record: Called with each event; it must not raise.
            spectra: Whether turns of FMCW radars are reported as well.
        """
        self._record = record
        self._spectra = spectra
        self._tick = 0
        self._idle_ticks = 0
        self._simulation: Simulation | None = None
        self._described: dict[int, tuple[Vehicle, SimulationConfig]] = {}

    def begin(self, simulation: Simulation) -> None:
        """See ``HostObserver.begin``."""
        self._simulation = simulation
        self._report(CallKind.BEGIN)

    def connect(self, client: int) -> None:
        """See ``HostObserver.connect``."""
        self._report(CallKind.CONNECT, client)

    def disconnect(self, client: int) -> None:
        """See ``HostObserver.disconnect``."""
        self._described.pop(client, None)
        self._report(CallKind.DISCONNECT, client)

    def receive(self, client: int, data: bytes) -> None:
        """See ``HostObserver.receive``."""
        self._report(CallKind.RECEIVE, client, data)

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
        self._tell_idle_ticks()
        # Before what the robot is sent, as messages are made by its description.
        text = _description(vehicle)
        self._record(RobotDescription(self._tick, client, text))

    def step(self) -> None:
        """See ``HostObserver.step``."""
        if self._simulation is not None:
            self._tick += 1
        else:
            self._idle_ticks += 1

    def take(self, client: int, data: bytes) -> None:
        """See ``HostObserver.take``."""
        self._report(CallKind.TAKE, client, data)

    def finish(self, client: int, data: bytes) -> None:
        """See ``HostObserver.finish``."""
        self._report(CallKind.FINISH, client, data)

    def end(self) -> None:
        """Report that no more calls come."""
        self._report(CallKind.END)

    def _report(self, kind: CallKind, client: int = 0, data: bytes = b"") -> None:
        self._tell_idle_ticks()
        self._record(HostCall(kind, self._tick, client, data))

    def _tell_idle_ticks(self) -> None:
        # Idle ticks are counted, not reported one by one: a server can wait for its
        # engine, and a hundred times a second, for minutes.
        if self._idle_ticks:
            idle, self._idle_ticks = self._idle_ticks, 0
            self._record(HostCall(CallKind.WAIT, self._tick, idle))

    def _observe_antennas(self, client: int, vehicle: Vehicle) -> None:
        """Report the turns of the radars on a robot."""

        def report(turn: RecordedTurn) -> None:
            self._record(ReceivedTurn(self._tick, client, turn))

        assert self._simulation is not None  # there is a robot
        for antenna in antennas_of(self._simulation).of(vehicle):
            collector = TurnCollector(antenna.mounted.item.name, report)
            antenna.observers.append(collector.take)


def _description(vehicle: Vehicle) -> str:
    reports = []
    for kind in DESCRIBED:
        reports.append(geometry(vehicle.model, kind, None))
        reports.append(configuration(vehicle.model, vehicle.config, kind, None))
    dialect = vehicle.config.dialect
    lines = [report.encode(dialect) for report in reports if report is not None]
    return f"{vehicle.robot.name}\r\n{to_bytes(lines).decode()}"
