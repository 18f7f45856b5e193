"""Statistics of images of turning radars, as published ones were measured."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from radar_odometry import cen2018_peaks
from scipy import stats
from scipy.ndimage import label, uniform_filter

BRIGHT: Final = 60  # counts
BANDS: Final = ((6, 12), (12, 25), (25, 50), (50, 75), (75, 99))  # m
STRONG: Final = 90  # counts
DARK: Final = 30
BEHIND: Final = (5, 30)  # bins behind a strong one
LEAKAGE_BINS: Final = 10
CEN2019_BINS: Final = 10_000  # the strongest, which make its regions


class FrameStatistics(NamedTuple):
    """Statistics of an image.

    Attributes:
        spread: Standard deviation of the medians of directions, counts.
        bright: Shares of bins over ``BRIGHT`` counts in each of ``BANDS``, %.
        leakage: Mean of the first bins, counts.
        percentiles: The 99th, the 99.9th and the last, counts.
        even: Share of even ground: 11 x 11 bins of 28 to 60 counts on average, whose
            deviation is below 11.5, %.
        dark: Share of bins below ``DARK`` counts at 10 to 60 m, %.
        dark_behind: Likewise of those that are ``BEHIND`` bins over ``STRONG``.
        correlation: Of bins five apart in range, at 25 to 60 m.
        kurtosis: Of differences of neighbouring bins.
        cen2018: Keypoints by Cen and Newman, 2018.
        cen2019: Keypoints by Cen and Newman, 2019.
    """

    spread: float
    bright: tuple[float, ...]
    leakage: float
    percentiles: tuple[float, ...]
    even: float
    dark: float
    dark_behind: float
    correlation: float
    kurtosis: float
    cen2018: int
    cen2019: int


def statistics_of(counts: NDArray[np.uint8], bin_size: float) -> FrameStatistics:
    """Return the statistics of an image, (A, B)."""
    medians = np.median(counts, axis=1)
    ranges = np.arange(counts.shape[1]) * bin_size
    bright = tuple(
        100 * float((counts[:, (ranges >= low) & (ranges < high)] > BRIGHT).mean())
        for low, high in BANDS
    )
    behind = np.zeros(counts.shape, np.bool_)
    for lag in range(*BEHIND):
        behind[:, lag:] |= counts[:, :-lag] > STRONG
    between = (ranges >= 10) & (ranges < 60)
    part = counts[:, (ranges >= 25) & (ranges < 60)].astype(np.float64)
    differences = np.diff(counts[:, 20:].astype(np.float64), axis=1)
    return FrameStatistics(
        float(medians.std()),
        bright,
        float(counts[:, :LEAKAGE_BINS].mean()),
        tuple(np.percentile(counts[:, 15:], (99, 99.9, 100)).tolist()),
        _even_ground(counts.astype(np.float64)),
        100 * float((counts[:, between] < DARK).mean()),
        100 * float((counts[behind & between] < DARK).mean()),
        float(np.corrcoef(part[:, 5:].ravel(), part[:, :-5].ravel())[0, 1]),
        float(stats.kurtosis(differences, axis=None, fisher=False)),
        cen2018_peaks(counts, smoothing=5, nearest=15),
        cen2019_peaks(counts),
    )


def _even_ground(counts: NDArray[np.float64]) -> float:
    mean = uniform_filter(counts, 11)
    variance = uniform_filter(counts**2, 11) - mean**2
    even = (mean > 28) & (mean < 60) & (variance < 11.5**2)
    return 100 * float((even & (np.arange(counts.shape[1]) >= 20)).mean())


def cen2019_peaks(counts: NDArray[np.uint8], nearest: int = 15) -> int:
    """Count the keypoints of an image as a common front end does.

    The strongest bins, less where the image is steep, form regions along each
    direction; those with another one next to them in a neighbouring direction count.

    Source: S. H. Cen and P. Newman, "Radar-only ego-motion estimation in difficult
    settings via graph matching", ICRA 2019, as public implementations have it.
    """
    image = counts.astype(np.float64)
    padded = np.pad(image, ((0, 0), (1, 1)), mode="reflect")
    steepness = np.abs(padded[:, 2:] - padded[:, :-2])
    strength = (image - image.mean()) * (1 - steepness / max(steepness.max(), 1e-9))
    order = np.argsort(-strength, axis=None, kind="stable")[:CEN2019_BINS]
    marked = np.zeros(image.shape, np.bool_)
    marked.flat[order] = strength.flat[order] > strength.mean()
    aside = np.roll(marked, 1, axis=0) | np.roll(marked, -1, axis=0)
    marked[:, :nearest] = False
    # Regions along a direction: neighbouring directions are not joined.
    regions, _ = label(marked, [[0, 0, 0], [1, 1, 1], [0, 0, 0]])
    return len(np.unique(regions[marked & aside]))
