"""Time measurement on shared, noisy machines.

Two functions that are compared run in turns, so that both meet the same disturbances.
The result is the 10 % quantile of the times of each, because noise only adds time.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

MIN_ROUNDS = 5


class Row(NamedTuple):
    """One line of the printed table."""

    group: str  # letter of the group, which comments in the package cite
    name: str
    value: float
    unit: str  # x for a ratio
    limit: float | None = None  # upper limit of the value
    note: str = ""

    def __str__(self) -> str:
        """Return the row as a line of text."""
        line = f"{self.group}  {self.name}: {self.value:.4g} {self.unit}"
        if self.limit is not None:
            kept = "kept" if self.value <= self.limit else "MISSED"
            line += f", at most {self.limit:g} ({kept})"
        return f"{line}; {self.note}" if self.note else line


def compare(
    subject: Callable[[], object],
    reference: Callable[[], object],
    *,
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Return the times of two functions that run in turns, s.

    Args:
        subject: Function to measure.
        reference: Function to compare with.
        seconds: Duration of the measurement; both run ``MIN_ROUNDS`` times at least.
        clock: Returns the time that is measured, s.
    """
    # Once without a clock: first calls fill caches.
    subject(), reference()
    times: tuple[list[float], list[float]] = ([], [])
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times[0]) < MIN_ROUNDS:
        for run, elapsed in zip((subject, reference), times, strict=True):
            start = clock()
            run()
            elapsed.append(clock() - start)
    return float(np.quantile(times[0], 0.1)), float(np.quantile(times[1], 0.1))


def measure(run: Callable[[], object], *, seconds: float) -> float:
    """Return the time of one run of a function, s."""
    return compare(run, lambda: None, seconds=seconds)[0]


def ratio_row(
    group: str, name: str, times: tuple[float, float], limit: float | None = None
) -> Row:
    """Return the row of a ratio of two times."""
    subject, reference = times
    note = f"{subject * 1e6:.0f} us against {reference * 1e6:.0f}"
    return Row(group, name, subject / reference, "x", limit, note)
