"""All benchmarks, one after the other."""

from collections.abc import Callable, Iterator
from typing import Final

from radarsim.benchmark.engine import (
    against_open3d,
    beams_against_rays,
    growth,
    mirrors_and_leaves,
    scans_against_first_hits,
    throughput,
)
from radarsim.benchmark.measurement import Row
from radarsim.benchmark.server import ROBOTS, lateness, start_up

# Each with the seconds that it is given, and its share of the whole.
STEPS: Final[dict[str, tuple[Callable[[], Iterator[Row]], int]]] = {
    "engine": (lambda: scans_against_first_hits(2.0), 6),
    "Open3D": (lambda: against_open3d(1.0), 1),
    "throughput": (lambda: throughput(2.0), 2),
    "growth": (lambda: growth(0.4), 18),
    "beams": (lambda: beams_against_rays(1.0), 5),
    "surfaces": (lambda: mirrors_and_leaves(1.0), 2),
    "server": (lambda: lateness(ROBOTS, 10.0), 6),
    "start-up": (start_up, 2),
}


def run_all(tell: Callable[[str, int, int], None]) -> list[Row]:
    """Measure everything; takes up to two minutes.

    Args:
        tell: Told what comes next, how much is done, and how much there is.
    """
    rows: list[Row] = []
    done, whole = 0, sum(share for _, share in STEPS.values())
    for name, (step, share) in STEPS.items():
        tell(name, done, whole)
        for count, row in enumerate(step(), start=1):
            rows.append(row)
            tell(name, done + min(count, share), whole)
        done += share
    tell("done", whole, whole)
    return rows
