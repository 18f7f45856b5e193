"""Sensors that detect victims and RFID tags.

Theory of operation
===================
A sensor sees a target within its range and its field of view if no obstacle blocks the
ray to it. The ray ends a little before the target, since tags are mounted on walls, and
maps may have an object around the parts of a victim. Sound and gas pass obstacles.

A call of L dB at 1 m has L - 20 log10(d) dB at a distance of d m, and the powers of
several calls add up. The carbon dioxide in breath is diluted with the square of the
distance beyond 0.1 m. Numbers without a source are estimates.
"""

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, Final, Generic, TypeVar

import numpy as np
from pydantic import BaseModel

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import Angle, Positive
from radarsim.protocol import rescue
from radarsim.protocol.fields import SensorReport
from radarsim.protocol.rescue import Sighting
from radarsim.raycast.rays import Outcome, Rays, Traces
from radarsim.scene.scene import Place, Scene, Victim
from radarsim.sensors.sensor import Mounting, Sensor, sight_rays

Target = TypeVar("Target")
REACH: Final = 0.3  # m; a ray ends at this distance before its target
LEAST: Final = 1e-6  # m; nearer targets count as at the sensor's position
AHEAD: Final = (1.0, 0.0, 0.0)
BREATH: Final = 0.1  # m; within this distance, breath is not diluted by the air


class SearchSettings(BaseModel, extra="forbid", frozen=True):
    """The settings of a sensor that detects victims or tags.

    Attributes:
        max_range: Largest distance of detected targets, m.
        fov_deg: Full angle of the conical field of view, degrees.
    """

    max_range: Positive
    fov_deg: Angle


class SearchSensor(Sensor, Generic[Target]):
    """Base class of sensors that detect one type of target, such as victims or tags.

    Attributes:
        needs_sight: Whether obstacles hide targets.
    """

    settings: ClassVar[type[BaseModel]] = SearchSettings
    needs_sight: ClassVar[bool] = True

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        self._max_range = mounting.settings.max_range
        self._half_fov = math.radians(mounting.settings.fov_deg) / 2
        found = list(self.targets(mounting.scene))
        self._targets = [target for target, _ in found]
        self._places = np.array([place for _, place in found]).reshape(-1, 3)
        # Results of the last call of `rays`: indices of the targets in view, and
        # positions of all targets in the sensor frame.
        self._near = np.zeros(0, np.int64)
        self._local = self._places

    @abstractmethod
    def targets(self, scene: Scene) -> Iterable[tuple[Target, Place]]:
        """Return the targets in a scene, each with its position, m, map frame."""

    @abstractmethod
    def report(
        self, time: float, seen: Sequence[Target], places: Floats
    ) -> SensorReport | None:
        """Return the report for the detected targets; None for no report.

        Args:
            time: Simulated time, s.
            seen: The N detected targets.
            places: (N, 3) positions of these targets, m, sensor frame.
        """

    def rays(self) -> Rays:
        """Return a ray to each target within range and field of view."""
        pose = self.pose
        self._local = places = (self._places - pose.position()) @ pose.rotation()
        distances = np.linalg.norm(places, axis=1)
        angles = np.arctan2(np.hypot(places[:, 1], places[:, 2]), places[:, 0])
        is_near = (distances <= self._max_range) & (angles <= self._half_fov)
        self._near = np.flatnonzero(is_near)
        aimed = self._near if self.needs_sight else self._near[:0]
        # For a target at the sensor's position, which has no direction, the ray points
        # forward.
        offsets = np.where(distances[:, None] > LEAST, places, AHEAD)[aimed]
        lengths = np.linalg.norm(offsets, axis=1)
        return sight_rays(
            np.tile(pose.position(), (len(aimed), 1)),
            offsets / lengths[:, None] @ pose.rotation().T,
            np.maximum(distances[aimed] - REACH, 0.0),
            self.robot.number,
        )

    def read(self, time: float, traces: Traces) -> Sequence[SensorReport]:
        """Return a list with the report of the detected targets, or an empty list."""
        seen = self._near
        if self.needs_sight:
            seen = seen[traces.outcomes == Outcome.NOTHING]
        targets = [self._targets[k] for k in seen]
        report = self.report(time, targets, self._local[seen])
        return [] if report is None else [report]


