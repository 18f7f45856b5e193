"""Detectors of targets in a spectrum: CA-CFAR, OS-CFAR, and the k strongest bins.

Theory of operation
===================
A detector of constant false alarm rate compares each bin with training bins around it,
some guard bins apart: CA with their mean, OS with one of them in order of power. The
factor above it is exact for noise of exponential power. With N independent bins:

    CA   Pfa = (1 + alpha / N)^-N
    OS   Pfa = product over i < k of (N - i) / (N - i + alpha)

Neighbouring bins of a padded and windowed FFT are not independent. So training bins are
some resolutions apart, and CA's factor is that of what correlation remains, among them
and with the bin that is compared. With C the covariance of the fields of all of these,
and D = diag(1, -alpha / N, ..., -alpha / N), a bin is over the threshold where a
quadratic form of independent fields is above 0, whose weights are the eigenvalues of
C D. One of these, u, is positive, the others are -v_i, and

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

ORDER: Final = 24  # which of the training bins OS compares with, from the weakest
MIN_COUNT: Final = 60  # of the k strongest bins
MIN_RANGE: Final = 2.5  # m; nearer the leakage is


class Detections(NamedTuple):
    """Targets in a spectrum, by direction and range; N of them.

    Attributes:
        rows: (N,) int64, the direction of each.
        bins: (N,) int64, the range bin.
        angles: (N,) rad, counter-clockwise from straight ahead.
        ranges: (N,) m.
        dbm: (N,) power in the bin, dBm.
        rcs_dbsm: (N,) cross section of a point in the middle of the beam that returns
            this power if nothing is in the way, dB over 1 m^2.
        snr_db: (N,) power in the bin over the mean noise there, dB.
        radial_velocity: (N,) m/s; see ``Spectrum``.
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
    """Return the strongest bins of each direction, (A, B); of equal ones the nearest.

    Args:
        counts: (A, B).
        most: How many in each direction.
        allowed: (B,) which bins may be taken, after the strongest are chosen.
        least: Smallest count that is taken.

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
    """Return the strongest bin of each run of bins that are set, (A, B)."""
    peaks = np.zeros(mask.shape, np.bool_)
    engine.find_peaks(mask, power, peaks)
    return peaks


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
def training_correlation(
    settings: FmcwSettings, training: Training
) -> tuple[float, ...]:
    """Return the correlation of the noise's field by the distance of bins."""
    half = training.bins // 2
    farthest = training.guard + 1 + (half - 1) * training.step
    return (*noise_correlation(settings, np.arange(2.0 * farthest + 1)).tolist(),)


def ca_factor(count: int, pfa: float) -> float:
    """Return alpha of CA: by how much a bin must exceed the mean of its training bins.

    Args:
        count: N, of independent bins.
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
    """Return alpha of CA for bins that are not independent.

    Args:
        training: The training bins.
        sides: On how many sides of a bin they are, 1 or 2.
        pfa: Probability of a false alarm.
        correlation: Of the field of the noise, by the distance of bins.
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


def _root(log_pfa: Callable[[float], float], pfa: float) -> float:
    """Return where the logarithm of a falling probability has a value."""
    high = 1.0
    while log_pfa(high) > math.log(pfa):
        high *= 2
    return float(brentq(lambda x: log_pfa(x) - math.log(pfa), 0, high, xtol=1e-12))


LEVELS_PER_DB: Final = 8.0  # of the histogram of OS


def ca_mask(
    power: NDArray[np.float32],
    training: Training,
    pfa: float,
    correlation: tuple[float, ...] | None = None,
) -> Mask:
    """Return which bins exceed the mean of their training bins, (A, B).

    Near the first and the last bin only the training bins of one side count.

    Args:
        power: (A, B) power.
        training: Which bins a bin is compared with.
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
    """Return which bins exceed one of their training bins, by order of power, (A, B).

    Near the first and the last bin only the training bins of one side count, and of
    these the one that is as far from the weakest in proportion.

    Args:
        power: (A, B) power relative to the noise.
        training: Which bins a bin is compared with.
        pfa: Probability of a false alarm in a bin.
        order: Which training bin, counted from the weakest.
    """
    found = np.zeros(power.shape, np.bool_)
    # In steps of 1/8 dB, from -100 dB on, a histogram has the order at once.
    levels = np.log10(np.maximum(power, np.float32(1e-10)))
    levels *= np.float32(10 * LEVELS_PER_DB)
    levels += np.float32(100 * LEVELS_PER_DB)
    half, nearest = training.bins // 2, training.guard + 1
    count, farthest = power.shape[1], nearest + (half - 1) * training.step
    for span in (  # from bin to bin, with training bins behind, and ahead
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
