"""Benchmarks of the running server: groups e and f of the table."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.lab.bench.clients import SCAN, spawn
from radarsim.lab.bench.robots import write_hall
from radarsim.lab.bench.timing import BenchmarkRow

PROGRAM = (sys.executable, "-m", "radarsim")
DRIVERS = (sys.executable, "-m", "radarsim.lab.bench.driving_clients")
ROBOTS = 200
SWARMS: Final = (100, 200, 300, 400, 600, 800, 1000)  # numbers of robots, ascending
MAX_P99 = 20.0  # ms late
MIN_RATE = 9.8  # scans per second of a robot; fewer come if simulated time waits
MAX_HELP_SECONDS, MAX_SERVE_SECONDS = 0.5, 1.5  # s
MAX_COLD_RATIO = 1.3  # of the time until a server listens that has to compile first
MAX_COMPILE_SECONDS = 600.0

# Connects clients until there are so many robots; returns the delays of all scans that
# come in so many seconds, s.
Drive: TypeAlias = Callable[[int, float], Floats]


def lateness(robots: int, seconds: float) -> Iterator[BenchmarkRow]:
    """Measure how late the scans of many driving robots arrive at a client.

    The lateness of a scan is its delay from simulated time to arrival, less the
    smallest delay of the run. The clients are in a process of their own.
    """
    with served_hall() as (process, _, drive):
        before = _resident_bytes(process.pid)
        drive(robots, 1.0)
        started, used = time.monotonic(), cpu_seconds(process.pid)
        late = lateness_of(drive(robots, seconds))
        used, elapsed = cpu_seconds(process.pid) - used, time.monotonic() - started
        grown = _resident_bytes(process.pid) - before
    name = f"{robots} robots at 10 Hz, 181 beams"
    rate = len(late) / robots / seconds
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


def capacity(seconds: float, swarms: Sequence[int] = SWARMS) -> Iterator[BenchmarkRow]:
    """Measure how many driving robots the server simulates in time.

    Robots are added until simulated time waits, or the 99th percentile of lateness
    exceeds its limit.
    """
    most, note = 0, ""
    with served_hall() as (_, _, drive):
        for robots in swarms:
            late = lateness_of(drive(robots, seconds))
            rate = len(late) / robots / seconds
            p99 = float(np.quantile(late, 0.99)) if len(late) else np.inf
            note = f"of {robots} robots {rate:.1f} scans a second, 99 % less than"
            note += f" {p99:.1f} ms late"
            if rate < MIN_RATE or p99 > MAX_P99:
                break
            most = robots
    yield BenchmarkRow(
        "e", "robots that this machine holds", most, "robots", None, note
    )


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


def cold_start(times: int = 2) -> Iterator[BenchmarkRow]:
    """Measure a server that has nothing compiled, against one that has everything."""
    warm = min(_serve_seconds() for _ in range(times))
    cold, first_scan = zip(*(_cold_seconds() for _ in range(times)), strict=True)
    name = "serve foliage_room, nothing compiled"
    note = f"{min(cold) * 1e3:.0f} ms against {warm * 1e3:.0f}"
    yield BenchmarkRow(
        "f",
        f"{name}: listening, by compiled",
        min(cold) / warm,
        "x",
        MAX_COLD_RATIO,
        note,
    )
    yield BenchmarkRow("f", f"{name}: first scan", min(first_scan) * 1e3, "ms")


@contextmanager
def served(
    map_: str, *options: str, cache: Path | None = None, loaded: bool = True
) -> Iterator[tuple[subprocess.Popen[str], tuple[str, int]]]:
    """Run the server in its own process, on a free port.

    Args:
        map_: Name of a map, or path of a map file.
        options: Other options of the server.
        cache: Folder of what is compiled; None for the user's.
        loaded: Whether to wait until the server has loaded its engine.
    """
    environment = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    process = subprocess.Popen(
        [*PROGRAM, "serve", map_, "--port", "0", *options],
        stdout=subprocess.PIPE,
        stderr=None if cache is None else subprocess.DEVNULL,
        text=True,
        env={**os.environ, **environment},
    )
    assert process.stdout is not None
    try:
        host, port = process.stdout.readline().split()[-1].rsplit(":", 1)
        address = host, int(port)
        if loaded:
            with spawn(address, 0) as client:
                _wait_for_scan(client)
        yield process, address
    finally:
        process.send_signal(signal.SIGTERM)
        process.stdout.close()
        process.wait(timeout=MAX_COMPILE_SECONDS)


@contextmanager
def served_hall(
    *options: str,
) -> Iterator[tuple[subprocess.Popen[str], tuple[str, int], Drive]]:
    """Serve the hall, with clients in another process.

    Args:
        options: Other options of the server.
    """
    pipe = subprocess.PIPE
    with (
        tempfile.TemporaryDirectory() as folder,
        served(str(write_hall(Path(folder))), *options) as (process, (host, port)),
        subprocess.Popen(
            [*DRIVERS, host, str(port)], stdin=pipe, stdout=pipe, text=True
        ) as clients,
    ):

        def drive(robots: int, seconds: float) -> Floats:
            assert clients.stdin is not None
            assert clients.stdout is not None
            clients.stdin.write(f"{robots} {seconds}\n")
            clients.stdin.flush()
            return np.array(json.loads(clients.stdout.readline()), np.float64)

        try:
            yield process, (host, port), drive
        finally:
            clients.kill()


def lateness_of(delays: Floats) -> Floats:
    """Return by how much delays exceed the smallest of them, ms."""
    late: Floats = (delays - delays.min(initial=np.inf)) * 1e3
    return late


def _help_seconds() -> float:
    start = time.perf_counter()
    subprocess.run([*PROGRAM, "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


def _serve_seconds() -> float:
    start = time.perf_counter()
    with served("foliage_room", loaded=False):
        return time.perf_counter() - start


def _cold_seconds() -> tuple[float, float]:
    """Return the time until a server listens, and until the first scan comes, s."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        cache = Path(folder)
        with served("foliage_room", cache=cache, loaded=False) as (_, address):
            listening = time.perf_counter() - start
            with spawn(address, 0) as client:
                _wait_for_scan(client)
                return listening, time.perf_counter() - start


def _wait_for_scan(client: socket.socket) -> None:
    """Read until a scan comes.

    Raises:
        TimeoutError: If nothing comes for too long.
        ConnectionError: If the server closes the connection.
    """
    client.settimeout(MAX_COMPILE_SECONDS)
    received = b""
    while not SCAN.search(received):
        data = client.recv(65536)
        if not data:
            raise ConnectionError("the server closed the connection, expected a scan")
        received = received[-100:] + data


def cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_bytes(pid: int) -> int:
    """Return the resident memory of a process, bytes."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
