"""Estimates with intervals of 95 %.

Shares have Wilson's score interval (Wilson 1927), which also holds for few runs and for
shares of 0 and 1. Means have Student's t interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import special

CONFIDENCE: Final = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate.

    Attributes:
        value: The share, or the mean.
        low: Lower end of its interval; the value itself where there is none.
        high: Upper end, likewise.
        count: Number of runs.
    """

    value: float
    low: float
    high: float
    count: int

    @property
    def has_interval(self) -> bool:
        """Whether there is an interval: there is none of a single run."""
        return self.count > 1

    @property
    def is_exact(self) -> bool:
        """Whether there is no interval to tell: a single run, or all values equal."""
        return self.low == self.high

    def within(self, least: float, most: float) -> "Estimate":
        """Return the estimate with its interval cut to the values that are possible."""
        return replace(self, low=max(self.low, least), high=min(self.high, most))


def share(successes: int, count: int) -> Estimate:
    """Estimate a share, with Wilson's score interval.

    Args:
        successes: Number of runs that have a property.
        count: Number of all runs, at least 1; of a single one there is no interval.

    >>> estimate = share(10, 10)
    >>> round(estimate.low, 4), round(estimate.high, 4)
    (0.7225, 1.0)
    """
    p = successes / count
    if count < 2:
        return Estimate(p, p, p, count)
    z = float(special.ndtri((1 + CONFIDENCE) / 2))
    scale = 1 + z**2 / count
    centre = (p + z**2 / (2 * count)) / scale
    half = z / scale * math.sqrt(p * (1 - p) / count + z**2 / (4 * count**2))
    return Estimate(p, max(centre - half, 0.0), min(centre + half, 1.0), count)


def mean(values: Sequence[float]) -> Estimate:
    """Estimate a mean, with Student's t interval.

    Args:
        values: At least one. If all are equal, or there is only one, both ends of the
            interval are the value itself.
    """
    count, value = len(values), float(np.mean(values))
    if min(values) == max(values):
        # The value itself: the mean of equal values can differ from them in the last
        # digit.
        return Estimate(values[0], values[0], values[0], count)
    error = float(np.std(values, ddof=1)) / math.sqrt(count)
    half = float(special.stdtrit(count - 1, (1 + CONFIDENCE) / 2)) * error
    return Estimate(value, value - half, value + half, count)
