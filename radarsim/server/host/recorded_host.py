"""A host that reports what is done to it, call by call, so that a run can be repeated.

A simulation depends on nothing but its scene, configuration and seed, and on the calls
of its host: who connects, what arrives, and when time passes. With these, and with what
clients were given, a run can be repeated and compared byte by byte.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from radarsim.protocol.reports import Report, to_bytes
from radarsim.server.host.connection import Client, Diagnostic
from radarsim.server.host.host import Host
from radarsim.server.host.replies import configuration, geometry
from radarsim.server.host.turn_collector import RecordedTurn, TurnCollector

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
    ROBOT = 9  # lines that describe the new robot of a client; not a call
    MESSAGE = 10  # a message for a topic of the recording; not a call
    TURN = 11  # a turn of a radar on the robot of a client; not a call


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


class RecordedHost(Host):
    """A host that reports its calls."""

    def __init__(
        self,
        record: Callable[[HostCall], None],
        *args: Any,
        spectra: bool = False,
        **options: Any,
    ) -> None:
        """Create a host.

        Args:
            record: Called after each call; it must not raise.
            args: Arguments of ``Host``.
            spectra: Whether turns of FMCW radars are reported as well.
            options: Options of ``Host``.
        """
        self._record = record
        self._spectra = spectra
        self._tick = 0
        self._idle_ticks = 0
        self._described: dict[int, tuple[Vehicle, SimulationConfig]] = {}
        super().__init__(*args, **options)

    def begin(self, simulation: Simulation) -> None:
        """See ``Host.begin``."""
        super().begin(simulation)
        self._report(CallKind.BEGIN)

    def connect(self) -> int:
        """See ``Host.connect``."""
        number = super().connect()
        self._report(CallKind.CONNECT, number)
        return number

    def disconnect(self, number: int) -> None:
        """See ``Host.disconnect``."""
        super().disconnect(number)
        self._described.pop(number, None)
        self._report(CallKind.DISCONNECT, number)

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        """See ``Host.receive``."""
        self._report(CallKind.RECEIVE, number, data)
        diagnostics = super().receive(number, data)
        self._describe_robot(self._clients[number])
        return diagnostics

    def step(self) -> list[tuple[int, Diagnostic]]:
        """See ``Host.step``."""
        if self.has_begun:
            self._tick += 1
        else:
            self._idle_ticks += 1
        waiting = sorted(self._waiting)  # only their commands are executed in a tick
        diagnostics = super().step()
        for number in waiting:
            self._describe_robot(self._clients[number])
        return diagnostics

    def take(self, number: int) -> bytes:
        """See ``Host.take``."""
        data = super().take(number)
        if data:
            self._report(CallKind.TAKE, number, data)
        return data

    def finish(self, number: int) -> bytes:
        """See ``Host.finish``."""
        data = super().finish(number)
        self._report(CallKind.FINISH, number, data)
        return data

    def end_recording(self) -> None:
        """Report that no more calls come."""
        self._report(CallKind.END)

    def _report(self, kind: CallKind, client: int = 0, data: bytes = b"") -> None:
        if self._idle_ticks:
            idle, self._idle_ticks = self._idle_ticks, 0
            self._record(HostCall(CallKind.WAIT, self._tick, idle))
        self._record(HostCall(kind, self._tick, client, data))

    def _describe_robot(self, client: Client) -> None:
        """Describe the robot of a client if it is new, or has new settings."""
        vehicle = client.vehicle
        if vehicle is None:
            return
        state = vehicle, vehicle.config
        known = self._described.get(client.number)
        if known is not None and known[0] is vehicle and known[1] is vehicle.config:
            return
        self._described[client.number] = state
        if self._spectra and (known is None or known[0] is not vehicle):
            self._observe_antennas(client.number, vehicle)
        reports: list[Report | None] = []
        for kind in DESCRIBED:
            reports.append(geometry(vehicle.model, kind, None))
            reports.append(configuration(vehicle.model, vehicle.config, kind, None))
        dialect = self.config.dialect
        lines = [report.encode(dialect) for report in reports if report is not None]
        data = vehicle.robot.name.encode() + b"\r\n" + to_bytes(lines)
        self._report(CallKind.ROBOT, client.number, data)

    def _observe_antennas(self, client: int, vehicle: Vehicle) -> None:
        """Report the turns of the radars on a robot."""

        def report(turn: RecordedTurn) -> None:
            self._report(CallKind.TURN, client, turn.to_bytes())

        for antenna in self.simulation.antennas.of(vehicle):
            collector = TurnCollector(antenna.mounted.item.name, report)
            antenna.observers.append(collector.take)
