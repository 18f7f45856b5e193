"""Benchmarks of the environments for reinforcement learning: group n of the table."""

import time
from collections.abc import Callable, Iterator
from typing import Final

from radarsim.lab.bench.timing import BenchmarkRow

ROBOTS: Final = 50
# Upper limits, us of processor time.
ALONE: Final = 1e6 / 400
AMONG_MANY: Final = 1e6 / 9000
RESET: Final = 2000.0


def decisions(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure the processor time of a decision, of 0.1 s and a scan of 181 beams.

    Args:
        seconds: Length of each measurement.
    """
    try:
        from radarsim.addons.gym import GoToEnv, VectorEnv  # noqa: PLC0415 - an extra
    except ImportError as error:
        yield BenchmarkRow("n", "needs Gymnasium", 0.0, "us", note=str(error))
        return
    alone, many = GoToEnv(), VectorEnv(ROBOTS)
    for env in (alone, many):
        env.reset(seed=1)
        env.action_space.seed(1)
    alone_us = _cpu_us(lambda: alone.step(alone.action_space.sample()), seconds)
    yield BenchmarkRow("n", "decision of one robot", alone_us, "us", ALONE)
    many_us = _cpu_us(lambda: many.step(many.action_space.sample()), seconds) / ROBOTS
    name = f"decision of one among {ROBOTS} robots"
    yield BenchmarkRow("n", name, many_us, "us", AMONG_MANY)
    yield BenchmarkRow(
        "n", "reset of one robot", _cpu_us(alone.reset, seconds), "us", RESET
    )


def _cpu_us(run: Callable[[], object], seconds: float) -> float:
    """Return the processor time of a function, us; not that of its first call."""
    run()
    runs, started = 0, time.process_time()
    while (used := time.process_time() - started) < seconds or not runs:
        run()
        runs += 1
    return used / runs * 1e6