class RfidReader(SearchSensor[str], types=["RFID"]):
    """A reader of RFID tags, which reports nothing if it detects no tag."""

    def targets(self, scene: Scene) -> Iterable[tuple[str, Place]]:
        return [(str(tag.id), tag.position) for tag in scene.tags]

    def report(
        self, time: float, seen: Sequence[str], places: Floats
    ) -> SensorReport | None:
        # No report is sent without a tag, since clients read the first tag without
        # checking.
        if not seen:
            return None
        return rescue.RfidTags(time, self.item.name, _sightings(seen, places))


class VictimSensor(SearchSensor[str], types=["VictSensor"]):
    """A sensor that detects body parts of victims."""

    def targets(self, scene: Scene) -> Iterable[tuple[str, Place]]:
        return [part for victim in scene.victims for part in victim.parts]

    def report(self, time: float, seen: Sequence[str], places: Floats) -> SensorReport:
        return rescue.VictimParts(time, self.item.name, _sightings(seen, places))


def _sightings(labels: Sequence[str], places: Floats) -> tuple[Sighting, ...]:
    rows = zip(labels, places.tolist(), strict=True)
    return tuple(Sighting(label, (x, y, z)) for label, (x, y, z) in rows)


class MotionSensor(SearchSensor[Victim], types=["HumanMotion"]):
    """A motion sensor; the reported probability is higher for nearer moving victims."""

    def targets(self, scene: Scene) -> Iterable[tuple[Victim, Place]]:
        return [(each, each.head) for each in scene.victims if each.moves]

    def report(self, time: float, _: Sequence[Victim], places: Floats) -> SensorReport:
        most = self._max_range
        nearest = float(np.linalg.norm(places, axis=1).min(initial=most))
        return rescue.HumanMotion(time, self.item.name, 1.0 - nearest / most)


class Microphone(SearchSensor[Victim], types=["Sound"]):
    """A microphone, which detects the calls of victims."""

    needs_sight = False

    def targets(self, scene: Scene) -> Iterable[tuple[Victim, Place]]:
        callers = (each for each in scene.victims if each.loudness is not None)
        return [(each, each.head) for each in callers]

    def report(
        self, time: float, seen: Sequence[Victim], places: Floats
    ) -> SensorReport:
        if not seen:
            return rescue.Sound(time, self.item.name, 0.0, 0.0)
        sources = np.array([each.loudness for each in seen], np.float64)
        distances = np.maximum(np.linalg.norm(places, axis=1), 1.0)
        levels = sources - 20 * np.log10(distances)
        total = 10 * math.log10(float((10 ** (levels / 10)).sum()))
        duration = seen[int(levels.argmax())].duration
        return rescue.Sound(time, self.item.name, max(0.0, total), duration)


class GasSensor(SearchSensor[Victim], types=["CO2Sensor"]):
    """A sensor of carbon dioxide."""

    needs_sight = False

    def targets(self, scene: Scene) -> Iterable[tuple[Victim, Place]]:
        return [(each, each.head) for each in scene.victims if each.co2 > 0]

    def report(
        self, time: float, seen: Sequence[Victim], places: Floats
    ) -> SensorReport:
        shares = np.array([each.co2 for each in seen], np.float64)
        distances = np.maximum(np.linalg.norm(places, axis=1), BREATH)
        density = float((shares * (BREATH / distances) ** 2).sum())
        name = self.item.name
        return rescue.GasDensity(time, name, rescue.CO2, min(density, 100.0))
