"""The radar equation: received power, and the window and the noise of a sweep.

The window over the samples of a sweep determines the noise bandwidth and the width of
echoes in range.

Source: M. I. Skolnik, Introduction to Radar Systems.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len

from radarsim.addons.fmcw.antenna import directivity
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

WRAPPED: Final = 8.0  # resolutions from an echo; beyond, windows are below -58 dB
# Coefficients of the constant, the first and the second cosine of each window (Harris,
# On the use of windows for harmonic analysis, 1978). scipy.signal has these windows,
# but its import would add 0.35 s to each start of a server.
_COSINES: Final = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 1 - 0.54),
    "blackman": (0.42, 0.5, 0.08),
}


def fft_length(settings: FmcwSettings) -> int:
    """Return the length of the FFT of a sweep, an even number.

    The receiver has a single channel with real samples, so only the first half of the
    spectrum is used. This half extends beyond the last bin, so that echoes from longer
    ranges do not alias into the bins.
    """
    half = settings.bins + math.ceil(WRAPPED * settings.padding)
    return 2 * int(next_fast_len(half, real=True))


def sample_count(settings: FmcwSettings) -> int:
    """Return the number of samples of a sweep; the rest of the FFT is padding."""
    return max(round(fft_length(settings) / settings.padding), 4)


@lru_cache(maxsize=16)
def window_of(settings: FmcwSettings) -> Floats:
    """Return the window function over the samples of a sweep, (S,), with a sum of 1."""
    # The window is periodic, as an FFT requires: the next sample would equal the first.
    phase = np.linspace(-np.pi, np.pi, sample_count(settings) + 1)[:-1]
    shares = enumerate(_COSINES[settings.window])
    window = sum((a * np.cos(k * phase) for k, a in shares), np.zeros_like(phase))
    # With this scale, a beat component of amplitude 1 has a peak of 1 for every window.
    window /= window.sum()
    window.setflags(write=False)
    return window


def noise_correlation(settings: FmcwSettings, bins: Floats) -> Floats:
    """Return the real part of the correlation between the noise of two range bins.

    Args:
        settings: Settings of the radar.
        bins: Distances between bins, (N,).

    Returns:
        Correlations, (N,); their squares are the correlations of the power.
    """
    # The correlation of windowed white noise is the spectrum of the squared window.
    square = window_of(settings) ** 2
    middle = np.arange(len(square)) - len(square) / 2
    turns = np.outer(bins / fft_length(settings), middle)
    return np.asarray((np.cos(2 * np.pi * turns) @ square) / square.sum())


BOLTZMANN: Final = 1.380649e-23  # J/K
REFERENCE_TEMPERATURE: Final = 290.0  # K, reference of noise figures


def watts(dbm: ArrayLike) -> Floats:
    """Convert dBm to W."""
    return np.asarray(1e-3 * 10 ** (np.asarray(dbm, np.float64) / 10))


def dbm_of(power: ArrayLike) -> Floats:
    """Convert W to dBm; 0 W gives -inf."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.asarray(power, np.float64)) + 30)


def radar_constant(settings: FmcwSettings) -> float:
    """Return Pt G^2 lambda^2 / ((4 pi)^3 L), W m^2: received power per sigma / R^4."""
    sent = watts(settings.transmit_dbm - settings.loss_db)
    gain = directivity(settings)
    return float(sent * gain**2 * settings.wavelength**2 / (4 * math.pi) ** 3)


def noise_power(settings: FmcwSettings) -> float:
    """Return the noise power k T B F in a bin, W; B is the window's noise bandwidth."""
    window = window_of(settings)
    bandwidth = float(len(window) * (window**2).sum()) / settings.sweep_time
    density = BOLTZMANN * REFERENCE_TEMPERATURE * 10 ** (settings.noise_figure_db / 10)
    return density * bandwidth


@lru_cache(maxsize=16)
def noise_shape(settings: FmcwSettings) -> NDArray[np.float32]:
    """Return the noise power of each range bin relative to ``noise_power``, (B,).

    It falls by ``noise_tilt_db`` over all bins; the mean of its decibels is 0.
    """
    places = np.linspace(0.5, -0.5, settings.bins)
    shape = (10 ** (settings.noise_tilt_db * places / 10)).astype(np.float32)
    shape.setflags(write=False)
    return shape


def doppler_shift(settings: FmcwSettings, speed: ArrayLike) -> Floats:
    """Return by how much the Doppler effect shifts the range of a point, m.

    The frequency rises during a sweep, so approaching points appear closer.

    Args:
        settings: Settings of the radar.
        speed: Speed towards the point, m/s.
    """
    hertz, sweep = settings.carrier_ghz * 1e9, settings.bandwidth_mhz * 1e6
    per_speed = hertz * settings.sweep_time / sweep
    return np.asarray(-per_speed * np.asarray(speed))
