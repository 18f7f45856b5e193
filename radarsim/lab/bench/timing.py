"""Time measurement on shared, noisy machines, and the rows of the benchmark's table.

Two functions that are compared run in turns, so that both meet the same disturbances.
The result is the 10 % quantile of the times of each, because noise only adds time.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

MIN_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Comparison:
    """Times of two functions that were measured in turns.

    Attributes:
        subject: Time of one run of the measured function, s.
        reference: Time of one run of the function that it is compared with, s.
    """

    subject: float
    reference: float

    @property
    def ratio(self) -> float:
        """Time of the subject in units of the reference's time."""
        return self.subject / self.reference

    @property
    def in_us(self) -> str:
        """Both times in words."""
        return f"{self.subject * 1e6:.0f} us against {self.reference * 1e6:.0f}"


def compare(
    subject: Callable[[], object],
    reference: Callable[[], object],
    *,
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> Comparison:
    """Measure two functions in turns.

    Args:
        subject: Function to measure.
        reference: Function to compare with.
        seconds: Duration of the measurement; both run ``MIN_ROUNDS`` times at least.
        clock: Returns the time that is measured, s: of the wall clock, or that which
            this thread had a processor for.
    """
    # Once without a clock: first calls compile, and fill caches.
    subject(), reference()
    times: tuple[list[float], list[float]] = ([], [])
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times[0]) < MIN_ROUNDS:
        for run, elapsed in zip((subject, reference), times, strict=True):
            start = clock()
            run()
            elapsed.append(clock() - start)
    return Comparison(_fast(times[0]), _fast(times[1]))


def measure(run: Callable[[], object], *, seconds: float) -> float:
    """Return the time of one run of a function, s."""
    run()
    times: list[float] = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < MIN_ROUNDS:
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return _fast(times)


def _fast(times: list[float]) -> float:
    # Not the smallest, a single value; others are made longer by what else runs.
    return float(np.quantile(times, 0.1))


@dataclass(frozen=True, slots=True)
class BenchmarkRow:
    """One result of the benchmark.

    Attributes:
        group: Letter of the group, a key of ``GROUPS``.
        name: Name of the measurement within its group.
        value: Result, in ``unit``.
        unit: ``x`` for a ratio, else ``ms``, ``us``, ``1/s``, ``MiB``, ``%``, or
            ``robots``.
        limit: Upper limit of the value; None if there is no target.
        note: Further facts, such as the two times of a ratio.
    """

    group: str
    name: str
    value: float
    unit: str
    limit: float | None = None
    note: str = ""

    @property
    def within(self) -> bool | None:
        """Whether the value keeps its limit; None if there is no limit."""
        return None if self.limit is None else self.value <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return the row as values that JSON can hold."""
        return {**asdict(self), "within": self.within}


GROUPS = {
    "a": "a radar scan against one raw first-hit call on as many rays, drawn alike",
    "b": "all hits of the same rays by Open3D, against the radar scan",
    "c": "scans per second, and threads",
    "d": "what a scan costs as scenes and beams grow",
    "e": "the server over loopback TCP",
    "f": "start-up, best of five",
    "g": "beams of many rays, against as many scans that draw one of these rays",
    "h": "mirrors, and leaves",
    "i": "clients that flood the server: CPU time of a tick, lateness beside them",
    "j": "many driving robots, Host.step and take",
    "k": "a map of one closed mesh, made ready for rays, against trimesh and embreex",
    "l": "viewers of the commander, beside robots of other clients",
    "m": "recording a server",
    "n": "environments for reinforcement learning, processor time",
    "o": "a radar that turns, beside plain robots of other clients",
    "p": "a turn of an FMCW radar, against tracing its rays and an FFT per direction",
    "q": "what a client receives, against float() of each range in it",
}
