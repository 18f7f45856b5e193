"""Windows over the samples of a sweep."""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.fft import next_fast_len
from scipy.signal import get_window

from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

WRAPPED: Final = 8.0  # resolutions; at that distance windows are below -58 dB
_SCIPY: Final = {"rectangular": "boxcar"}  # other names of the windows


def fft_length(settings: FmcwSettings) -> int:
    """Return the length of the FFT of a sweep.

    It is longer than the bins by so much that what is strong in the first of them does
    not show in the last: its main lobe reaches below zero.
    """
    return int(next_fast_len(settings.bins + math.ceil(WRAPPED * settings.padding)))


def sample_count(settings: FmcwSettings) -> int:
    """Return the number of samples of a sweep; the rest of the FFT is padding."""
    return max(round(fft_length(settings) / settings.padding), 2)


@lru_cache(maxsize=16)
def window_of(settings: FmcwSettings) -> Floats:
    """Return the window over the samples of a sweep, (S,), with a sum of 1."""
    name = _SCIPY.get(settings.window, settings.window)
    window = np.asarray(get_window(name, sample_count(settings)), np.float64)
    window /= window.sum()
    window.setflags(write=False)
    return window


def noise_bandwidth(settings: FmcwSettings) -> float:
    """Return the noise bandwidth of the window, in units of one over the sweep time."""
    window = window_of(settings)
    return float(len(window) * (window**2).sum())


def noise_correlation(settings: FmcwSettings, bins: Floats) -> Floats:
    """Return the correlation of the noise's field between bins, real.

    Args:
        settings: The radar.
        bins: (N,) distances between bins.

    Returns:
        (N,) correlations; their squares are those of the power.
    """
    square = window_of(settings) ** 2
    middle = np.arange(len(square)) - len(square) / 2
    turns = np.outer(bins / fft_length(settings), middle)
    return np.asarray((np.cos(2 * np.pi * turns) @ square) / square.sum())
