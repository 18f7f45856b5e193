"""A turning FMCW radar in a scene."""

from functools import cached_property
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.fmcw.beat_signal import Tones, beat_spectrum
from radarsim.fmcw.mean_power import Power, PowerScale, mean_power
from radarsim.fmcw.points import Points, Sight, losses_to, point_tones
from radarsim.fmcw.radar_equation import (
    doppler_shift,
    noise_power,
    noise_shape,
    radar_constant,
)
from radarsim.fmcw.ray_fan import RayFan, extents_from, refined_fan
from radarsim.fmcw.scattering import scattering_of
from radarsim.fmcw.spectrum import Spectrum
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import RADAR, RayClass, Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene

MAX_LOSS_DB: Final = 75.0  # one way, at which a ray ends: 150 dB, far below the noise
STANDING: Final = (0.0, 0.0, 0.0)  # m/s


class TracedTurn(NamedTuple):
    """The rays of a turn, traced.

    Attributes:
        fan: The rays.
        directions: (M, 3) unit vectors, map frame.
        traces: How they ended, with events and incidence.
    """

    fan: RayFan
    directions: Floats
    traces: Traces


class FmcwRadar:
    """A turning FMCW radar.

    Attributes:
        name: Name of its preset.
        settings: Its settings.
        ray_class: The class of its rays.
        full_power: The power with which they start.
    """

    def __init__(
        self, name: str, settings: FmcwSettings, sensor: SensorSettings
    ) -> None:
        """Create a radar.

        Args:
            name: Name of its preset.
            settings: Its settings.
            sensor: Those of its range scanner: the band of the materials, the decibels
                in a unit of density, and how many mirrors are followed.
        """
        self.name = name
        self.settings = settings
        self.ray_class = RayClass(
            RADAR,
            BANDS_GHZ.index(sensor.band_ghz),
            sensor.power_per_db or 1.0,
            sensor.max_bounces,
            is_absorbed=False,
            in_decibels=True,
        )
        self.full_power = MAX_LOSS_DB * self.ray_class.power_per_db

    def __repr__(self) -> str:
        it = self.settings
        return (
            f"<FmcwRadar {self.name}: {it.azimuths} azimuths of {it.bins} bins of"
            f" {it.bin_size:g} m>"
        )

    @cached_property
    def angles(self) -> Floats:
        """Directions of a turn, (A,) rad, clockwise from straight ahead: 0 to -2 pi."""
        return np.asarray(-self.settings.step * np.arange(self.settings.azimuths))

    @cached_property
    def ranges(self) -> Floats:
        """Ranges of the bins, (B,) m."""
        return np.asarray(self.settings.bin_size * np.arange(self.settings.bins))

    def spectrum(
        self,
        scene: Scene,
        pose: Pose3,
        rng: np.random.Generator,
        *,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
        velocity: tuple[float, float, float] = STANDING,
    ) -> Spectrum:
        """Record a turn.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            rng: Source of speckle and noise. It is not drawn from, but has a child
                that is: what others draw from it stays the same.
            boxes: The robots.
            carrier_id: The robot that carries the radar; -1 for none.
            velocity: Of the antenna, m/s, map frame.
        """
        tracer, settings = tracer_of(scene), self.settings
        turn = self.trace(scene, pose, boxes, carrier_id)
        mean = self.mean_power(tracer, turn, velocity)
        tones = self.tones(scene, pose, boxes, carrier_id)
        (child,) = rng.spawn(1)
        power = beat_spectrum(settings, mean, tones, child)
        _add_to_bins(settings, mean, tones)
        noise = np.float32(noise_power(settings))
        return Spectrum(
            sensor=self.name,
            pose=pose,
            settings=settings,
            angles=self.angles,
            ranges=self.ranges,
            power=power * noise,
            echo_power=mean * noise,
            noise_floor=noise_shape(settings) * noise,
            scene=scene if boxes is None else None,
        )

    def trace(
        self,
        scene: Scene,
        pose: Pose3,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> TracedTurn:
        """Trace the rays of a turn.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            boxes: The robots.
            carrier_id: The robot that carries the radar; -1 for none.
        """
        fan = refined_fan(self.settings, extents_from(pose, _bounds_of(scene)))
        directions = fan.directions @ pose.rotation().T
        # Rounding of the product must not make the vectors longer.
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        count = len(directions)
        rays = Rays(
            np.broadcast_to(pose.position(), directions.shape).copy(),
            directions,
            np.full(count, self.settings.max_range),
            np.full(count, self.full_power),
            np.zeros(count, np.uint8),
            np.full(count, carrier_id, np.int64),
            (self.ray_class,),
        )
        traces = tracer_of(scene).trace(rays, boxes, events=True, incidence=True)
        return TracedTurn(fan, directions, traces)

    def mean_power(
        self,
        tracer: Tracer,
        turn: TracedTurn,
        velocity: tuple[float, float, float] = STANDING,
    ) -> Power:
        """Return the mean power of a turn, (A, B), in units of the noise in a bin.

        Args:
            tracer: Tracer of the scene.
            turn: The traced rays.
            velocity: Of the antenna, m/s, map frame.
        """
        speeds = turn.directions @ np.array(velocity)
        scale = PowerScale(
            radar_constant(self.settings) / noise_power(self.settings),
            self.full_power,
            1.0 / self.ray_class.power_per_db,
            doppler_shift(self.settings, speeds),
        )
        scattering = scattering_of(tracer, self.ray_class)
        return mean_power(
            self.settings, turn.fan, turn.directions, turn.traces, scattering, scale
        )

    def tones(
        self,
        scene: Scene,
        pose: Pose3,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> Tones:
        """Return the echoes of points; arguments as of ``trace``."""
        points = points_of(scene, self.settings)
        sight = Sight(self.ray_class, self.full_power, boxes, carrier_id)
        loss = losses_to(tracer_of(scene), pose, points, sight)
        return point_tones(self.settings, pose, points, loss)


def points_of(scene: Scene, settings: FmcwSettings) -> Points:
    """Return the points of a scene that reflect."""
    positions = [each.position for each in scene.reflectors]
    sections = [each.rcs(settings.wavelength) for each in scene.reflectors]
    return Points(
        np.array(positions, np.float64).reshape(-1, 3), np.array(sections, np.float64)
    )


def _add_to_bins(settings: FmcwSettings, mean: Power, tones: Tones) -> None:
    """Add the power of tones to the nearest bins."""
    bins = np.rint(tones.ranges / settings.bin_size).astype(np.int64)
    within = bins < settings.bins
    np.add.at(mean, (tones.rows[within], bins[within]), tones.power[within])


# The bounding boxes of the parts of each scene, (P, 2, 3) m.
_bounds: WeakKeyDictionary[Scene, Floats] = WeakKeyDictionary()


def _bounds_of(scene: Scene) -> Floats:
    bounds = _bounds.get(scene)
    if bounds is None:
        boxes = [part.bounds for part in scene.parts if part.faces.size]
        bounds = _bounds[scene] = np.array(boxes, np.float64).reshape(-1, 2, 3)
    return bounds
