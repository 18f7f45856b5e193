"""The turning antennas of FMCW radars on robots.

In each tick an antenna turns by the directions that it passes in that time, seen from
where the robot is by then. When a turn is complete, what its detector found becomes a
scan. The first turn after a spawn is not read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.robot_boxes import Boxes
from radarsim.rng import NumberedStreams, generator_for
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor
from radarsim.sensors.targets import Targets, find_targets
from radarsim.simulation.clock import TICK, Clock
from radarsim.simulation.vehicle import MountedScanner, Vehicle

if TYPE_CHECKING:
    from radarsim.fmcw.rotation import Rotation, Sector

STANDING: Final = (0.0, 0.0, 0.0)  # m/s
# In a tick no more antennas turn: each takes most of the time of a tick.
MOST_TURNING: Final = 1
ROUNDING: Final = 1e-9  # of directions


class SeenSector(NamedTuple):
    """What the radar of a robot has received.

    Attributes:
        sector: Neighbouring directions of a turn.
        time: When the antenna began to look into the first of them, s.
    """

    sector: Sector
    time: float


class TurnTargets(NamedTuple):
    """The targets of one turn of a radar.

    Attributes:
        scanner: Name of the scanner item.
        targets: The targets.
        is_requested: Whether the robot's client asked for them, and not only watchers.
    """

    scanner: str
    targets: Targets
    is_requested: bool


Listener = Callable[[SeenSector], None]


@dataclass(slots=True, eq=False)
class Antenna:
    """The antenna of one scanner.

    Attributes:
        vehicle: The robot.
        mounted: The scanner.
        rotation: How far it has turned, and what it has received; None before.
        listeners: Called with all that is received; it turns for them.
        observers: Called likewise, but it does not turn for them.
        since: Tick in which it began to turn.
        place: (3,) m, where it was in the tick before; None at first.
        targets: Of the turn that is received.
    """

    vehicle: Vehicle
    mounted: MountedScanner
    rotation: Rotation | None = None
    listeners: list[Listener] = field(default_factory=list)
    observers: list[Listener] = field(default_factory=list)
    since: int = 0
    place: Floats | None = None
    targets: list[Targets] = field(default_factory=list)

    @property
    def turns(self) -> bool:
        """Whether it turns, as somebody needs what it receives."""
        needed = self.mounted.scanner.settings.has_detector or bool(self.listeners)
        return needed and self.vehicle.alive

    @property
    def lists_targets(self) -> bool:
        """Whether the robot's client, or watchers, get the targets."""
        asked = self.vehicle.has_targets_enabled(self.mounted.item)
        return asked or self.vehicle.shows_echoes

    def list_targets(self, targets: Targets) -> TurnTargets:
        """Return targets as they are reported."""
        item = self.mounted.item
        is_requested = self.vehicle.has_targets_enabled(item)
        return TurnTargets(item.name, targets, is_requested)

    def advance(self, scene: Scene, ticks: int, boxes: Boxes) -> Targets | None:
        """Turn for a tick.

        Args:
            scene: The map.
            ticks: The tick.
            boxes: The robots.

        Returns:
            The targets of a turn that is complete, if its scanner has a detector.
        """
        from radarsim.fmcw.rotation import Rotation  # noqa: PLC0415 - scipy is slow

        if self.rotation is None:
            radar = self.mounted.scanner.fmcw
            self.rotation = Rotation(radar, scene, self.mounted.rng)
            self.since, self.place = ticks, None
        pose = self.vehicle.sensor_pose(self.mounted.item)
        complete = None
        for sector in self.rotation.advance(
            pose,
            self._directions(self.rotation.radar.settings, ticks),
            boxes=boxes,
            carrier_id=self.vehicle.number,
            velocity=self._move(pose),
        ):
            for listener in (*self.listeners, *self.observers):
                listener(SeenSector(sector, self._time_of(sector)))
            complete = self._detect(sector) or complete
        return complete

    def _directions(self, settings: FmcwSettings, ticks: int) -> int:
        """Return how many directions are passed in a tick."""
        rate, age = TICK * settings.rotation_hz * settings.azimuths, ticks - self.since
        return int((age + 1) * rate + ROUNDING) - int(age * rate + ROUNDING)

    def _move(self, pose: Pose3) -> tuple[float, float, float]:
        """Note where it is, and return its velocity, m/s."""
        place, before = pose.position(), self.place
        self.place = place
        if before is None:
            return STANDING
        x, y, z = ((place - before) / TICK).tolist()
        return x, y, z

    def _time_of(self, sector: Sector) -> float:
        """Return when the antenna began to look into the first direction, s."""
        settings = sector.spectrum.settings
        # The turn that is counted first is the second one.
        turns = sector.turn + 1 + sector.first / settings.azimuths
        return (self.since - 1) * TICK + turns / settings.rotation_hz

    def _detect(self, sector: Sector) -> Targets | None:
        settings = self.mounted.scanner.settings
        if not settings.has_detector:
            self.targets.clear()
            return None
        self.targets.append(find_targets(sector.spectrum, settings))
        if not sector.ends_turn:
            return None
        found, self.targets = Targets.join(self.targets), []
        return found


class Antennas:
    """All antennas of a simulation."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        """Start without any.

        Args:
            scene: The map.
            clock: Simulated time.
        """
        self._scene, self._clock = scene, clock
        self._antennas: dict[int, list[Antenna]] = {}

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
        every = (each for carried in self._antennas.values() for each in carried)
        return [each for each in every if each.turns][:MOST_TURNING]

    def of(self, vehicle: Vehicle) -> Sequence[Antenna]:
        """Return the antennas of a robot."""
        return self._antennas.get(vehicle.number, ())

    def carriers(self) -> Sequence[Vehicle]:
        """Return the robots that have antennas, in the order of spawning."""
        return [carried[0].vehicle for carried in self._antennas.values()]

    def turn(self, boxes: Boxes) -> list[tuple[Antenna, Targets]]:
        """Turn all that turn for a tick; return those whose turn is complete."""
        complete = []
        for antenna in self.turning:
            targets = antenna.advance(self._scene, self._clock.ticks, boxes)
            if targets is not None:
                complete.append((antenna, targets))
        return complete


@cache
def warm_up() -> None:
    """Load or compile what antennas need, so that no client waits for it."""
    from radarsim.fmcw.beat_signal import NO_TONES  # noqa: PLC0415
    from radarsim.fmcw.detection import DETECTORS  # noqa: PLC0415
    from radarsim.fmcw.rotation import Rotation  # noqa: PLC0415

    small = {"azimuths": 8, "bins": 400, "rays_across": 1, "rays_up": 1}
    radar = load_sensor("navtech_cts350x", fmcw=small).fmcw
    pose, rng = Pose3(0.0, 0.0, 0.0), generator_for(0, "warm-up")
    nothing = Boxes(np.zeros((0, 8)))
    Rotation(radar, Scene("empty", "Empty"), rng).advance(pose, 1, boxes=nothing)
    mean = np.ones((8, 400), np.float32)
    streams = NumberedStreams(rng)
    spectrum = radar.receive(pose, range(8), mean, NO_TONES, streams)
    for detector in DETECTORS:
        spectrum.detections(detector)
