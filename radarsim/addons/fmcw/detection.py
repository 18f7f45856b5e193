"""Target detectors for spectra: CA-CFAR, OS-CFAR, and the k strongest bins.

Theory of operation
===================
A detector with constant false alarm rate (CFAR) compares each bin with training bins
around it, beyond some guard bins: CA with their mean, OS with one of them by its rank
in power. The threshold factor is exact for noise with exponentially distributed power.
With N independent training bins:

    CA   Pfa = (1 + alpha / N)^-N
    OS   Pfa = product over i < k of (N - i) / (N - i + alpha)

Neighbouring bins of a padded and windowed FFT are not independent. So training bins are
some resolutions apart, and the factor of CA accounts for the remaining correlation
among them and with the tested bin. Let C be the covariance of the fields of all these
bins, and D = diag(1, -alpha / N, ..., -alpha / N). The tested bin exceeds the threshold
if a quadratic form of independent fields is positive, whose weights are the eigenvalues
of C D. One eigenvalue, u, is positive, the others are -v_i, and

    Pfa = product of 1 / (1 + v_i / u)

Sources: H. Rohling, "Radar CFAR thresholding in clutter and multiple target
situations", IEEE Trans. AES 19, 1983. For the k strongest bins: D. Adolfsson and
others, "CFEAR radarodometry", IROS 2021.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from radarsim.addons.fmcw.radar_equation import noise_correlation
from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

Mask = NDArray[np.bool_]

DETECTORS: Final = ("ca", "os", "k")

ORDER: Final = 24  # rank of the training bin that OS compares with, from the weakest
MIN_COUNT: Final = 60  # least count of the k strongest bins
MIN_RANGE: Final = 2.5  # m; leakage dominates at shorter ranges


class Detections(NamedTuple):
    """N targets in a spectrum, sorted by azimuth and range.

    Attributes:
        rows: Indices of azimuths, (N,) int64.
        bins: Range bins, (N,) int64.
        angles: Azimuths, (N,) rad, counter-clockwise from straight ahead.
        ranges: Ranges, (N,) m.
        dbm: Power in the bin, (N,) dBm.
        rcs_dbsm: Radar cross section of a point in the middle of the beam that returns
            this power without obstacles in between, (N,) dB relative to 1 m^2.
        snr_db: Power in the bin relative to the mean noise there, (N,) dB.
        radial_velocity: Radial velocities, (N,) m/s; see ``Spectrum``.
    """

    rows: NDArray[np.int64]
    bins: NDArray[np.int64]
    angles: Floats
    ranges: Floats
    dbm: Floats
    rcs_dbsm: Floats
    snr_db: Floats
    radial_velocity: Floats


def strongest_mask(
    counts: NDArray[np.uint8], most: int, allowed: Mask, least: int
) -> Mask:
    """Return a mask of each azimuth's strongest bins, (A, B), nearer ones if equal.

    Args:
        counts: Counts of the radar, (A, B).
        most: Number of bins in each azimuth.
        allowed: Bins that remain in the mask after the strongest are selected, (B,).
        least: Smallest count of a selected bin.

    Raises:
        ValueError: If ``most`` is below 1.
    """
    if most < 1:
        raise ValueError(f"count {most}, expected at least 1")
    inverted = np.uint8(255) - counts
    order = np.argsort(inverted, axis=1, kind="stable")[:, :most]
    mask = np.zeros(counts.shape, np.bool_)
    np.put_along_axis(mask, order, True, axis=1)
    return mask & (counts >= least) & allowed


def peaks_of(mask: Mask, power: NDArray[np.float32]) -> Mask:
    """Return a mask of the strongest bin of each group of adjacent set bins, (A, B)."""
    peaks = np.zeros(mask.shape, np.bool_)
    engine.find_peaks(mask, power, peaks)
    return peaks


TRAINING: Final = 32  # bins, half of them on each side
GUARD: Final = 2  # resolutions between a bin and its training bins
SPACING: Final = 2.0  # resolutions between training bins


class Training(NamedTuple):
    """The training bins: bins around a tested bin, with which it is compared.

    Attributes:
        bins: Number of training bins, N, half of them on each side.
        guard: Number of bins between the tested bin and the nearest training bin.
        step: Distance between training bins, in bins.
    """

    bins: int
    guard: int
    step: int


def training_of(settings: FmcwSettings) -> Training:
    """Return training bins that are far enough apart to have independent noise."""
    step = max(round(SPACING * settings.padding), 1)
    return Training(TRAINING, max(round(GUARD * settings.padding), 1), step)


@lru_cache(maxsize=16)
def training_correlation(
    settings: FmcwSettings, training: Training
) -> tuple[float, ...]:
    """Return the noise correlation of two bins for each distance between the bins."""
    half = training.bins // 2
    farthest = training.guard + 1 + (half - 1) * training.step
    return (*noise_correlation(settings, np.arange(2.0 * farthest + 1)).tolist(),)


def ca_factor(count: int, pfa: float) -> float:
    """Return alpha of CA-CFAR: the threshold relative to the mean of the training bins.

    Args:
        count: Number of independent training bins, N.
        pfa: Probability of a false alarm.

    >>> round(ca_factor(32, 1e-4), 3)
    10.673
    """
    _check_pfa(pfa)
    return float(count * (pfa ** (-1 / count) - 1))


@lru_cache(maxsize=64)
def correlated_factor(
    training: Training, sides: int, pfa: float, correlation: tuple[float, ...]
) -> float:
    """Return alpha of CA, the threshold factor, for bins with correlated noise.

    Args:
        training: The training bins.
        sides: Number of sides of the tested bin with training bins, 1 or 2.
        pfa: Probability of a false alarm.
        correlation: Correlation of the noise, by the distance of bins.
    """
    _check_pfa(pfa)
    one = training.guard + 1 + np.arange(training.bins // 2) * training.step
    places = np.concatenate([np.zeros(1, np.int64), one, -one][: 1 + sides])
    covariance = np.array(correlation)[np.abs(np.subtract.outer(places, places))]
    count = len(places) - 1

    def log_pfa(alpha: float) -> float:
        weights = np.full(count + 1, -alpha / count)
        weights[0] = 1.0
        values = np.sort(np.linalg.eigvals(covariance * weights).real)
        return -float(np.log1p(np.maximum(-values[:-1], 0.0) / values[-1]).sum())

    return _root(log_pfa, pfa)


@lru_cache(maxsize=64)
def os_factor(count: int, order: int, pfa: float) -> float:
    """Return alpha of OS-CFAR: the threshold relative to the k-th weakest training bin.

    Args:
        count: Number of training bins, N.
        order: Rank k, from the weakest.
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


