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
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from radarsim.addons.fmcw.targets import read_ranges
from radarsim.errors import ClientError, expected_one_of
from radarsim.geometry import Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.processes import BackgroundThread
from radarsim.protocol.echoes import target_lines
from radarsim.raycast.rays import Boxes
from radarsim.scene.scene import Scene
from radarsim.simulation.clock import TICK, Clock
from radarsim.simulation.tick_output import DueScan, Faults, report_scan
from radarsim.simulation.vehicle import MountedScanner, Vehicle

if TYPE_CHECKING:
    from radarsim.addons.fmcw.rotation import Received, Sector, TurnReceiver
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.presets.sensor_settings import SensorSettings
    from radarsim.sensors.scan import Targets
    from radarsim.simulation.simulation import Simulation

# In a tick no more antennas turn: each takes a good part of a processor.
MOST_TURNING: Final = 1
LATENCY: Final = 5  # ticks until what is received is there
RECEPTION_TICKS: Final = 2  # of which all is received at once, which takes less time
ROUNDING: Final = 1e-9  # of directions


# Called with neighbouring directions of a turn, and when the antenna began to look into
# the first of them, s.
Listener: TypeAlias = Callable[["Sector", float], None]


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
        computed: What is computed, or waits until its tick has come: the tick, since
            when the antenna has turned by then, and the result.
    """

    vehicle: Vehicle
    mounted: MountedScanner
    receiver: TurnReceiver | None = None
    listeners: list[Listener] = field(default_factory=list)
    observers: list[Listener] = field(default_factory=list)
    since: int = 0
    turned: int = 0
    pose: Pose3 | None = None
    computed: deque[tuple[int, int, Future[Received]]] = field(default_factory=deque)

    @property
    def turns(self) -> bool:
        """Whether it turns, as somebody needs what it receives."""
        needed = self.mounted.scanner.settings.has_detector or bool(self.listeners)
        return needed and self.vehicle.alive

    def advance(
        self, scene: Scene, ticks: int, boxes: Boxes, worker: BackgroundThread
    ) -> None:
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
        it, age = self.receiver.radar.settings, ticks - self.since
        rate = TICK * it.rotation_hz * it.azimuths
        passed = int((age + 1) * rate + ROUNDING) - int(age * rate + ROUNDING)
        pose = self.vehicle.sensor_pose(self.mounted.item)
        before = self.pose or pose
        vx, vy, vz = ((pose.position() - before.position()) / TICK).tolist()
        # These are all that it needs of this tick: the thread reads no simulation.
        result = worker.submit(
            self.receiver.receive,
            self.mounted.scanner.settings,
            bool(self.listeners or self.observers),
            pose,
            passed,
            start=before,
            boxes=boxes,
            carrier_id=self.vehicle.number,
            velocity=(vx, vy, vz),
            receives=(ticks + 1 - self.since) % RECEPTION_TICKS == 0,
        )
        self.computed.append((ticks, self.since, result))
        self.turned, self.pose = ticks, pose

    def receive(self, ticks: int) -> list[DueScan]:
        """Tell listeners what is received, and return the scans of whole turns."""
        scans = []
        while self.computed and self.computed[0][0] + LATENCY <= ticks:
            _, since, result = self.computed.popleft()
            try:
                sectors, turn = result.result()
            except Exception as error:
                name, robot = self.mounted.item.name, self.vehicle.robot.name
                error.add_note(
                    f"in the thread of antennas: {name!r} of robot {robot!r}"
                )
                raise
            # The robot has left while the thread computed.
            if not self.vehicle.alive:
                continue
            for sector in sectors:
                it = sector.spectrum.settings
                time = _time_after(sector.turn + sector.first / it.azimuths, it, since)
                for listener in (*self.listeners, *self.observers):
                    listener(sector, time)
            if turn and self.mounted.scanner.settings.has_detector:
                scans.append(self._read(*turn, since))
        return scans

    def _read(
        self, number: int, targets: Targets, settings: SensorSettings, since: int
    ) -> DueScan:
        """Return the scan that reads what was found in a turn."""
        assert self.receiver is not None
        vehicle, item = self.vehicle, self.mounted.item
        time = _time_after(number + 1, self.receiver.radar.settings, since)
        ranges = read_ranges(targets, settings)
        ranges[np.isinf(ranges)] = settings.max_range
        scan = report_scan(time, item.name, settings, ranges)
        is_requested = self.mounted.sends_targets
        if not is_requested and not vehicle.shows_echoes:
            return DueScan(vehicle, scan)
        lines = target_lines(time, item.name, *targets[:3])
        return DueScan(vehicle, scan, lines, is_requested)


def _time_after(turns: float, settings: FmcwSettings, since: int) -> float:
    """Return when an antenna has made so many turns after the first one, s."""
    return (since - 1) * TICK + (turns + 1) / settings.rotation_hz


class Antennas:
    """All antennas of a simulation.

    Attributes:
        all: The antennas, in the order in which their robots were spawned.
        worker: Computes what they receive.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        """Start without any.

        Args:
            scene: The map.
            clock: Simulated time.
        """
        self.worker = BackgroundThread()
        self._scene, self._clock = scene, clock
        self.all: list[Antenna] = []
        self._before = -1, Boxes(np.zeros((0, 8)))  # the last tick with boxes

    def add(self, vehicle: Vehicle) -> None:
        """Add the antennas of a robot."""
        carried = [Antenna(vehicle, each) for each in vehicle.scanners if each.has_fmcw]
        self.all = [*self.all, *carried]

    def remove(self, vehicle: Vehicle) -> None:
        """Remove the antennas of a robot."""
        self.all = [each for each in self.all if each.vehicle is not vehicle]

    def of(self, vehicle: Vehicle) -> list[Antenna]:
        """Return the antennas of a robot."""
        return [each for each in self.all if each.vehicle is vehicle]

    @property
    def turning(self) -> list[Antenna]:
        """Those that turn, of the robots that have been there for longest."""
        return [each for each in self.all if each.turns][:MOST_TURNING]

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
            for each in self.all
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


