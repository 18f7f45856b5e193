"""What the antenna of an FMCW radar receives, computed beside the simulation.

Nothing here reads the simulation, so that a thread can do it while time goes on: what
a direction needs to know of its tick is in a ``Look``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from radarsim.addons.fmcw.rotation import Rotation, Sector
from radarsim.addons.fmcw.targets import find_targets, join_targets
from radarsim.geometry import Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.robot_boxes import Boxes
from radarsim.sensors.scan import Targets

if TYPE_CHECKING:
    import numpy as np

    from radarsim.addons.fmcw.radar import FmcwRadar
    from radarsim.scene.scene import Scene


class Look(NamedTuple):
    """The directions into which an antenna looks in a tick, and from where.

    Attributes:
        directions: Their number.
        pose: Pose of the antenna, map frame.
        velocity: Of the antenna, m/s, map frame.
        boxes: The robots.
        carrier_id: The robot that carries it.
        settings: Settings of its scanner.
        receives: Whether to receive what was looked into; else a later look does.
        is_recorded: Whether the counts of the directions are needed.
    """

    directions: int
    pose: Pose3
    velocity: tuple[float, float, float]
    boxes: Boxes
    carrier_id: int
    settings: SensorSettings
    receives: bool
    is_recorded: bool


class FoundTurn(NamedTuple):
    """What the detector of a scanner found in a turn.

    Attributes:
        number: Number of the turn, as of its sectors.
        targets: The targets.
        settings: Settings of the scanner when the turn began.
    """

    number: int
    targets: Targets
    settings: SensorSettings


class Received(NamedTuple):
    """What has been received when an antenna has looked into directions.

    Attributes:
        sectors: The directions.
        turn: What was found in the turn that they complete, if they do, and its scanner
            has a detector.
    """

    sectors: list[Sector]
    turn: FoundTurn | None


class TurnReceiver:
    """The antenna of a radar, and the detector of its scanner.

    Attributes:
        radar: The radar.
    """

    def __init__(
        self, radar: FmcwRadar, scene: Scene, rng: np.random.Generator
    ) -> None:
        """Create an antenna that looks straight ahead; arguments as of ``Rotation``."""
        self.radar = radar
        self._rotation = Rotation(radar, scene, rng)
        # Of the turn that is received; it has the settings with which it began.
        self._settings: SensorSettings | None = None
        self._targets: list[Targets] = []

    def advance(self, look: Look) -> Received:
        """Look into more directions, and return what has been received meanwhile."""
        found = None
        sectors = self._rotation.advance(
            look.pose,
            look.directions,
            boxes=look.boxes,
            carrier_id=look.carrier_id,
            velocity=look.velocity,
            receives=look.receives,
        )
        for sector in sectors:
            if look.is_recorded:
                _ = sector.spectrum.counts  # computed once, here
            found = self._detect(sector, look.settings) or found
        return Received(sectors, found)

    def _detect(self, sector: Sector, settings: SensorSettings) -> FoundTurn | None:
        if sector.first == 0:
            self._settings = settings if settings.has_detector else None
            self._targets.clear()
        if self._settings is None:
            return None
        self._targets.append(find_targets(sector.spectrum, self._settings))
        if not sector.ends_turn:
            return None
        return FoundTurn(sector.turn, join_targets(self._targets), self._settings)
