"""Thresholds of constant false alarm rate: by how much a target exceeds the noise.

Theory of operation
===================
A detector of constant false alarm rate compares each bin with training bins around it,
some guard bins apart: CA with their mean, OS with one of them in order of power. The
factor above it is exact for noise of exponential power. With N independent bins:

    CA   Pfa = (1 + alpha / N)^-N
    OS   Pfa = product over i < k of (N - i) / (N - i + alpha)

Neighbouring bins of a padded and windowed FFT are not independent. So training bins are
some resolutions apart, and CA's factor is that of what correlation remains: the mean of
N correlated bins is a sum of independent ones, weighted by the eigenvalues of their
covariance, and Pfa = product of 1 / (1 + alpha lambda_i / N).

Source: H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations",
IEEE Trans. AES 19, 1983.
"""

import math
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.linalg import eigvalsh, toeplitz
from scipy.optimize import brentq

from radarsim.fmcw.windows import noise_correlation
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

TRAINING: Final = 32  # bins, half of them on each side
GUARD: Final = 2  # resolutions between a bin and its training bins
SPACING: Final = 2.0  # resolutions between training bins


class Training(NamedTuple):
    """Which bins a bin is compared with.

    Attributes:
        bins: N, half of them on each side.
        guard: Bins between a bin and the nearest of them.
        step: Bins from one to the next.
    """

    bins: int
    guard: int
    step: int


def training_of(settings: FmcwSettings) -> Training:
    """Return the training bins of a radar, far enough apart to be independent."""
    step = max(round(SPACING * settings.padding), 1)
    return Training(TRAINING, max(round(GUARD * settings.padding), 1), step)


@lru_cache(maxsize=16)
def training_correlation(settings: FmcwSettings, training: Training) -> Floats:
    """Return the correlation of the noise's field between training bins, (N / 2,)."""
    lags = np.arange(training.bins // 2, dtype=np.float64) * training.step
    return noise_correlation(settings, lags)


def ca_factor(count: int, pfa: float, correlation: Floats | None = None) -> float:
    """Return alpha of CA: by how much a bin must exceed the mean of its training bins.

    Args:
        count: N.
        pfa: Probability of a false alarm.
        correlation: (N / 2,) of the field of the noise, by the distance between
            training bins of one side; None for independent ones.

    >>> round(ca_factor(32, 1e-4), 3)
    10.673
    """
    _check_pfa(pfa)
    if correlation is None:
        return float(count * (pfa ** (-1 / count) - 1))
    return _correlated_factor(count, pfa, tuple(correlation.tolist()))


@lru_cache(maxsize=64)
def _correlated_factor(count: int, pfa: float, correlation: tuple[float, ...]) -> float:
    half = min(count, len(correlation))
    # Bins of the two sides are so far apart that they are independent. Their power is
    # the sum of two squares of the field, so that its eigenvalues count.
    values = np.tile(eigvalsh(toeplitz(correlation[:half])), count // half)
    return _root(lambda alpha: -float(np.log1p(alpha * values / count).sum()), pfa)


@lru_cache(maxsize=64)
def os_factor(count: int, order: int, pfa: float) -> float:
    """Return alpha of OS: by how much a bin must exceed the k-th of its training bins.

    Args:
        count: N.
        order: k, from the weakest.
        pfa: Probability of a false alarm.

    >>> round(os_factor(32, 24, 1e-4), 2)
    8.58
    """
    _check_pfa(pfa)
    rest = count - np.arange(order)
    return _root(lambda alpha: float(np.log(rest / (rest + alpha)).sum()), pfa)


def _check_pfa(pfa: float) -> None:
    if not 0 < pfa < 1:
        raise ValueError(f"pfa {pfa!r}, expected above 0 and below 1")


def _root(log_pfa: Any, pfa: float) -> float:
    """Return where the logarithm of a falling probability has a value."""
    high = 1.0
    while log_pfa(high) > math.log(pfa):
        high *= 2
    return float(brentq(lambda x: log_pfa(x) - math.log(pfa), 0, high, xtol=1e-12))
