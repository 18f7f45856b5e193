"""A rotating FMCW radar, which computes spectra, beat signals and scans of a scene."""

import math
from dataclasses import replace
from functools import cached_property
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antenna import (
    Viewpoints,
    fixed_viewpoints,
)
from radarsim.addons.fmcw.beat_signal import (
    NumberedStreams,
    Tones,
    beat_rows,
    join_tones,
    sample_sweeps,
)
from radarsim.addons.fmcw.corners_and_edges import corner_points, edge_points
from radarsim.addons.fmcw.point_echoes import (
    Points,
    Sight,
    find_ways,
    point_tones,
    straight_ways,
)
from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    noise_power,
    noise_shape,
    radar_constant,
    sample_count,
)
from radarsim.addons.fmcw.ray_fan import RayFan, refined_fan
from radarsim.addons.fmcw.round_metal import round_points
from radarsim.addons.fmcw.scattering import scene_scattering
from radarsim.addons.fmcw.speckle import Scatterers, hash_levels, scatterers_in
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.addons.fmcw.targets import find_targets, read_ranges
from radarsim.addons.fmcw.turn_echoes import Echoes, TurnEchoes
from radarsim.engine import engine
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import RADAR, Boxes, RayClass, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import fixed_number
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Echoes as ScanEchoes
from radarsim.sensors.scan import Scan

# The bounding boxes of the parts of each scene, (P, 2, 3) m.
_bounds: WeakKeyDictionary[Scene, Floats] = WeakKeyDictionary()

MAX_LOSS_DB: Final = 75.0  # one-way loss at which rays end; the echo is far below noise
CORNER_BOUNCES: Final = 3  # every ray is reflected at least this often: in a trihedral
# Numbers that select one of two independent sets of scatterers.
_IN_BEAMS: Final = 0
_IN_SIDELOBES: Final = 1


