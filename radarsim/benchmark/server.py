"""Benchmarks of the running server: groups e and f of the table."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from radarsim.benchmark.clients import listen, spawn
from radarsim.benchmark.timing import BenchmarkRow

PROGRAM = (sys.executable, "-m", "radarsim")
ROBOTS = 100
MAX_P99 = 20.0  # ms late
MAX_HELP_SECONDS, MAX_SERVE_SECONDS = 0.5, 1.5  # s


def lateness(robots: int, seconds: float) -> Iterator[BenchmarkRow]:
    """Measure how late the scans of many robots arrive at a client.

    The lateness of a scan is its delay from simulated time to arrival, less the
    smallest delay of the run.
    """
    with served("empty_room") as (process, address):
        before = _resident_bytes(process.pid)
        sockets = [spawn(address, i) for i in range(robots)]
        listen(sockets, 1.0)  # robots have spawned and settled
        started, used = time.monotonic(), _cpu_seconds(process.pid)
        delays = listen(sockets, seconds)
        used, elapsed = _cpu_seconds(process.pid) - used, time.monotonic() - started
        grown = _resident_bytes(process.pid) - before
        for sock in sockets:
            sock.close()
    late = (np.array(delays) - min(delays)) * 1e3
    name = f"{robots} robots at 10 Hz, 181 beams"
    rate = len(delays) / robots / elapsed
    yield BenchmarkRow("e", f"{name}: scans per second and robot", rate, "1/s")
    yield BenchmarkRow("e", f"{name}: late, median", float(np.median(late)), "ms")
    p99 = float(np.quantile(late, 0.99))
    limit = MAX_P99 if robots == ROBOTS else None
    yield BenchmarkRow("e", f"{name}: late, 99th percentile", p99, "ms", limit)
    yield BenchmarkRow("e", f"{name}: late, worst", float(late.max()), "ms")
    yield BenchmarkRow(
        "e", f"{name}: CPU per robot", 100 * used / elapsed / robots, "%"
    )
    yield BenchmarkRow("e", f"{name}: memory per robot", grown / robots / 2**20, "MiB")


def start_up(times: int = 5) -> Iterator[BenchmarkRow]:
    """Measure the start-up time of the program, the best of a few runs."""
    help_ = min(_help_seconds() for _ in range(times))
    yield BenchmarkRow(
        "f", "radarsim --help", help_ * 1e3, "ms", MAX_HELP_SECONDS * 1e3
    )
    listening = min(_serve_seconds() for _ in range(times))
    limit = MAX_SERVE_SECONDS * 1e3
    yield BenchmarkRow(
        "f", "serve foliage_room, listening", listening * 1e3, "ms", limit
    )


@contextmanager
def served(map_: str) -> Iterator[tuple[subprocess.Popen[str], tuple[str, int]]]:
    """Run the server in its own process, on a free port."""
    process = subprocess.Popen(
        [*PROGRAM, "serve", map_, "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        host, port = process.stdout.readline().split()[-1].rsplit(":", 1)
        yield process, (host, int(port))
    finally:
        process.send_signal(signal.SIGTERM)
        process.stdout.close()
        process.wait(timeout=10)


def _help_seconds() -> float:
    start = time.perf_counter()
    subprocess.run([*PROGRAM, "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


def _serve_seconds() -> float:
    start = time.perf_counter()
    with served("foliage_room"):
        return time.perf_counter() - start


def _cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_bytes(pid: int) -> int:
    """Return the resident memory of a process, bytes."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