def _root(log_pfa: Callable[[float], float], pfa: float) -> float:
    """Return the threshold factor for a probability of false alarm of ``pfa``."""
    high = 1.0
    while log_pfa(high) > math.log(pfa):
        high *= 2
    return float(brentq(lambda x: log_pfa(x) - math.log(pfa), 0, high, xtol=1e-12))


LEVELS_PER_DB: Final = 8.0  # resolution of the histogram of OS


def ca_mask(
    power: NDArray[np.float32],
    training: Training,
    pfa: float,
    correlation: tuple[float, ...] | None = None,
) -> Mask:
    """Return a mask of bins that exceed the CA-CFAR threshold, (A, B).

    Near the first and the last bin only the training bins on one side are used.

    Args:
        power: Power, (A, B).
        training: The training bins.
        pfa: Probability of a false alarm in a bin.
        correlation: As in ``correlated_factor``; None for independent bins.
    """
    half = training.bins // 2
    one_side, both_sides = (
        ca_factor(sides * half, pfa)
        if correlation is None
        else correlated_factor(training, sides, pfa, correlation)
        for sides in (1, 2)
    )
    found = np.zeros(power.shape, np.bool_)
    nearest, step = training.guard + 1, training.step
    if not engine.find_ca(power, nearest, step, half, one_side, both_sides, found):
        raise EngineError(f"{training}, expected positive numbers")
    return found


def os_mask(
    power: NDArray[np.float32], training: Training, pfa: float, order: int
) -> Mask:
    """Return a mask of bins that exceed the OS-CFAR threshold, (A, B).

    Near the first and the last bin only the training bins on one side are used, with a
    proportional rank.

    Args:
        power: Power relative to the noise, (A, B).
        training: The training bins.
        pfa: Probability of a false alarm in a bin.
        order: Rank of the training bin, from the weakest.
    """
    found = np.zeros(power.shape, np.bool_)
    # The engine sorts powers into a histogram with steps of 1/8 dB from -100 dB on.
    levels = np.log10(np.maximum(power, np.float32(1e-10)))
    levels *= np.float32(10 * LEVELS_PER_DB)
    levels += np.float32(100 * LEVELS_PER_DB)
    half, nearest = training.bins // 2, training.guard + 1
    count, farthest = power.shape[1], nearest + (half - 1) * training.step
    for span in (  # first bin, end, whether training bins before and after are used
        (0, min(farthest, count - farthest), False, True),
        (farthest, count - farthest, True, True),
        (max(farthest, count - farthest), count, True, False),
    ):
        bins = half * sum(span[2:])
        which = max(order * bins // training.bins, 1)
        factor = 10 * LEVELS_PER_DB * math.log10(os_factor(bins, which, pfa))
        limit, row = float(np.float32(factor)), (nearest, training.step, half)
        if not engine.find_os(levels, *row, *span, which, limit, found):
            raise EngineError(f"order {order} of {training}, expected one of its bins")
    return found
