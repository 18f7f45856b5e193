"""Benchmark of recordings: group m of the table.

Clients drive robots in a hall. What counts is by how much they get their scans later
while the server records, what the process that writes costs, and how much it writes.
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.lab.bench.server import cpu_seconds, lateness_of, served_hall
from radarsim.lab.bench.timing import BenchmarkRow

ROBOTS: Final = 50
QUANTILES: Final = {"median": 0.5, "99th percentile": 0.99}


class _Usage(NamedTuple):
    """What a server and its children use."""

    late: Floats  # ms, one for each scan
    cpu: float  # of the server, s per s
    writer: float  # CPU of the process that writes, s per s
    written: float  # bytes per s


def recording_robots(seconds: float, robots: int = ROBOTS) -> Iterator[BenchmarkRow]:
    """Measure a server that records, and one before and one after that does not.

    Args:
        seconds: Length of each measurement.
        robots: Number of robots, each with a client.
    """
    before = _measure(robots, seconds, None)
    with tempfile.TemporaryDirectory() as folder:
        during = _measure(robots, seconds, Path(folder) / "run")
    after = _measure(robots, seconds, None)
    without = np.concatenate([before.late, after.late])
    name = f"{robots} robots that are recorded"
    for label, quantile in QUANTILES.items():
        note = f"{np.quantile(without, quantile):.1f} ms without"
        late = float(np.quantile(during.late, quantile))
        yield BenchmarkRow("m", f"{name}: late, {label}", late, "ms", note=note)
    work = (before.cpu + after.cpu) / 2
    note = f"{during.cpu:.3f} against {work:.3f} s per s"
    name = "CPU of a server that records, by that without"
    yield BenchmarkRow("m", name, during.cpu / work, "x", note=note)
    share = 100 * during.writer / robots
    yield BenchmarkRow("m", "CPU of the process that writes, per robot", share, "%")
    size = 60 * during.written / robots / 2**20
    yield BenchmarkRow("m", "written for a robot in a minute", size, "MiB")


def _measure(robots: int, seconds: float, folder: Path | None) -> _Usage:
    """Let robots drive on a server of their own.

    Args:
        robots: Number of robots.
        seconds: How long.
        folder: Folder to record in; None for no recording.
    """
    options = () if folder is None else ("--record", str(folder))
    with served_hall(*options) as (process, _, drive):
        drive(robots, 2.0)  # until all are connected
        writers = [] if folder is None else _children(process.pid)
        pids = [process.pid, *writers]
        started, used = time.monotonic(), list(map(cpu_seconds, pids))
        size = _size(folder)
        delays = drive(robots, seconds)
        elapsed = time.monotonic() - started
        cpu, *writer = [
            (cpu_seconds(pid) - before) / elapsed
            for pid, before in zip(pids, used, strict=True)
        ]
        written = (_size(folder) - size) / elapsed
    return _Usage(lateness_of(delays), cpu, sum(writer), written)


def _children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        if int(fields[1]) == pid:
            found.append(int(stat.parent.name))
    return found


def _size(folder: Path | None) -> int:
    """Return the size of the files in a folder, bytes."""
    return 0 if folder is None else sum(f.stat().st_size for f in folder.iterdir())
