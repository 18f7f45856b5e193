"""The whole benchmark: all measurements, one after the other."""

from collections.abc import Callable, Iterator
from typing import Final

from radarsim.lab.bench.addons import (
    commander_beside_robots,
    decisions,
    recording_robots,
    turning_radar,
    turns_of_a_radar,
)
from radarsim.lab.bench.engine import (
    RINGS,
    against_open3d,
    beams_against_rays,
    growth,
    many_poses,
    mesh_maps,
    mirrors_and_leaves,
    scans_against_first_hits,
    throughput,
)
from radarsim.lab.bench.robots import decoding, driving_robots, growth_of_robots
from radarsim.lab.bench.server import (
    FLOODS,
    ROBOTS,
    SWARMS,
    capacity,
    cold_start,
    floods,
    lateness,
    lateness_beside_floods,
    start_up,
)
from radarsim.lab.bench.timing import BenchmarkRow

# The function of each step, and its share of the progress bar.
STEPS: Final[dict[str, tuple[Callable[[], Iterator[BenchmarkRow]], int]]] = {
    "engine": (lambda: scans_against_first_hits(2.0), 6),
    "Open3D": (lambda: against_open3d(1.0), 1),
    "throughput": (lambda: throughput(2.0), 2),
    "poses": (lambda: many_poses(2.0), 1),
    "growth": (lambda: growth(0.4), 13),
    "beams": (lambda: beams_against_rays(1.0), 5),
    "surfaces": (lambda: mirrors_and_leaves(1.0), 2),
    "turns": (lambda: turns_of_a_radar(4.0), 1),
    "robots": (lambda: driving_robots(2.0), 2),
    "more robots": (lambda: growth_of_robots(2.0), 3),
    "clients": (lambda: decoding(2.0), 1),
    "server": (lambda: lateness(ROBOTS, 10.0), 6),
    "capacity": (lambda: capacity(2.0), len(SWARMS)),
    "floods": (lambda: floods(200), len(FLOODS)),
    "lateness": (lambda: lateness_beside_floods(3, 1.0), 2 * len(FLOODS)),
    "commander": (lambda: commander_beside_robots(10.0), 5),
    "recording": (lambda: recording_robots(10.0), 7),
    "radar": (lambda: turning_radar(10.0), 3),
    "learning": (lambda: decisions(2.0), 3),
    "meshes": (lambda: mesh_maps(RINGS, 5.0), 2),
    "start-up": (start_up, 2),
    "cold start": (cold_start, 6),
}


def run_all(report_progress: Callable[[str, int, int], None]) -> list[BenchmarkRow]:
    """Measure everything; takes a few minutes.

    Args:
        report_progress: Called with the name of the next step, the work done and the
            total work.
    """
    rows: list[BenchmarkRow] = []
    done, total = 0, sum(share for _, share in STEPS.values())
    for name, (step, share) in STEPS.items():
        report_progress(name, done, total)
        for count, row in enumerate(step(), start=1):
            rows.append(row)
            # A step may have more rows than its share; the bar must not run ahead.
            report_progress(name, done + min(count, share), total)
        done += share
    report_progress("done", total, total)
    return rows
