"""What is recorded of a run, and who listens to a host for it.

A simulation depends on nothing but its scene, configuration and seed, and on the calls
of its host: who connects, what arrives, and when time passes. With these, and with what
clients were given, a run can be repeated and compared byte by byte. What else is told
of robots is for those who read the recording; no repetition needs it.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import astuple
from enum import IntEnum
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.image_files import encoder_counts, put_metadata
from radarsim.addons.fmcw.rotation_schedule import antennas_of
from radarsim.protocol.reports import to_bytes
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
    """What is recorded: calls of a host, and what else is told of a run.

    The data of a turn, a map and a view are packed by ``pack``.
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
    TURN = 101  # a turn of a radar on the robot of a client; see ``TurnCollector``
    MAP = 102  # a map that is made in the run: the arguments of ``map_topic``
    VIEW = 103  # what the camera on the robot of a client looks at; see ``draw_views``
    PICTURE = 104  # a picture of that camera, as JPEG


class RunEvent(NamedTuple):
    """A call of a host, or what is told of a run beside its calls.

    Attributes:
        type: What was done.
        tick: How many ticks of simulated time had passed.
        client: Number of the client.
        data: Bytes that were received from a client, or sent to it, or what is told.
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
    """Collects what an antenna receives until a turn is complete."""

    def __init__(self, scanner: str, report: Callable[[bytes], None]) -> None:
        """Wait for the beginning of a turn.

        Args:
            scanner: Name of the scanner item.
            report: Called with each turn, once it is complete: the packed arguments of
                ``RobotTopics.of_turn``.
        """
        self._scanner, self._report = scanner, report
        self._began = 0.0  # s
        self._rows: list[NDArray[np.uint8]] = []

    def take(self, sector: Sector, time: float) -> None:
        """Add what is received from neighbouring directions, from a time on, s."""
        settings = sector.spectrum.settings
        if sector.first == 0:
            self._began = time
            self._rows.clear()  # of one that the antenna did not end
        elif not self._rows:  # the turn began before anybody listened
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
            spectra: Whether turns of FMCW radars are reported as well.
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
        """Report the turns of the radars on a robot."""
        report = partial(self._report, EventType.TURN, client)
        assert self._simulation is not None  # there is a robot
        for antenna in antennas_of(self._simulation).of(vehicle):
            collector = TurnCollector(antenna.mounted.item.name, report)
            # An observer, no listener: the antenna must not turn because it is
            # recorded.
            antenna.observers.append(collector.take)
