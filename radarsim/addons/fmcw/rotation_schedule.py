"""The rotating antennas of FMCW radars on robots, and the times when their data is due.

Theory of operation
===================
In each tick an antenna passes several azimuths, each from the pose of the robot at that
time. A thread computes the received data of ``RECEPTION_TICKS`` ticks together, while
simulated time advances. The data is always available ``LATENCY`` ticks later, so
results do not depend on the speed of the machine. When a revolution is complete, the
targets of its detector become a scan. The first revolution after a spawn is not read.

If the thread is late, the tick, and with it simulated time, waits for the thread. A
tick that takes longer than others causes no delay as long as the thread catches up
within ``LATENCY`` ticks.
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

# Maximum number of rotating antennas; each uses a large part of a processor.
MOST_TURNING: Final = 1
LATENCY: Final = 5  # ticks until received data is available
RECEPTION_TICKS: Final = 2  # ticks that are computed together, which is faster
ROUNDING: Final = 1e-9  # tolerance of the number of azimuths for rounding errors


# A function that receives consecutive azimuths, and the time of the first azimuth, s.
Listener: TypeAlias = Callable[["Sector", float], None]


@dataclass(slots=True, eq=False)
class Antenna:
    """The antenna of an FMCW radar on a robot.

    Attributes:
        vehicle: The robot.
        mounted: The scanner.
        receiver: Computes the received data; None before the antenna rotates.
        listeners: Functions that receive all data; the antenna rotates for them.
        observers: Functions that receive all data, but do not start the rotation.
        since: Tick in which the rotation began.
        turned: Last tick in which the antenna rotated.
        pose: Pose of the antenna in the tick ``turned``; None before.
        computed: Data that is being computed, or not yet available: the tick, the tick
            in which the rotation began, and the result.
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
        """Whether the antenna rotates because a detector or a listener needs data."""
        needed = self.mounted.scanner.settings.has_detector or bool(self.listeners)
        return needed and self.vehicle.alive

    def advance(
        self, scene: Scene, ticks: int, boxes: Boxes, worker: BackgroundThread
    ) -> None:
        """Rotate the antenna for a tick; begin a new revolution after a pause.

        Args:
            scene: The map.
            ticks: The tick.
            boxes: The boxes of robots.
            worker: Thread that computes the received data.
        """
        from radarsim.addons.fmcw import rotation  # noqa: PLC0415 - scipy is slow

        # The robot may have moved while the antenna did not rotate, so no revolution
        # may contain azimuths from before and after the pause.
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
        # The arguments contain all data for the thread, which must not access the
        # simulation.
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
        """Pass due data to listeners; return the scans of complete revolutions."""
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
            # If the robot has been removed in the meantime, its data is dropped.
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
        """Return the scan that reports the targets of a revolution."""
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
    """Return the time, s, at which an antenna has made ``turns`` + 1 revolutions."""
    return (since - 1) * TICK + (turns + 1) / settings.rotation_hz


class Antennas:
    """All antennas of a simulation.

    Attributes:
        all: The antennas, in the order in which their robots were spawned.
        worker: Thread that computes the received data.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        """Create a collection without antennas.

        Args:
            scene: The map.
            clock: Simulated time.
        """
        self.worker = BackgroundThread()
        self._scene, self._clock = scene, clock
        self.all: list[Antenna] = []
        self._before = -1, Boxes(np.zeros((0, 8)))  # the last tick with boxes

    def add(self, vehicle: Vehicle) -> None:
        """Add the antennas of a robot's FMCW radars."""
        carried = [Antenna(vehicle, each) for each in vehicle.scanners if each.has_fmcw]
        self.all = [*self.all, *carried]

    def remove(self, vehicle: Vehicle) -> None:
        """Remove the antennas of a robot's FMCW radars."""
        self.all = [each for each in self.all if each.vehicle is not vehicle]

    def of(self, vehicle: Vehicle) -> list[Antenna]:
        """Return the antennas of a robot's FMCW radars."""
        return [each for each in self.all if each.vehicle is vehicle]

    @property
    def turning(self) -> list[Antenna]:
        """The antennas that rotate, at most ``MOST_TURNING``, in order of spawning."""
        return [each for each in self.all if each.turns][:MOST_TURNING]

    def read_due(
        self, find_boxes: Callable[[], Boxes], faults: Faults
    ) -> list[DueScan]:
        """Rotate all active antennas for a tick, and return the scans that are due.

        Args:
            find_boxes: Returns the boxes of robots.
            faults: Handles errors of single robots.
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
        """Return boxes with mean velocities since the last tick; 0 for new robots."""
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
    """Joins the data that an antenna receives to complete revolutions.

    Attributes:
        newest: The last complete revolution, with the pose at its beginning; None
            before the first.
    """

    def __init__(self) -> None:
        self.newest: Spectrum | None = None
        self._sectors: list[Sector] = []

    def take(self, sector: Sector, _: float) -> None:
        """Add the data of consecutive azimuths of a revolution."""
        if sector.first == 0:
            self._sectors.clear()  # the previous revolution may be incomplete
        elif not self._sectors:  # the beginning of this revolution was not received
            return
        self._sectors.append(sector)
        if sector.ends_turn:
            from radarsim.addons.fmcw.rotation import join_sectors  # noqa: PLC0415

            self.newest = join_sectors(self._sectors)


def collect_turns(
    simulation: Simulation, vehicle: Vehicle, scanner: str | None
) -> TurnCollection:
    """Start the rotation of a robot's FMCW radar, and collect its revolutions.

    Args:
        simulation: The simulation.
        vehicle: The robot.
        scanner: Name of the radar, in upper or lower case; None for the robot's first.

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
        raise ClientError(f"{text}, expected a class such as P3AT_Navtech")
    raise ClientError(f"FMCW radar {expected_one_of(scanner, names)}")
