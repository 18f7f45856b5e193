"""Range scanners: radars and lasers, which share one class with different settings."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim import plugins
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.presets.sensors import load_fmcw_settings, load_settings
from radarsim.raycast.rays import LASER, RADAR
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import as_generator
from radarsim.scene.scene import Scene, expected_scene
from radarsim.sensors.beams import pattern_of
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_batch import ScanArrays, ScanBatch, scan_poses

# A function that maps ranges, (N,) m, and a generator to noisy ranges, (N,) m.
Noise: TypeAlias = Callable[[Floats, np.random.Generator], Floats]

SENSOR_HEIGHT: Final = 0.346  # m; height of a P3AT's scanner above the floor


class RangeScanner:
    """A scanning radar or laser.

    Attributes:
        name: Name of the preset.
        settings: All settings of the sensor.
        angles: (N,) azimuths of the beams, rad, counter-clockwise from the right.
        pattern: The beams and rays, shared with scanners of equal settings.
        medium: Sensor type, ``RADAR`` or ``LASER``.
        noise: The noise function of ``with_noise``; None without one.
    """

    def __init__(
        self,
        name: str,
        settings: SensorSettings,
        fmcw: Mapping[str, Any] | None = None,
        noise: Noise | None = None,
    ) -> None:
        """Create a scanner with given settings.

        Args:
            name: Name of the preset.
            settings: All settings of the sensor.
            fmcw: Changed settings of the FMCW radar.
            noise: See ``with_noise``.
        """
        self.name = name
        self.settings = settings
        self._fmcw = dict(fmcw or {})
        self.noise = noise
        self.pattern = pattern_of(settings)
        self.angles = self.pattern.angles
        self.medium = RADAR if settings.medium == "radar" else LASER
        self._has_detector = settings.has_detector

    def __repr__(self) -> str:
        settings = self.settings
        return (
            f"<RangeScanner {self.name}: {settings.medium}, {len(self.angles)} beams"
            f" over {settings.fov_deg:g}°, up to {settings.max_range:g} m>"
        )

    @property
    def has_side_rays(self) -> bool:
        """Whether a beam can have several rays."""
        return self.settings.has_side_rays

    @cached_property
    def with_all_echoes(self) -> "RangeScanner":
        """A copy of this scanner with ``return_mode`` "all" instead of "last".

        The copy draws the same random numbers and reads the same ranges. A scanner with
        another return mode is returned unchanged.
        """
        # In the other return modes, the ranges depend on the kept echoes, so keeping
        # all echoes would change the ranges.
        if self.settings.return_mode != "last":
            return self
        together = self.settings.combines_rays
        update = {
            "return_mode": "all",
            "ray_choice": "together" if together else "drawn",
        }
        settings = self.settings.model_copy(update=update)
        return RangeScanner(self.name, settings, self._fmcw, self.noise)

    def with_settings(self, **settings: Any) -> "RangeScanner":
        """Return a copy of this scanner with some settings changed.

        The settings are those of ``load_sensor``.

        Raises:
            PresetError: If there is no such setting, or a value is invalid.
        """
        fmcw = self._fmcw | settings.pop("fmcw", {})
        if fmcw:
            load_fmcw_settings(self.name, **fmcw)
        changed = load_settings(self.name, **{**self.settings.model_dump(), **settings})
        return RangeScanner(self.name, changed, fmcw, self.noise)

    def with_noise(self, noise: "Noise") -> "RangeScanner":
        """Return a copy of this scanner with a user-defined noise function.

        The function is applied after the noise of the sensor, to the ranges of ``scan``
        and ``scan_many``, not to echoes.

        Args:
            noise: Called with the ranges of a scan, (N,) m, inf without a return, and
                a generator; returns the noisy ranges, (N,) m.
        """
        return RangeScanner(self.name, self.settings, self._fmcw, noise)

    def _add_noise(self, ranges: Floats, rng: np.random.Generator | None) -> Floats:
        """Return the ranges of a scan after applying the user's noise function.

        Raises:
            ValueError: If the rng is missing, or the function does not return N ranges.
        """
        if self.noise is None:
            return ranges
        if rng is None:
            raise ValueError(f"no rng, expected a Generator for the noise of {self!r}")
        # The noise function gets its own spawned generator, so scan_many gives the same
        # noise as repeated calls of scan.
        (child,) = rng.spawn(1)
        noisy = np.asarray(self.noise(ranges.copy(), child), np.float64)
        if noisy.shape != ranges.shape:
            expected = f"expected {ranges.shape}"
            raise ValueError(f"noise function: shape {noisy.shape}, {expected}")
        return noisy

    @cached_property
    def fmcw(self) -> Any:
        """The simulated FMCW radar, a ``radarsim.addons.fmcw.radar.FmcwRadar``.

        Raises:
            PresetError: If the preset describes no FMCW radar.
            MissingPackage: If the add-on is not installed.
        """
        settings = load_fmcw_settings(self.name, **self._fmcw)
        make_radar = plugins.load("radarsim.sensors", "fmcw")
        return make_radar(self.name, settings, self.settings)

    def spectrum(
        self,
        scene: Scene,
        pose: Pose2 | Pose3 | Sequence[float],
        rng: np.random.Generator | int,
    ) -> Any:
        """Record one revolution of an FMCW radar: the power per azimuth and range bin.

        Args:
            scene: From ``load_map``.
            pose: As in ``scan``.
            rng: Generator, or a seed. Speckle and noise are drawn from a spawned
                generator, so the random numbers of later scans do not change.

        Returns:
            A ``radarsim.addons.fmcw.spectrum.Spectrum``.

        Raises:
            PresetError: If the preset describes no FMCW radar.
            MissingPackage: If the add-on is not installed.
            ValueError: If the pose is invalid.
        """
        placed, generator = sensor_pose(scene, pose), as_generator(rng, self.name)
        return self.fmcw.spectrum(scene, placed, generator)

    def beat_signal(
        self,
        scene: Scene,
        pose: Pose2 | Pose3 | Sequence[float],
        rng: np.random.Generator | int,
    ) -> NDArray[np.float32]:
        """Record one revolution like ``spectrum``, but return the samples of the ADC.

        The receiver has one channel, so the samples are real; ``scipy.signal.hilbert``
        of each azimuth gives the complex signal. The power spectrum is
        ``abs(rfft(samples * window_of(settings), n)) ** 2``, with a window whose sum is
        1 and ``n`` = ``fft_length`` of ``radarsim.addons.fmcw.radar_equation``. Its
        first B bins are ``power`` without ``noise_shape``, the receiver's tilt.

        Args:
            scene: As in ``spectrum``.
            pose: As in ``spectrum``.
            rng: As in ``spectrum``; the same seed gives the same revolution.

        Returns:
            (A, S) float32, S samples of the sweep at each of A azimuths, in W^0.5: an
            echo of power P is a cosine of amplitude 2 P^0.5.

        Raises:
            PresetError: If the preset describes no FMCW radar.
            MissingPackage: If the add-on is not installed.
            ValueError: If the pose is invalid.
        """
        placed, generator = sensor_pose(scene, pose), as_generator(rng, self.name)
        signal: NDArray[np.float32] = self.fmcw.beat_signal(scene, placed, generator)
        return signal

    def scan(
        self,
        scene: Scene,
        pose: Pose2 | Pose3 | Sequence[float],
        rng: np.random.Generator | int | None = None,
    ) -> Scan:
        """Scan a scene from one pose.

        Args:
            scene: From ``load_map``.
            pose: Pose of the sensor in the map frame, m and rad: x, y, z, roll, pitch,
                yaw; or x, y, yaw at a height of 0.346 m above the floor.
            rng: Generator of random rays and noise, or a seed; None for a sensor
                without either.

        Raises:
            TypeError: If the scene is not a Scene, but for example the name of a map.
            ValueError: If the pose is invalid, or an rng is needed and missing.
        """
        placed, rng = sensor_pose(scene, pose), as_generator(rng, self.name)
        if self._has_detector:
            scan = self._scan_by_detector(scene, placed, rng)
        else:
            places = np.array([(*placed.numbers(), -1.0)], np.float64)
            batch = ScanBatch(self.pattern, tracer_of(scene), places)
            batch.draw(0, rng, self.name)
            batch.trace()
            scan = batch.scan(0, self.name, placed, scene)
        if self.noise is not None:
            scan.ranges = self._add_noise(scan.ranges, rng)
        return scan

    def scan_many(
        self,
        scene: Scene,
        poses: Sequence[Pose2 | Pose3 | Sequence[float]] | Floats,
        rng: np.random.Generator | int | None = None,
    ) -> ScanArrays:
        """Scan a scene from many poses, on all processors.

        Args:
            scene: From ``load_map``.
            poses: M poses as in ``scan``, for example an array (M, 3) or (M, 6).
            rng: Generator of random rays and noise, or a seed; None for a sensor
                without either.

        Returns:
            The same values as M calls of ``scan`` in this order.

        Raises:
            ValueError: If a pose is invalid, or an rng is needed and missing.
        """
        placed, rng = sensor_poses(scene, poses), as_generator(rng, self.name)
        if self._has_detector:
            scans = [
                self._scan_by_detector(scene, Pose3(*row), rng)
                for row in placed.tolist()
            ]
            ranges = np.array([scan.ranges for scan in scans], np.float64)
            ranges = ranges.reshape(-1, len(self.angles))
            rays = np.zeros(ranges.shape, np.int8) if self.has_side_rays else None
            many = ScanArrays(placed, self.angles, ranges, rays)
        else:
            many = scan_poses(self, tracer_of(scene), placed, rng)
        if self.noise is None:
            return many
        noisy = [self._add_noise(ranges, rng) for ranges in many.ranges]
        return many._replace(ranges=np.array(noisy).reshape(many.ranges.shape))

    def _scan_by_detector(
        self, scene: Scene, pose: Pose3, rng: np.random.Generator | None
    ) -> Scan:
        """Return a scan of the targets that the FMCW radar's detector finds."""
        if rng is None:
            raise ValueError(f"no rng, expected a Generator for sensor {self.name!r}")
        scan: Scan = self.fmcw.scan(scene, pose, rng)
        return scan


