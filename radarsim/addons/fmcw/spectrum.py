"""The spectrum of a revolution of an FMCW radar: the power by azimuth and range bin."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from radarsim.addons.fmcw.detection import (
    DETECTORS,
    MIN_COUNT,
    MIN_RANGE,
    ORDER,
    Detections,
    ca_mask,
    os_mask,
    peaks_of,
    strongest_mask,
    training_correlation,
    training_of,
)
from radarsim.addons.fmcw.radar_equation import (
    dbm_of,
    fft_length,
    noise_power,
    radar_constant,
    window_of,
)
from radarsim.geometry import Floats, Pose3
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEDIAN = float(np.log(2))  # median of an exponential distribution with mean 1


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum:
    """The spectrum of a revolution of an FMCW radar: A azimuths with B range bins.

    Attributes:
        sensor: Name of the preset.
        pose: Pose of the antenna, map frame.
        settings: Settings of the radar.
        angles: Azimuths, (A,) rad, counter-clockwise from straight ahead. The radar
            rotates clockwise, so they fall from 0 to -2 pi.
        ranges: Ranges of the bins, (B,) m.
        power: Received power in each bin, (A, B) float32, W.
        echo_power: Mean power of the echoes from each bin, before speckle, window and
            noise, (A, B) float32, W. Its sum over bins is the total echo power.
        noise_floor: Mean power of the noise, (B,) float32, W.
        radial_velocity: Speed at which objects move away from the antenna, (A, B)
            float32, m/s. It is ground truth, since such a radar measures no velocity;
            velocities only shift ranges. Within a beamwidth and two resolutions of a
            moving robot it is the velocity of the robot.
        scene: The map; None for a revolution in a simulation with robots.
    """

    sensor: str
    pose: Pose3
    settings: FmcwSettings
    angles: Floats
    ranges: Floats
    power: NDArray[np.float32]
    echo_power: NDArray[np.float32]
    noise_floor: NDArray[np.float32]
    radial_velocity: NDArray[np.float32]
    scene: Scene | None = None

    def __repr__(self) -> str:
        peak = float(dbm_of(self.power.max()))
        return (
            f"<Spectrum {self.sensor}: {len(self.angles)} azimuths of"
            f" {len(self.ranges)} bins, up to {peak:.1f} dBm,"
            f" from x {self.pose.x:.2f} m, y {self.pose.y:.2f} m>"
        )

    @cached_property
    def decibels(self) -> NDArray[np.float32]:
        """The received power, (A, B) dBm."""
        return dbm_of(self.power).astype(np.float32)

    @cached_property
    def counts(self) -> NDArray[np.uint8]:
        """The received power as counts from 0 to 255, as the radar stores it, (A, B).

        A count is ``count_db`` decibels; the noise has a median of ``floor_count``.
        """
        return counts_of(self.settings, self.power)

    @cached_property
    def mean(self) -> NDArray[np.float32]:
        """The expected power, (A, B) W: the mean over many random seeds.

        The window spreads each echo over several bins.
        """
        length = fft_length(self.settings)
        shape = self.noise_floor / np.float32(noise_power(self.settings))
        spread = np.abs(fft.fft(window_of(self.settings), length)) ** 2
        scale = np.float32(noise_power(self.settings))
        # FFTs convolve echoes with the window's spectrum; rounding errors may give
        # negative values.
        echoes = fft.rfft(self.echo_power / scale / shape, length, axis=1)
        echoes *= fft.rfft(spread).astype(np.complex64)
        seen = fft.irfft(echoes, length, axis=1)[:, : len(self.ranges)]
        return np.asarray((np.maximum(seen, 0) + 1) * shape * scale, np.float32)

    def detections(
        self, detector: str = "ca", *, pfa: float = 1e-4, count: int = 12
    ) -> Detections:
        """Detect targets in the spectrum.

        Args:
            detector: ``ca`` compares each bin with the mean of training bins around it,
                ``os`` with one of them by its rank in power, both at a constant false
                alarm rate; ``k`` selects the strongest bins of each azimuth.
            pfa: Probability of a false alarm in a bin of noise, for ``ca`` and ``os``.
            count: Maximum number of bins that ``k`` selects in each azimuth.

        Raises:
            ValueError: If there is no such detector, or a number is out of range.
        """
        allowed = self.ranges >= MIN_RANGE
        if detector == "k":
            # The published detector ``k`` uses the counts that radars store, not watts.
            mask = strongest_mask(self.counts, count, allowed, MIN_COUNT)
        elif detector in DETECTORS:
            training, power = training_of(self.settings), self.power / self.noise_floor
            if detector == "ca":
                correlation = training_correlation(self.settings, training)
                mask = ca_mask(power, training, pfa, correlation)
            else:
                mask = os_mask(power, training, pfa, ORDER)
            mask = peaks_of(mask & allowed, power)
        else:
            raise ValueError(f"detector {detector!r}, expected one of {DETECTORS}")
        rows, bins = np.nonzero(mask)
        ranges, dbm = self.ranges[bins], dbm_of(self.power[rows, bins])
        # The echo power of a point falls with the fourth power of the range.
        rcs_dbsm = dbm - dbm_of(radar_constant(self.settings)) + 40 * np.log10(ranges)
        snr_db = dbm - dbm_of(self.noise_floor[bins])
        velocity = self.radial_velocity[rows, bins].astype(np.float64)
        return Detections(
            rows, bins, self.angles[rows], ranges, dbm, rcs_dbsm, snr_db, velocity
        )

    def plot(
        self, ax: "Axes | None" = None, *, view: str = "cartesian", azimuth: int = 0
    ) -> "Axes":
        """Draw the spectrum of the revolution.

        Args:
            ax: Axes of matplotlib; None for a new figure.
            view: ``cartesian`` as seen from above, ``polar`` with a row for each
                azimuth, or ``ascope``, the power over range at an azimuth.
            azimuth: Index of the azimuth of an A-scope, 0 to A - 1.

        Raises:
            ValueError: If there is no such view or azimuth.
        """
        from radarsim.addons.fmcw.plots import plot_spectrum  # noqa: PLC0415 - slow

        return plot_spectrum(self, ax, view=view, azimuth=azimuth)


def counts_of(settings: FmcwSettings, power: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Convert received powers, W, to the counts, 0 to 255, that a radar stores."""
    median = noise_power(settings) * MEDIAN
    # ``tiny`` avoids logarithms of 0. The large arrays are changed in place.
    tiny = np.float32(np.finfo(np.float32).tiny)
    counts = np.log10(np.maximum(power, tiny))
    counts -= np.float32(np.log10(median))
    counts *= np.float32(10 / settings.count_db)
    counts += np.float32(settings.floor_count)
    np.rint(counts, out=counts)
    return np.clip(counts, 0, 255).astype(np.uint8)
