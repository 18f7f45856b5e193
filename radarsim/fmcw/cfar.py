"""CA-CFAR and OS-CFAR: the bins that exceed the bins around them.

``cfar_thresholds`` tells with which bins one is compared, and by how much it has to
exceed them.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.fmcw.cfar_thresholds import Training, ca_factor, os_factor
from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline

LEVELS_PER_DB: Final = 8.0  # of the histogram of OS
_LEVELS: Final = 2048

Mask = NDArray[np.bool_]


def ca_mask(
    power: NDArray[np.float32],
    training: Training,
    pfa: float,
    correlation: Floats | None = None,
) -> Mask:
    """Return which bins exceed the mean of their training bins, (A, B).

    Near the first and the last bin only the training bins of one side count.

    Args:
        power: (A, B) power.
        training: Which bins a bin is compared with.
        pfa: Probability of a false alarm in a bin.
        correlation: As in ``ca_factor``.
    """
    half = training.bins // 2
    both = ca_factor(training.bins, pfa, correlation)
    factors = np.array([math.inf, ca_factor(half, pfa, correlation), both])
    found = np.zeros(power.shape, np.bool_)
    _find_ca(power, training.guard + 1, training.step, half, factors, found)
    return found


@njit_cached
def _find_ca(
    power: Any, nearest: Any, step: Any, half: Any, factors: Any, found: Any
) -> None:
    """Set ``found``; ``factors`` are by how many sides have training bins."""
    count = power.shape[1]
    farthest = nearest + (half - 1) * step
    # Sums over the training bins before each bin. Those after a bin are before one
    # that is this much farther on, which may be beyond the last.
    ahead = nearest + farthest
    sums = np.zeros(count + nearest)
    for row in range(len(power)):
        line = power[row]
        for i in range(farthest, min(farthest + step, len(sums))):
            sums[i] = 0.0
            for q in range(half):
                sums[i] += line[i - nearest - q * step]
        for i in range(farthest + step, len(sums)):
            sums[i] = sums[i - step] + line[i - nearest] - line[i - step - farthest]
        middle = min(farthest, count), max(count - farthest, 0)
        for i in range(min(middle)):
            found[row, i] = line[i] > factors[1] * (sums[i + ahead] / half)
        for i in range(middle[0], middle[1]):
            total = sums[i] + sums[i + ahead]
            found[row, i] = line[i] > factors[2] * (total / (2 * half))
        for i in range(max(middle), count):
            found[row, i] = line[i] > factors[1] * (sums[i] / half)


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
    middle = farthest, count - farthest
    for (start, end), behind, ahead in (
        ((0, min(farthest, count - farthest)), False, True),
        (middle, True, True),
        ((max(farthest, count - farthest), count), True, False),
    ):
        bins = half * (behind + ahead)
        which = max(order * bins // training.bins, 1)
        factor = 10 * LEVELS_PER_DB * math.log10(os_factor(bins, which, pfa))
        _find_os(
            *(levels, nearest, training.step, half),
            *(start, end, behind, ahead, which, np.float32(factor), found),
        )
    return found


@njit_cached
def _find_os(
    levels: Any,
    nearest: Any,
    step: Any,
    half: Any,
    start: Any,
    end: Any,
    behind: Any,
    ahead: Any,
    order: Any,
    above: Any,
    found: Any,
) -> None:
    """Set ``found`` where a level is by ``above`` over the ``order``-th around it.

    From a bin to the one a step farther on, two training bins change on each side. The
    histogram of their levels follows, and a pointer to the level of that order.
    """
    farthest = nearest + (half - 1) * step
    histogram = np.zeros(_LEVELS, np.int32)
    for row in range(len(levels)):
        line = levels[row]
        for first in range(start, min(start + step, end)):
            histogram[:] = 0
            for q in range(half):
                if behind:
                    _move(histogram, 0, line[first - nearest - q * step], 1)
                if ahead:
                    _move(histogram, 0, line[first + nearest + q * step], 1)
            current, below = 0, 0
            for i in range(first, end, step):
                last = i - step
                if behind and i > first:
                    below += _move(histogram, current, line[last - farthest], -1)
                    below += _move(histogram, current, line[i - nearest], 1)
                if ahead and i > first:
                    below += _move(histogram, current, line[last + nearest], -1)
                    below += _move(histogram, current, line[i + farthest], 1)
                current, below = _seek(histogram, current, below, order)
                # On average the training bin was in the middle of its level.
                found[row, i] = line[i] > current + np.float32(0.5) + above


@njit_inline
def _seek(histogram: Any, current: Any, below: Any, order: Any) -> Any:
    """Return the level of an order, and how many are below it."""
    while below + histogram[current] < order:
        below += histogram[current]
        current += 1
    while below >= order:
        current -= 1
        below -= histogram[current]
    return current, below


@njit_inline
def _move(histogram: Any, current: Any, value: Any, change: Any) -> Any:
    """Change a level's count; return by how much the number below ``current`` does."""
    level = min(max(int(value), 0), _LEVELS - 1)
    histogram[level] += change
    return change if level < current else 0