def antennas_of(simulation: Simulation) -> Antennas:
    """Return all antennas of a simulation."""
    antennas = simulation.scanner_items["fmcw"]
    assert isinstance(antennas, Antennas)
    return antennas


class TurnCollection:
    """Joins what an antenna receives to whole turns.

    Attributes:
        newest: The last whole turn, from the pose at which it began; None before it.
    """

    def __init__(self) -> None:
        self.newest: Spectrum | None = None
        self._sectors: list[Sector] = []

    def take(self, sector: Sector, _: float) -> None:
        """Add what is received from neighbouring directions."""
        if sector.first == 0:
            self._sectors.clear()  # of a turn that the antenna did not end
        elif not self._sectors:  # the turn began before anybody listened
            return
        self._sectors.append(sector)
        if sector.ends_turn:
            from radarsim.addons.fmcw.rotation import join_sectors  # noqa: PLC0415

            self.newest = join_sectors(self._sectors)


def collect_turns(
    simulation: Simulation, vehicle: Vehicle, scanner: str | None
) -> TurnCollection:
    """Let the FMCW radar of a robot turn, and collect what it receives.

    Args:
        simulation: The simulation.
        vehicle: The robot.
        scanner: Name of the radar, in any case; None for the robot's first.

    Raises:
        ClientError: If the robot has no such FMCW radar.
    """
    antennas = antennas_of(simulation).of(vehicle)
    names = [each.mounted.item.name for each in antennas]
    for name, antenna in zip(names, antennas, strict=True):
        if scanner is None or name.casefold() == scanner.casefold():
            collection = TurnCollection()
            antenna.listeners.append(collection.take)
            return collection
    if scanner is None:
        text = f"robot {vehicle.robot.name!r} has no FMCW radar"
        raise ClientError(f"{text}, expected such as a P3AT_Navtech")
    raise ClientError(f"FMCW radar {expected_one_of(scanner, names)}")