def load_sensor(name: str, /, **settings: Any) -> RangeScanner:
    """Create a scanner from a preset; keyword arguments change its settings.

    Args:
        name: Name of the preset.
        **settings: Changed settings; ``fmcw`` maps settings of the FMCW radar.

    Raises:
        PresetError: If there is no such preset or setting, or a value is invalid.
    """
    fmcw = settings.pop("fmcw", None)
    if fmcw:
        load_fmcw_settings(name, **fmcw)
    return RangeScanner(name, load_settings(name, **settings), fmcw)


def sensor_pose(scene: Scene, pose: Pose2 | Pose3 | Sequence[float]) -> Pose3:
    """Convert x, y, z, roll, pitch, yaw, or only x, y, yaw, to the pose of a sensor.

    A ``Pose3`` provides six numbers, and a ``Pose2`` three.

    Raises:
        TypeError: If the scene is not a Scene.
        ValueError: If the pose does not consist of three or six finite numbers.
    """
    if not isinstance(scene, Scene):
        raise expected_scene(scene)
    if isinstance(pose, Pose3):
        return pose
    if isinstance(pose, Pose2):
        pose = pose.x, pose.y, pose.yaw
    try:
        numbers = given = list(map(float, pose))
    except (TypeError, ValueError):
        text = f"pose {pose!r}, expected a Pose2, a Pose3, or three or six numbers"
        raise ValueError(text) from None
    if len(numbers) == 3:
        x, y, yaw = numbers
        z = scene.floor_at(x, y) + SENSOR_HEIGHT if math.isfinite(x + y) else 0.0
        numbers = [x, y, z, 0.0, 0.0, yaw]
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise ValueError(f"pose {given!r}, expected three or six finite numbers")
    return Pose3(*numbers)


