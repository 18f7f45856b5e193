"""A turning FMCW radar in a scene."""

from dataclasses import replace
from functools import cached_property
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from radarsim.addons.fmcw.beat_signal import (
    NO_TONES,
    Points,
    Power,
    Tones,
    beat_rows,
    losses_to,
    point_tones,
)
from radarsim.addons.fmcw.mean_power import TurnPower
from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    noise_power,
    noise_shape,
    radar_constant,
)
from radarsim.addons.fmcw.ray_fan import (
    RayFan,
    extents_from,
    refined_fan,
    turned_directions,
)
from radarsim.addons.fmcw.ray_power import FanRays
from radarsim.addons.fmcw.scattering import scene_scattering
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.addons.fmcw.targets import find_targets, scan_of
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import RADAR, RayClass, Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.rng import NumberedStreams
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

# The bounding boxes of the parts of each scene, (P, 2, 3) m.
_bounds: WeakKeyDictionary[Scene, Floats] = WeakKeyDictionary()

MAX_LOSS_DB: Final = 75.0  # one way, at which a ray ends: 150 dB, far below the noise
STANDING: Final = (0.0, 0.0, 0.0)  # m/s


class TracedTurn(NamedTuple):
    """The rays of a turn, or of a part of it, traced.

    Attributes:
        rows: The directions of the radar whose rays they are.
        fan: The rays.
        directions: (M, 3) unit vectors, map frame.
        traces: How they ended, with events and incidence.
    """

    rows: range
    fan: RayFan
    directions: Floats
    traces: Traces


class FmcwRadar:
    """A turning FMCW radar.

    Attributes:
        name: Name of its preset.
        settings: Its settings.
        sensor: Settings of its range scanner.
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
                in a unit of density, how many mirrors are followed, and the detector.
        """
        self.name = name
        self.settings = settings
        self.sensor = sensor
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

    def scan(self, scene: Scene, pose: Pose3, rng: np.random.Generator) -> Scan:
        """Scan a scene: the targets that the detector finds in a turn.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            rng: As for ``spectrum``.
        """
        targets = find_targets(self.spectrum(scene, pose, rng), self.sensor)
        return scan_of(self, pose, targets, scene)

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
        turn = self.trace(scene, pose, boxes, carrier_id)
        mean = self.mean_power(tracer_of(scene), turn, velocity)
        tones = self.tones(scene, pose, boxes, carrier_id, velocity)
        streams = NumberedStreams(rng)
        spectrum = self.receive(pose, turn.rows, mean, tones, streams)
        return spectrum if boxes is not None else replace(spectrum, scene=scene)

    def receive(
        self,
        pose: Pose3,
        rows: range,
        mean: Power,
        tones: Tones,
        streams: NumberedStreams,
    ) -> Spectrum:
        """Return the spectrum of some directions of a turn.

        Args:
            pose: Pose of the antenna, map frame.
            rows: The directions.
            mean: (N, B) their mean power, in units of the noise in a bin; becomes the
                ``echo_power`` of the spectrum.
            tones: The echoes of points.
            streams: Source of speckle and noise.
        """
        settings = self.settings
        power = beat_rows(settings, rows.start, mean, tones, streams)
        # Points are in the signal, not in its mean; here the echo power of each is that
        # of its nearest bin.
        bins = np.rint(tones.ranges / settings.bin_size).astype(np.int64)
        within = (bins >= 0) & (bins < settings.bins)
        within &= (tones.rows >= rows.start) & (tones.rows < rows.stop)
        places = tones.rows[within] - rows.start, bins[within]
        np.add.at(mean, places, tones.power[within])
        noise = np.float32(noise_power(settings))
        power *= noise
        mean *= noise
        return Spectrum(
            sensor=self.name,
            pose=pose,
            settings=settings,
            angles=self.angles[rows.start : rows.stop],
            ranges=self.ranges,
            power=power,
            echo_power=mean,
            noise_floor=noise_shape(settings) * noise,
        )

    def trace(
        self,
        scene: Scene,
        pose: Pose3,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
        rows: range | None = None,
    ) -> TracedTurn:
        """Trace the rays of a turn.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            boxes: The robots.
            carrier_id: The robot that carries the radar; -1 for none.
            rows: The directions whose rays are traced; None for all.
        """
        rows = range(self.settings.azimuths) if rows is None else rows
        fan, rays = self.aim(scene, pose, carrier_id, rows)
        traces = tracer_of(scene).trace(rays, boxes, events=True, incidence=True)
        return TracedTurn(rows, fan, rays.directions, traces)

    def aim(
        self, scene: Scene, pose: Pose3, carrier_id: int, rows: range
    ) -> tuple[RayFan, Rays]:
        """Return the rays of directions, as a fan and in the map; see ``trace``."""
        bounds = _bounds.get(scene)
        if bounds is None:
            boxes = [part.bounds for part in scene.parts if part.faces.size]
            bounds = _bounds[scene] = np.array(boxes, np.float64).reshape(-1, 2, 3)
        fan = refined_fan(self.settings, extents_from(pose, bounds), rows)
        directions = turned_directions(fan.directions, pose.rotation())
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
        return fan, rays

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
        power = TurnPower(self.settings)
        self.add_power(power, tracer, turn, velocity)
        rows = power.rows(0, self.settings.azimuths, power, power)
        return np.asarray(rows + power.sidelobes())

    def add_power(
        self,
        power: TurnPower,
        tracer: Tracer,
        turn: TracedTurn,
        velocity: tuple[float, float, float] = STANDING,
    ) -> None:
        """Add the mean power that comes back to rays.

        Args:
            power: Added to.
            tracer: Tracer of the scene.
            turn: The traced rays.
            velocity: Of the antenna, m/s, map frame.
        """
        fan, traces = turn.fan, turn.traces
        constant = radar_constant(self.settings) / noise_power(self.settings)
        rays = FanRays(
            fan.column,
            fan.across,
            fan.weights * constant,
            fan.spread,
            turn.directions,
            doppler_shift(self.settings, turn.directions @ np.array(velocity)),
            traces.ranges,
            traces.incidence,
        )
        power.add(
            turn.rows,
            rays,
            traces.events,
            scene_scattering(tracer, self.ray_class),
            self.full_power,
            1.0 / self.ray_class.power_per_db,
        )

    def tones(
        self,
        scene: Scene,
        pose: Pose3,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
        velocity: tuple[float, float, float] = STANDING,
    ) -> Tones:
        """Return the echoes of points; arguments as of ``spectrum``."""
        if not scene.reflectors:
            return NO_TONES
        sections = [each.rcs(self.settings.wavelength) for each in scene.reflectors]
        points = Points(
            np.array([each.position for each in scene.reflectors], np.float64),
            np.array(sections, np.float64),
        )
        loss = losses_to(
            tracer_of(scene),
            pose,
            points,
            self.ray_class,
            self.full_power,
            boxes,
            carrier_id,
        )
        return point_tones(self.settings, pose, points, loss, velocity)