class FmcwRadar:
    """A rotating FMCW radar.

    Attributes:
        name: Name of the preset.
        settings: Settings of the radar.
        sensor: Settings of the range scanner that the radar implements.
        ray_class: Class of the radar's rays.
        full_power: Initial power of the rays.
    """

    def __init__(
        self, name: str, settings: FmcwSettings, sensor: SensorSettings
    ) -> None:
        """Create a radar.

        Args:
            name: Name of the preset.
            settings: Settings of the radar.
            sensor: Settings of the range scanner: the band of the materials, the
                decibels per unit of density, the maximum number of reflections, which
                is at least three, and the detector.
        """
        self.name = name
        self.settings = settings
        self.sensor = sensor
        self.ray_class = RayClass(
            RADAR,
            BANDS_GHZ.index(sensor.band_ghz),
            sensor.power_per_db or 1.0,
            max(sensor.max_bounces, CORNER_BOUNCES),
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
        """Azimuths of a revolution, (A,) rad, from 0 (straight ahead) to -2 pi."""
        return np.asarray(-self.settings.step * np.arange(self.settings.azimuths))

    @cached_property
    def ranges(self) -> Floats:
        """Ranges of the bins, (B,) m."""
        return np.asarray(self.settings.bin_size * np.arange(self.settings.bins))

    def scan(self, scene: Scene, pose: Pose3, rng: np.random.Generator) -> Scan:
        """Scan a scene: find targets in the spectrum of a revolution by the detector.

        The rays of the scan are the axes of the beams. The scan has no echoes, since a
        spectrum does not show to which objects targets belong.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            rng: Source of speckle and noise, as in ``spectrum``.
        """
        settings = self.sensor
        targets = find_targets(self.spectrum(scene, pose, rng), settings)
        steps = np.arange(settings.beams) * settings.resolution_deg
        angles: Floats = np.radians(steps - settings.fov_deg / 2)
        level = np.zeros_like(angles)
        ahead = np.stack([np.cos(angles), np.sin(angles), level], axis=1)
        directions = ahead @ pose.rotation().T
        rays = self.rays(
            np.broadcast_to(pose.position(), directions.shape),
            directions / np.linalg.norm(directions, axis=1)[:, None],
            max_range=settings.max_range,
        )
        none, nowhere = np.zeros(0), np.zeros(0, np.int64)
        echoes = ScanEchoes(
            beams=nowhere,
            sides=np.zeros(0, np.int8),
            ranges=none,
            fronts=none,
            kinds=np.zeros(0, np.uint8),
            power=none,
            strength=none,
            parts=nowhere,
            scene_parts=scene.parts,
            settings=settings,
        )
        return Scan(
            sensor=self.name,
            pose=pose,
            angles=angles,
            ranges=read_ranges(targets, settings),
            rays=level.astype(np.int8) if settings.has_side_rays else None,
            range_min=settings.min_range,
            range_max=settings.max_range,
            resolution=math.radians(settings.resolution_deg),
            find_cast=lambda: rays,
            find_echoes=lambda: echoes,
            scene=scene,
            targets=targets,
        )

    def spectrum(
        self,
        scene: Scene,
        pose: Pose3,
        rng: np.random.Generator,
    ) -> Spectrum:
        """Record a revolution of a radar that does not move.

        Args:
            scene: The map.
            pose: Pose of the antenna, map frame.
            rng: Source of speckle and noise. No numbers are drawn from it; a new
                generator is spawned from it for the noise of each revolution. Speckle
                depends on its seed and is the same in all revolutions.
        """
        rows = range(self.settings.azimuths)
        turn = self.receive(pose, rows, *self._standing(scene, pose, rng))
        return replace(turn, scene=scene)

    def beat_signal(
        self, scene: Scene, pose: Pose3, rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """Return the samples of a revolution; see ``RangeScanner.beat_signal``."""
        _, echoes, tones, streams = self._standing(scene, pose, rng)
        ones = np.ones(sample_count(self.settings), np.float32)
        sweeps = sample_sweeps(self.settings, 0, echoes.field, tones, streams, ones)
        scale = np.float32(math.sqrt(noise_power(self.settings)))
        return sweeps[:, : len(ones)] * scale

    def _standing(
        self, scene: Scene, pose: Pose3, rng: np.random.Generator
    ) -> tuple[Viewpoints, Echoes, Tones, NumberedStreams]:
        """Return the arguments of ``receive`` for a radar that does not move."""
        rows = range(self.settings.azimuths)
        view = fixed_viewpoints(pose, self.times(_count_children(rng)))
        key, echoes = fixed_number(rng), self.new_turn(scene)
        self.add_echoes(echoes, scene, view, rows, key)
        whole = echoes.rows(0, rows.stop, echoes, echoes)
        self.add_sidelobes(whole, echoes, rows, view, key)
        return view, whole, self.tones(scene, view, rows), NumberedStreams(rng)

    def times(self, turn: int) -> Floats:
        """Return the times of the azimuths of revolution ``turn``, from 0, (A,) s."""
        rows = np.arange(self.settings.azimuths) + turn * self.settings.azimuths
        return np.asarray(self.settings.sweep_time * rows)

    def new_turn(self, scene: Scene) -> TurnEchoes:
        """Return an empty object for the echoes of a revolution."""
        parts = scene_scattering(tracer_of(scene), self.ray_class).parts
        return TurnEchoes(self.settings, sways=bool(parts["sway"].any()))

    def receive(
        self,
        pose: Pose3,
        rows: range,
        view: Viewpoints,
        echoes: Echoes,
        tones: Tones,
        streams: NumberedStreams,
    ) -> Spectrum:
        """Return the spectrum of some azimuths of a revolution.

        Args:
            pose: Pose of the antenna, map frame.
            rows: Indices of the azimuths.
            view: Viewpoints of the antenna at these azimuths.
            echoes: Echoes at these azimuths; their power becomes the ``echo_power``.
            tones: The echoes of points.
            streams: Source of noise.
        """
        settings, mean = self.settings, echoes.power
        power = beat_rows(settings, rows.start, echoes.field, tones, streams)
        # The mean power does not include points yet, so their power is added to the
        # nearest bins.
        bins = np.rint(tones.ranges / settings.bin_size).astype(np.int64)
        within = (bins >= 0) & (bins < settings.bins)
        within &= (tones.rows >= rows.start) & (tones.rows < rows.stop)
        places = tones.rows[within] - rows.start, bins[within]
        np.add.at(mean, places, tones.power[within])
        angles = self.angles[rows.start : rows.stop]
        ahead = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
        away = -np.einsum("nij,nj,ni->n", view.rotations, ahead, view.velocities)
        velocity = np.broadcast_to((away + 0.0).astype(np.float32)[:, None], mean.shape)
        if echoes.velocity is not None:
            known = np.isfinite(echoes.velocity)
            velocity = np.where(known, echoes.velocity, velocity)
        noise = np.float32(noise_power(settings))
        power *= noise
        mean *= noise
        return Spectrum(
            sensor=self.name,
            pose=pose,
            settings=settings,
            angles=angles,
            ranges=self.ranges,
            power=power,
            echo_power=mean,
            noise_floor=noise_shape(settings) * noise,
            radial_velocity=velocity,
        )

    def aim(
        self, scene: Scene, view: Viewpoints, carrier_id: int, rows: range
    ) -> tuple[RayFan, Rays]:
        """Return the rays of azimuths, as a fan and in the map frame.

        The arguments are the same as in ``add_echoes``.
        """
        bounds = _bounds.get(scene)
        if bounds is None:
            boxes = [part.bounds for part in scene.parts if part.faces.size]
            bounds = _bounds[scene] = np.array(boxes, np.float64).reshape(-1, 2, 3)
        place = view.positions[0], view.rotations[0]
        fan = refined_fan(self.settings, bounds, *place, rows)
        row = fan.column // self.settings.rays_across - rows.start
        directions = np.empty_like(fan.directions)
        # A matrix product would round differently for different numbers of rows.
        engine.turn_directions(fan.directions, view.rotations, row, directions)
        origins = view.positions.take(row, axis=0)  # faster than an index
        return fan, self.rays(origins, directions, carrier_id=carrier_id)

    def rays(
        self,
        origins: Floats,
        directions: Floats,
        *,
        max_range: float | Floats | None = None,
        carrier_id: int = -1,
    ) -> Rays:
        """Return rays of this radar in the map frame, by default up to its range."""
        return Rays.uniform(
            origins,
            directions,
            max_range=self.settings.max_range if max_range is None else max_range,
            power=self.full_power,
            medium=0,
            carrier_id=carrier_id,
            ray_classes=(self.ray_class,),
        )

    def add_echoes(
        self,
        echoes: TurnEchoes,
        scene: Scene,
        view: Viewpoints,
        rows: range,
        key: int,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> None:
        """Trace the rays of azimuths, and add their echoes.

        Args:
            echoes: Echoes of the revolution, to which echoes are added.
            scene: The map.
            view: Viewpoints of the antenna at the azimuths.
            rows: Indices of the azimuths.
            key: Key of the random amplitudes of scatterers; see ``speckle``.
            boxes: The boxes of robots.
            carrier_id: Id of the robot that carries the radar; -1 for none.
        """
        settings, tracer = self.settings, tracer_of(scene)
        fan, rays = self.aim(scene, view, carrier_id, rows)
        traces = tracer.trace(rays, boxes, events=True, incidence=True)
        row = fan.column // settings.rays_across - rows.start
        # Speed at which the antenna approaches the object that ends each ray, m/s.
        velocities = view.velocities.take(row, axis=0)
        approach = np.einsum("mi,mi->m", rays.directions, velocities)
        if boxes is not None and boxes.velocities is not None:
            met, which = boxes.find(traces.parts - len(tracer.parts))
            ahead = rays.directions[met, :2]
            approach[met] -= np.einsum("mi,mi->m", ahead, boxes.velocities[which])
            met = met[boxes.velocities[which].any(axis=1)]
            places = traces.ranges[met] + doppler_shift(settings, approach[met])
            echoes.note_velocities(row[met] + rows.start, places, -approach[met])
        constant = radar_constant(settings) / noise_power(settings)
        packed = engine.structures["FanRays"].pack(
            column=fan.column,
            across=fan.across,
            weights=fan.weights * constant,
            spread=fan.spread,
            directions=rays.directions,
            shift=doppler_shift(settings, approach),
            ranges=traces.ranges,
            incidence=traces.incidence,
            full=self.full_power,
            db_per_power=1.0 / self.ray_class.power_per_db,
            wavelength=settings.wavelength,
        )
        scattering = scene_scattering(tracer, self.ray_class)
        scatterers = self._scatterers(rows, view, key)
        echoes.add(rows, packed, traces.events, scattering, scatterers)

    def _scatterers(self, rows: range, view: Viewpoints, key: int) -> Scatterers:
        """Return the scatterers in the columns of azimuths and in the next column."""
        parts = self.settings.rays_across
        columns = np.arange(rows.start * parts, rows.stop * parts + 1)
        azimuths = np.asarray(columns * (self.settings.step / parts), np.float64)
        row = np.minimum(columns // parts - rows.start, len(rows) - 1)
        found = scatterers_in(self.settings, azimuths, view, row, key, _IN_BEAMS)
        # After the last column of a revolution the first column follows again. The
        # powers of both passes add up, so their scatterers must be independent.
        found["key"][-1] ^= ~np.uint64(0)
        return found

    def add_sidelobes(
        self,
        echoes: Echoes,
        turn: TurnEchoes,
        rows: range,
        view: Viewpoints,
        key: int,
    ) -> None:
        """Add the echoes that sidelobes receive at some azimuths.

        Args:
            echoes: Echoes at the azimuths, to which echoes are added.
            turn: The revolution whose echoes the sidelobes receive.
            rows: Indices of the azimuths.
            view: Viewpoints of the antenna at these azimuths.
            key: Key of the random amplitudes of scatterers; see ``speckle``.
        """
        power = turn.sidelobes()
        azimuths, settings = self.settings.step * np.array(rows), self.settings
        own = np.arange(len(rows))
        found = scatterers_in(settings, azimuths, view, own, key, _IN_SIDELOBES)
        np.add(echoes.power, power, out=echoes.power)
        pairs = echoes.field.reshape(len(rows), len(power), 2)
        engine.add_amplitudes(found, hash_levels(), power, pairs)

    def tones(
        self,
        scene: Scene,
        view: Viewpoints,
        rows: range,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> Tones:
        """Return the echoes of points; arguments as in ``add_echoes``."""
        settings, tracer = self.settings, tracer_of(scene)
        wavelength, origin = settings.wavelength, view.positions[0]
        sight = Sight(self, tracer, origin, boxes, carrier_id)
        reflectors = Points(
            np.array([it.position for it in scene.reflectors]).reshape(-1, 3),
            np.array([it.rcs(wavelength) for it in scene.reflectors], np.float64),
        )
        of_surfaces = (
            edge_points(tracer, origin, wavelength),
            corner_points(tracer, origin, settings),
            round_points(tracer, origin, wavelength),
        )
        surfaces = Points._make(map(np.concatenate, zip(*of_surfaces, strict=True)))
        found = [
            point_tones(settings, view, rows, points, find(sight, points, wavelength))
            for points, find in ((reflectors, find_ways), (surfaces, straight_ways))
            if len(points.rcs)
        ]
        return join_tones(found)


def _count_children(rng: np.random.Generator) -> int:
    """Return how many generators ``rng`` has spawned; each revolution spawns one."""
    seed: Any = rng.bit_generator.seed_seq
    return int(seed.n_children_spawned)
