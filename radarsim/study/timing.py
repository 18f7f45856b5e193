"""Measuring on a machine that others use too: ratios in one process, not seconds.

What is compared runs in turns, so that both meet the same disturbances. Of each, the
fastest tenth of the runs counts: noise only ever adds time.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LEAST_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two things measured in turns.

    Attributes:
        subject: s for one run of what is judged.
        reference: s for one run of what it is measured by.
    """

    subject: float
    reference: float

    @property
    def ratio(self) -> float:
        """How many times as long the subject takes."""
        return self.subject / self.reference


def compare(
    subject: Callable[[], object], reference: Callable[[], object], *, seconds: float
) -> Comparison:
    """Run two things in turns.

    Args:
        subject: What is judged.
        reference: What it is measured by.
        seconds: How long to go on; at least a few rounds are made.
    """
    subject(), reference()
    times: tuple[list[float], list[float]] = ([], [])
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times[0]) < LEAST_ROUNDS:
        for run, found in zip((subject, reference), times, strict=True):
            start = time.perf_counter()
            run()
            found.append(time.perf_counter() - start)
    return Comparison(_fast(times[0]), _fast(times[1]))


def measure(run: Callable[[], object], *, seconds: float) -> float:
    """Give the time of one run, s."""
    run()
    times: list[float] = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < LEAST_ROUNDS:
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return _fast(times)


def _fast(times: list[float]) -> float:
    return float(np.quantile(times, 0.1))