def sensor_poses(
    scene: Scene, poses: Sequence[Pose2 | Pose3 | Sequence[float]] | Floats
) -> Floats:
    """Convert M sensor poses to rows of x, y, z, roll, pitch, yaw, (M, 6).

    Raises:
        ValueError: If a pose is invalid.
    """
    if not isinstance(scene, Scene):
        raise expected_scene(scene)
    try:
        table = np.array(poses, np.float64)
    except (TypeError, ValueError):  # Pose objects, or rows of different lengths
        table = np.zeros(0)
    if table.ndim == 2 and np.isfinite(table).all():
        if table.shape[1] == 6:
            return table
        # Converting poses one by one would take as long as tracing their scans.
        floors = {start.pose.z for start in scene.starts}
        if table.shape[1] == 3 and len(floors) <= 1:
            placed = np.zeros((len(table), 6))
            placed[:, [0, 1, 5]] = table
            placed[:, 2] = max(floors, default=0.0) + SENSOR_HEIGHT
            return placed
    placed = np.zeros((len(poses), 6))
    for i, pose in enumerate(poses):
        try:
            placed[i] = sensor_pose(scene, pose).numbers()
        except (TypeError, ValueError) as error:
            raise ValueError(f"poses[{i}]: {error}") from None
    return placed
