"""Statistics of images of turning radars, as published ones were measured."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from radar_odometry import cen2018_peaks
from scipy.ndimage import label

BRIGHT: Final = 60  # counts
BANDS: Final = ((25, 50), (50, 75), (75, 99))  # m
RAISED: Final = 10  # counts over the middle direction
LEAKAGE_BINS: Final = 10
CEN2019_BINS: Final = 10_000  # the strongest, which make its regions


class FrameStatistics(NamedTuple):
    """Statistics of an image.

    Attributes:
        spread: Standard deviation of the medians of directions, counts.
        raised: Directions whose median is ``RAISED`` over the middle one.
        bright: Shares of bins over ``BRIGHT`` counts in each of ``BANDS``, %.
        leakage: Mean of the first bins, counts.
        percentile: The 99th, counts.
        cen2018: Keypoints by Cen and Newman, 2018.
        cen2019: Keypoints by Cen and Newman, 2019.
    """

    spread: float
    raised: int
    bright: tuple[float, ...]
    leakage: float
    percentile: float
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
    return FrameStatistics(
        float(medians.std()),
        int((medians > np.median(medians) + RAISED).sum()),
        bright,
        float(counts[:, :LEAKAGE_BINS].mean()),
        float(np.percentile(counts, 99)),
        cen2018_peaks(counts, smoothing=5, nearest=15),
        cen2019_peaks(counts),
    )


def cen2019_peaks(counts: NDArray[np.uint8], nearest: int = 15) -> int:
    """Count the keypoints of an image as a common front end does.

    The strongest bins, less where the image is steep, form regions along each
    direction; those with another one beside them in a neighbouring direction count.

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
    beside = np.roll(marked, 1, axis=0) | np.roll(marked, -1, axis=0)
    marked[:, :nearest] = False
    # Regions along a direction: neighbouring directions are not joined.
    regions, _ = label(marked, [[0, 0, 0], [1, 1, 1], [0, 0, 0]])
    return len(np.unique(regions[marked & beside]))
