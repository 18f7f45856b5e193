"""The turning antennas of FMCW radars on robots.

Theory of operation
===================
In each tick an antenna turns by the directions that it passes in that time, each seen
from where the robot was then. A thread computes what it receives in every
``RECEPTION_TICKS`` together, while time goes on: that is there ``LATENCY`` ticks later,
always, so that nothing depends on how fast the machine is. When a turn is complete,
what its detector found becomes a scan. The first turn after a spawn is not read.

Where the thread is not done by then, the tick waits for it, before anything else is
computed, and so simulated time waits. What takes longer in one tick than in others is
made up for meanwhile, and delays nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np

from radarsim.addons.fmcw.targets import read_ranges
from radarsim.geometry import Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.processes import BackgroundThread
from radarsim.protocol.echoes import target_lines
from radarsim.raycast.robot_boxes import Boxes
from radarsim.scene.scene import Scene
from radarsim.simulation.clock import TICK, Clock
from radarsim.simulation.tick_output import DueScan, Faults, report_scan
from radarsim.simulation.vehicle import MountedScanner, Vehicle

if TYPE_CHECKING:
    from radarsim.addons.fmcw.rotation import (
        FoundTurn,
        Look,
        Received,
        Sector,
        TurnReceiver,
    )
    from radarsim.simulation.simulation import Simulation

# In a tick no more antennas turn: each takes a good part of a processor.
MOST_TURNING: Final = 1
LATENCY: Final = 5  # ticks until what is received is there
RECEPTION_TICKS: Final = 2  # of which all is received at once, which takes less time
ROUNDING: Final = 1e-9  # of directions


class SeenSector(NamedTuple):
    """What the radar of a robot has received.

    Attributes:
        sector: Neighbouring directions of a turn.
        time: When the antenna began to look into the first of them, s.
    """

    sector: Sector
    time: float


Listener = Callable[[SeenSector], None]


class Result(Protocol):
    """What a worker computes."""

    def result(self) -> Received:
        """Wait for it, and return it."""


class Worker(Protocol):
    """Computes what antennas receive, in the order in which it is asked for."""

    def submit(self, function: Callable[[Look], Received], look: Look, /) -> Result:
        """Return what the function will return."""


class _Computed(NamedTuple):
    """What is computed of a tick, and since when the antenna has turned by then."""

    tick: int
    since: int
    result: Result


@dataclass(slots=True, eq=False)
class Antenna:
    """The antenna of one scanner.

    Attributes:
        vehicle: The robot.
        mounted: The scanner.
        receiver: Computes what it receives; None before it turns.
        listeners: Called with all that is received; it turns for them.
        observers: Called likewise, but it does not turn for them.
        since: Tick in which it began to turn.
        turned: Tick in which it last turned.
        pose: Where it was then; None at first.
        computed: What is computed, or waits until its tick has come.
    """

    vehicle: Vehicle
    mounted: MountedScanner
    receiver: TurnReceiver | None = None
    listeners: list[Listener] = field(default_factory=list)
    observers: list[Listener] = field(default_factory=list)
    since: int = 0
    turned: int = 0
    pose: Pose3 | None = None
    computed: deque[_Computed] = field(default_factory=deque)

    @property
    def turns(self) -> bool:
        """Whether it turns, as somebody needs what it receives."""
        needed = self.mounted.scanner.settings.has_detector or bool(self.listeners)
        return needed and self.vehicle.alive

    def advance(self, scene: Scene, ticks: int, boxes: Boxes, worker: Worker) -> None:
        """Turn for a tick; begin anew if it did not turn in the tick before.

        Args:
            scene: The map.
            ticks: The tick.
            boxes: The robots.
            worker: Computes what it receives.
        """
        from radarsim.addons.fmcw import rotation  # noqa: PLC0415 - scipy is slow

        # After a rest the robot may be elsewhere: parts of two turns would be mixed.
        if self.receiver is None or self.turned != ticks - 1:
            radar, rng = self.mounted.scanner.fmcw, self.mounted.rng
            self.receiver = rotation.TurnReceiver(radar, scene, rng)
            self.since, self.pose = ticks, None
        settings, age = self.receiver.radar.settings, ticks - self.since
        rate = TICK * settings.rotation_hz * settings.azimuths
        passed = int((age + 1) * rate + ROUNDING) - int(age * rate + ROUNDING)
        pose = self.vehicle.sensor_pose(self.mounted.item)
        before = self.pose or pose
        vx, vy, vz = ((pose.position() - before.position()) / TICK).tolist()
        look = rotation.Look(
            passed,
            before,
            pose,
            (vx, vy, vz),
            boxes,
            self.vehicle.number,
            self.mounted.scanner.settings,
            receives=(ticks + 1 - self.since) % RECEPTION_TICKS == 0,
            is_recorded=bool(self.listeners or self.observers),
        )
        # A look holds all that it needs of this tick: the thread reads no simulation.
        result = worker.submit(self.receiver.advance, look)
        self.computed.append(_Computed(ticks, self.since, result))
        self.turned, self.pose = ticks, pose

    def receive(self, ticks: int) -> list[DueScan]:
        """Tell listeners what is received, and return the scans of whole turns."""
        scans = []
        while self.computed and self.computed[0].tick + LATENCY <= ticks:
            _, since, result = self.computed.popleft()
            try:
                received = result.result()
            except Exception as error:
                name, robot = self.mounted.item.name, self.vehicle.robot.name
                error.add_note(
                    f"in the thread of antennas: {name!r} of robot {robot!r}"
                )
                raise
            # The robot has left while the thread computed.
            if not self.vehicle.alive:
                continue
            for sector in received.sectors:
                settings = sector.spectrum.settings
                turns = sector.turn + sector.first / settings.azimuths
                seen = SeenSector(sector, _time_after(turns, settings, since))
                for listener in (*self.listeners, *self.observers):
                    listener(seen)
            if received.turn and self.mounted.scanner.settings.has_detector:
                scans.append(self._read(received.turn, since))
        return scans

    def _read(self, turn: FoundTurn, since: int) -> DueScan:
        """Return the scan that reads what was found in a turn."""
        assert self.receiver is not None
        vehicle, item = self.vehicle, self.mounted.item
        time = _time_after(turn.number + 1, self.receiver.radar.settings, since)
        ranges = read_ranges(turn.targets, turn.settings)
        ranges[np.isinf(ranges)] = turn.settings.max_range
        scan = report_scan(time, item.name, turn.settings, ranges)
        is_requested = self.mounted.sends_targets
        if not is_requested and not vehicle.shows_echoes:
            return DueScan(vehicle, scan)
        lines = target_lines(time, item.name, *turn.targets)
        return DueScan(vehicle, scan, lines, is_requested)


def _time_after(turns: float, settings: FmcwSettings, since: int) -> float:
    """Return when an antenna has made so many turns after the first one, s."""
    return (since - 1) * TICK + (turns + 1) / settings.rotation_hz


class Antennas:
    """All antennas of a simulation.

    Attributes:
        worker: Computes what they receive.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        """Start without any.

        Args:
            scene: The map.
            clock: Simulated time.
        """
        self.worker: Worker = BackgroundThread()
        self._scene, self._clock = scene, clock
        self._antennas: dict[int, list[Antenna]] = {}
        self._before = -1, Boxes(np.zeros((0, 8)))  # the last tick with boxes

    def add(self, vehicle: Vehicle) -> None:
        """Add the antennas of a robot."""
        carried = [Antenna(vehicle, each) for each in vehicle.scanners if each.has_fmcw]
        if carried:
            self._antennas[vehicle.number] = carried

    def remove(self, vehicle: Vehicle) -> None:
        """Remove the antennas of a robot."""
        self._antennas.pop(vehicle.number, None)

    @property
    def turning(self) -> Sequence[Antenna]:
        """Those that turn, of the robots that have been there for longest."""
        return [each for each in self._every() if each.turns][:MOST_TURNING]

    def of(self, vehicle: Vehicle) -> Sequence[Antenna]:
        """Return the antennas of a robot."""
        return self._antennas.get(vehicle.number, ())

    def carriers(self) -> Sequence[Vehicle]:
        """Return the robots that have antennas, in the order of spawning."""
        return [carried[0].vehicle for carried in self._antennas.values()]

    def read_due(
        self, find_boxes: Callable[[], Boxes], faults: Faults
    ) -> list[DueScan]:
        """Turn all that turn for a tick; return the scans that are received in it.

        Args:
            find_boxes: Returns the robots.
            faults: For errors of single robots.
        """
        ticks, turning = self._clock.ticks, self.turning
        if turning:
            boxes = self._with_velocities(find_boxes(), ticks)
            for antenna in turning:
                faults.call(
                    antenna.vehicle,
                    antenna.advance,
                    self._scene,
                    ticks,
                    boxes,
                    self.worker,
                )
        return [
            scan
            for each in self._every()
            for scan in faults.call(each.vehicle, each.receive, ticks) or ()
        ]

    def _with_velocities(self, boxes: Boxes, ticks: int) -> Boxes:
        """Return boxes with their velocities since the last tick; new ones stand."""
        last, before = self._before
        velocities = np.zeros((len(boxes.rows), 2))
        if last == ticks - 1:
            now, then = before.find(boxes.rows[:, 7].astype(np.int64))
            moved = boxes.rows[now, :2] - before.rows[then, :2]
            velocities[now] = moved / TICK
        self._before = ticks, boxes
        return Boxes(boxes.rows, velocities)

    def _every(self) -> list[Antenna]:
        return [each for carried in self._antennas.values() for each in carried]


def antennas_of(simulation: Simulation) -> Antennas:
    """Return all antennas of a simulation."""
    antennas = simulation.scanner_items["fmcw"]
    assert isinstance(antennas, Antennas)
    return antennas
