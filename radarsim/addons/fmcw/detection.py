"""Detectors of targets in a spectrum: CA-CFAR, OS-CFAR, and the k strongest bins.

Source for the k strongest bins: D. Adolfsson and others, "CFEAR radarodometry", IROS
2021. For the others see ``cfar_thresholds``.
"""

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.cfar import (
    Mask,
    ca_mask,
    os_mask,
    training_correlation,
    training_of,
)
from radarsim.addons.fmcw.radar_equation import dbm_of
from radarsim.geometry import Floats
from radarsim.jit import njit_cached

if TYPE_CHECKING:
    from radarsim.addons.fmcw.spectrum import Spectrum

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
    """

    rows: NDArray[np.int64]
    bins: NDArray[np.int64]
    angles: Floats
    ranges: Floats
    dbm: Floats


def detect(
    spectrum: "Spectrum", detector: str, *, pfa: float, count: int
) -> Detections:
    """Detect targets; see ``Spectrum.detections``.

    Raises:
        ValueError: If there is no such detector, or a number is out of range.
    """
    if detector == "k":
        mask = strongest_mask(
            spectrum.counts, count, spectrum.ranges >= MIN_RANGE, MIN_COUNT
        )
    elif detector in DETECTORS:
        training = training_of(spectrum.settings)
        power = spectrum.power / spectrum.noise_floor
        if detector == "ca":
            correlation = training_correlation(spectrum.settings, training)
            mask = ca_mask(power, training, pfa, correlation)
        else:
            mask = os_mask(power, training, pfa, ORDER)
        mask = peaks_of(mask & (spectrum.ranges >= MIN_RANGE), power)
    else:
        raise ValueError(f"detector {detector!r}, expected one of {DETECTORS}")
    rows, bins = np.nonzero(mask)
    dbm = dbm_of(spectrum.power[rows, bins])
    angles, ranges = spectrum.angles[rows], spectrum.ranges[bins]
    return Detections(rows, bins, angles, ranges, dbm)


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
    _find_peaks(mask, power, peaks)
    return peaks


@njit_cached
def _find_peaks(mask: Any, power: Any, peaks: Any) -> None:
    for row in range(len(mask)):
        best = -1
        for i in range(mask.shape[1]):
            if not mask[row, i]:
                best = -1
            elif best < 0 or power[row, i] > power[row, best]:
                if best >= 0:
                    peaks[row, best] = False
                peaks[row, i] = True
                best = i
