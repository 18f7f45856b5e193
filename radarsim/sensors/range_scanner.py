"""Range scanners: radars and lasers, which differ only in their settings."""

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

# Takes ranges, (N,) m, and a generator; returns ranges.
Noise: TypeAlias = Callable[[Floats, np.random.Generator], Floats]

SENSOR_HEIGHT: Final = 0.346  # m; height of a P3AT's scanner above the floor


class RangeScanner:
    """A radar or a laser.

    Attributes:
        name: Name of its preset.
        settings: All its settings.
        angles: (N,) directions of its beams, rad, counter-clockwise from the right.
        pattern: Its beams.
        medium: ``RADAR`` or ``LASER``.
        noise: Its noise of ``with_noise``, if it has one.
    """

    def __init__(
        self,
        name: str,
        settings: SensorSettings,
        fmcw: Mapping[str, Any] | None = None,
        noise: Noise | None = None,
    ) -> None:
        """Create a scanner.

        Args:
            name: Name of its preset.
            settings: All its settings.
            fmcw: Changed settings of its FMCW radar.
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
        """Whether beams can have several rays."""
        return self.settings.has_side_rays

    @cached_property
    def with_all_echoes(self) -> "RangeScanner":
        """The same scanner, listing all echoes where it keeps only the last ones.

        It draws the same random numbers and has the same ranges. A scanner that keeps
        the first or the strongest echoes lists only those.
        """
        # First and strongest echoes decide the ranges; listing more would change them.
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
        """Return this scanner with some settings changed, as of ``load_sensor``.

        Raises:
            PresetError: If there is no such setting, or a value is invalid.
        """
        fmcw = self._fmcw | settings.pop("fmcw", {})
        if fmcw:
            load_fmcw_settings(self.name, **fmcw)
        changed = load_settings(self.name, **{**self.settings.model_dump(), **settings})
        return RangeScanner(self.name, changed, fmcw, self.noise)

    def with_noise(self, noise: "Noise") -> "RangeScanner":
        """Return this scanner with a noise of one's own, after all of its own.

        It changes the ranges of ``scan`` and ``scan_many``, not the echoes.

        Args:
            noise: Called with the ranges of a scan, (N,) m, inf where nothing came
                back, and a generator; returns the ranges, (N,) m.
        """
        return RangeScanner(self.name, self.settings, self._fmcw, noise)

    def _add_noise(self, ranges: Floats, rng: np.random.Generator | None) -> Floats:
        """Return the ranges of a scan with the noise of one's own.

        Raises:
            ValueError: If an rng is missing, or the noise returns other than N ranges.
        """
        if self.noise is None:
            return ranges
        if rng is None:
            raise ValueError(f"no rng, expected a Generator for the noise of {self!r}")
        # A child, so that many scans have the same noise as one after the other.
        (child,) = rng.spawn(1)
        noisy = np.asarray(self.noise(ranges.copy(), child), np.float64)
        if noisy.shape != ranges.shape:
            expected = f"expected {ranges.shape}"
            raise ValueError(f"noise gives ranges of shape {noisy.shape}, {expected}")
        return noisy

    @cached_property
    def fmcw(self) -> Any:
        """The FMCW radar that it is, a ``radarsim.addons.fmcw.radar.FmcwRadar``.

        Raises:
            PresetError: If its preset describes none.
            MissingPackage: If the add-on is not there.
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
        """Record a turn as an FMCW radar: the power in each direction and range bin.

        Args:
            scene: From ``load_map``.
            pose: As in ``scan``.
            rng: Source of speckle and noise, for which it spawns a child: what scans
                draw from it stays the same. A whole number is the seed of one.

        Returns:
            A ``radarsim.addons.fmcw.spectrum.Spectrum``.

        Raises:
            PresetError: If its preset describes no FMCW radar.
            MissingPackage: If the add-on is not there.
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
        """Record a turn as ``spectrum`` does, but return what the converter samples.

        The receiver has one channel, so that the samples are real; its complex signal
        is ``scipy.signal.hilbert`` of each direction. With the window, whose sum is 1,
        and an FFT of ``n`` = ``fft_length`` of ``radarsim.addons.fmcw.radar_equation``
        it is the spectrum: ``abs(rfft(samples * window_of(settings), n)) ** 2`` is in
        its first B bins ``power``, but for ``noise_shape``, the receiver's tilt.

        Args:
            scene: As in ``spectrum``.
            pose: As in ``spectrum``.
            rng: As in ``spectrum``; the same seed records the same turn.

        Returns:
            (A, S) float32, S samples of the sweep in each direction, in W^0.5: an echo
            of power P is a cosine of amplitude 2 P^0.5.

        Raises:
            PresetError: If its preset describes no FMCW radar.
            MissingPackage: If the add-on is not there.
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
        """Scan a scene.

        Args:
            scene: From ``load_map``.
            pose: Pose of the sensor in the map frame, m and rad: x, y, z, roll, pitch,
                yaw; or x, y, yaw at a height of 0.346 m above the floor.
            rng: Source of random rays and noise, or the seed of one; None for a sensor
                without either.

        Raises:
            TypeError: If the scene is not one, such as the name of a map.
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
            rng: Source of random rays and noise, or the seed of one; None for a sensor
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
        """Take a scan of what the detector of the FMCW radar finds."""
        if rng is None:
            raise ValueError(f"no rng, expected a Generator for sensor {self.name!r}")
        scan: Scan = self.fmcw.scan(scene, pose, rng)
        return scan


def load_sensor(name: str, /, **settings: Any) -> RangeScanner:
    """Create a scanner from a preset, with some of its settings changed.

    Args:
        name: Name of the preset.
        **settings: Changed settings; ``fmcw`` is a mapping of those of its FMCW radar.

    Raises:
        PresetError: If there is no such preset or setting, or a value is invalid.
    """
    fmcw = settings.pop("fmcw", None)
    if fmcw:
        load_fmcw_settings(name, **fmcw)
    return RangeScanner(name, load_settings(name, **settings), fmcw)


def sensor_pose(scene: Scene, pose: Pose2 | Pose3 | Sequence[float]) -> Pose3:
    """Convert a sensor pose: x, y, z, roll, pitch, yaw, or x, y, yaw at default height.

    These are also what a ``Pose3`` and a ``Pose2`` have.

    Raises:
        ValueError: If it is neither three nor six finite numbers.
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
    """Convert many sensor poses to x, y, z, roll, pitch, yaw, (M, 6).

    Raises:
        ValueError: If one is invalid.
    """
    if not isinstance(scene, Scene):
        raise expected_scene(scene)
    try:
        table = np.array(poses, np.float64)
    except (TypeError, ValueError):  # poses, or one of other lengths
        table = np.zeros(0)
    if table.ndim == 2 and np.isfinite(table).all():
        if table.shape[1] == 6:
            return table
        # One by one they would take as long as to trace them.
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
