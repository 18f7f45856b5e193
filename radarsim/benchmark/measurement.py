"""Measuring on a machine that others use too: ratios in one process, not seconds.

What is compared runs in turns, so that both meet the same disturbances. Of each, the
fastest tenth of the runs counts: noise only ever adds time.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

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


# Section from study.benchrows.
# One figure of a benchmark, and how tables and programs are told about it.


@dataclass(frozen=True, slots=True)
class Row:
    """One measurement.

    Attributes:
        group: A letter that tells what kind of figure this is.
        name: What was measured.
        value: The figure.
        unit: ``x`` for a ratio, else ``ms``, ``us``, ``1/s``, ``MiB``, ``%``.
        limit: The most that it may be; None for a figure without a target.
        note: What else is to be known, in words.
    """

    group: str
    name: str
    value: float
    unit: str
    limit: float | None = None
    note: str = ""

    @property
    def within(self) -> bool | None:
        """Whether the figure keeps its limit; None without one."""
        return None if self.limit is None else self.value <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Give what JSON can hold."""
        return {**asdict(self), "within": self.within}


GROUPS = {
    "a": "a radar scan against one raw first-hit call on the same rays",
    "b": "all hits of the same rays by Open3D, against the radar scan",
    "c": "scans per second, and threads",
    "d": "what a scan costs as scenes, beams and robots grow",
    "e": "the server over loopback TCP",
    "f": "start-up, best of five",
    "g": "beams of many rays, against as many scans that draw one of these rays",
    "h": "mirrors, and leaves",
}
