"""The radar equation: received power, noise, and cross sections of known shapes.

Source: M. I. Skolnik, Introduction to Radar Systems; the gain is that of a Gaussian
beam, G = 16 ln 2 / (az el).
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarsim.fmcw.antenna import directivity
from radarsim.fmcw.windows import noise_bandwidth
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

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


def received_power(settings: FmcwSettings, rcs: ArrayLike, ranges: ArrayLike) -> Floats:
    """Return the power from points in the middle of the beam, W.

    Args:
        settings: The radar.
        rcs: Radar cross sections, m^2.
        ranges: Distances, m.
    """
    sections, distances = np.asarray(rcs), np.asarray(ranges, np.float64)
    return np.asarray(radar_constant(settings) * sections / distances**4)


def noise_power(settings: FmcwSettings) -> float:
    """Return kTBF in a bin, W; B is the window's noise bandwidth over the sweep."""
    bandwidth = noise_bandwidth(settings) / settings.sweep_time
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
