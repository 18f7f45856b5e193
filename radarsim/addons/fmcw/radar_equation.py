"""The radar equation: received power, noise, and cross sections of known shapes.

Source: M. I. Skolnik, Introduction to Radar Systems; the gain is that of a Gaussian
beam, G = 16 ln 2 / (az el).

One-way patterns of the antenna are relative to the middle of the beam. Across it is a
Gaussian, up and down too; below the horizon, where the Gaussian falls off, a fan may
fill it in as a squared cosecant. With it a point at a given depth below the antenna
returns the same power at all ranges. The window over the samples of a sweep determines
how wide noise and echoes are.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len

from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

WRAPPED: Final = 8.0  # resolutions; at that distance windows are below -58 dB
# Shares of a window that are a constant, one turn of a cosine, and two turns (Harris,
# On the use of windows for harmonic analysis, 1978). scipy.signal has them as well, and
# takes .35 s of each start of a server to import.
_COSINES: Final = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 1 - 0.54),
    "blackman": (0.42, 0.5, 0.08),
}


def fft_length(settings: FmcwSettings) -> int:
    """Return the length of the FFT of a sweep, an even number.

    The receiver has one channel: of the spectrum of its real samples the first half
    counts. That is longer than the bins, so that the main lobe of what is beyond the
    last of them does not show in it.
    """
    half = settings.bins + math.ceil(WRAPPED * settings.padding)
    return 2 * int(next_fast_len(half, real=True))


def sample_count(settings: FmcwSettings) -> int:
    """Return the number of samples of a sweep; the rest of the FFT is padding."""
    return max(round(fft_length(settings) / settings.padding), 4)


@lru_cache(maxsize=16)
def window_of(settings: FmcwSettings) -> Floats:
    """Return the window over the samples of a sweep, (S,), with a sum of 1."""
    # Of a whole period, as the FFT takes it: the first sample would follow the last.
    phase = np.linspace(-np.pi, np.pi, sample_count(settings) + 1)[:-1]
    shares = enumerate(_COSINES[settings.window])
    window = sum((a * np.cos(k * phase) for k, a in shares), np.zeros_like(phase))
    # So a tone of amplitude 1 has a peak of 1, whatever the window.
    window /= window.sum()
    window.setflags(write=False)
    return window


def noise_correlation(settings: FmcwSettings, bins: Floats) -> Floats:
    """Return the correlation of the noise's field between bins, real.

    Args:
        settings: The radar.
        bins: (N,) distances between bins.

    Returns:
        (N,) correlations; their squares are those of the power.
    """
    # White noise behind a window: its spectrum is correlated as the window's square.
    square = window_of(settings) ** 2
    middle = np.arange(len(square)) - len(square) / 2
    turns = np.outer(bins / fft_length(settings), middle)
    return np.asarray((np.cos(2 * np.pi * turns) @ square) / square.sum())


REACH = (
    1.25  # beamwidths from the middle to where the pattern is cut off; two-way, -38 dB
)
_STEPS = 20_001  # of the integral over elevation


def gaussian(angles: ArrayLike, beamwidth: float) -> Floats:
    """Return the one-way power of a Gaussian beam.

    Args:
        angles: Angles from the middle of the beam.
        beamwidth: Width between the half-power points, in the same unit.
    """
    return np.asarray(np.exp(-4 * math.log(2) * (np.asarray(angles) / beamwidth) ** 2))


def elevation_pattern(settings: FmcwSettings, elevations: ArrayLike) -> Floats:
    """Return the one-way power at elevations, rad, up from the horizon."""
    angles = np.asarray(elevations, np.float64)
    width = math.radians(settings.beamwidth_el_deg)
    power = gaussian(angles, width)
    if settings.fan_deg:
        edge = width / 2
        below = np.clip(-angles, edge, math.pi / 2)
        filled = 0.5 * (math.sin(edge) / np.sin(below)) ** 2
        is_fan = (angles < -edge) & (angles >= -math.radians(settings.fan_deg))
        power = np.where(is_fan, np.maximum(power, filled), power)
    return power


def elevation_limits(settings: FmcwSettings) -> tuple[float, float]:
    """Return the lower and the upper edge of the beam, rad."""
    upper = REACH * math.radians(settings.beamwidth_el_deg)
    return -max(upper, math.radians(settings.fan_deg)), upper


@lru_cache(maxsize=16)
def directivity(settings: FmcwSettings) -> float:
    """Return the gain in the middle of the beam; 16 ln 2 / (az el) without a fan."""
    low, high = -math.pi / 2, math.pi / 2
    elevations = np.linspace(low, high, _STEPS)
    height = float(elevation_pattern(settings, elevations).mean() * (high - low))
    # The integral of a Gaussian over all angles.
    across = math.radians(settings.beamwidth_az_deg) * math.sqrt(
        math.pi / (4 * math.log(2))
    )
    return 4 * math.pi / (across * height)


def rows_in_beam(settings: FmcwSettings) -> int:
    """Return how many directions to each side of a point see it in their main lobe."""
    width = math.radians(settings.beamwidth_az_deg)
    return max(math.ceil(1.5 * width / settings.step), 1)


BOLTZMANN: Final = 1.380649e-23  # J/K
REFERENCE_TEMPERATURE: Final = 290.0  # K, to which noise figures refer


def watts(dbm: ArrayLike) -> Floats:
    """Convert dBm to W."""
    return np.asarray(1e-3 * 10 ** (np.asarray(dbm, np.float64) / 10))


def dbm_of(power: ArrayLike) -> Floats:
    """Convert W to dBm; no power is -inf."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.asarray(power, np.float64)) + 30)


def radar_constant(settings: FmcwSettings) -> float:
    """Return Pt G^2 lambda^2 / ((4 pi)^3 L), W m^2; power by sigma / R^4."""
    sent = watts(settings.transmit_dbm - settings.loss_db)
    gain = directivity(settings)
    return float(sent * gain**2 * settings.wavelength**2 / (4 * math.pi) ** 3)


def noise_power(settings: FmcwSettings) -> float:
    """Return kTBF in a bin, W; B is the window's noise bandwidth over the sweep."""
    window = window_of(settings)
    bandwidth = float(len(window) * (window**2).sum()) / settings.sweep_time
    density = BOLTZMANN * REFERENCE_TEMPERATURE * 10 ** (settings.noise_figure_db / 10)
    return density * bandwidth


@lru_cache(maxsize=16)
def noise_shape(settings: FmcwSettings) -> NDArray[np.float32]:
    """Return the noise power of each bin relative to ``noise_power``, (B,).

    It falls by ``noise_tilt_db`` over all bins; the mean of its decibels is 0.
    """
    places = np.linspace(0.5, -0.5, settings.bins)
    shape = (10 ** (settings.noise_tilt_db * places / 10)).astype(np.float32)
    shape.setflags(write=False)
    return shape


def doppler_shift(
    settings: FmcwSettings, speed: ArrayLike, *, up: bool = True
) -> Floats:
    """Return by how much a point seems farther away as the radar approaches it, m.

    Args:
        settings: The radar.
        speed: Speed towards the point, m/s.
        up: Whether the frequency rises during a sweep.
    """
    hertz, sweep = settings.carrier_ghz * 1e9, settings.bandwidth_mhz * 1e6
    per_speed = hertz * settings.sweep_time / sweep
    return np.asarray((-1.0 if up else 1.0) * per_speed * np.asarray(speed))
