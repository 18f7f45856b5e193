"""Benchmarks of the running server: groups e, f and i of the table."""

import os
import re
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from radarsim.benchmark.timing import BenchmarkRow
from radarsim.host import Host
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene

PROGRAM = (sys.executable, "-m", "radarsim")
ROBOTS = 100
MAX_P99 = 20.0  # ms late
MAX_HELP_SECONDS, MAX_SERVE_SECONDS = 0.5, 1.5  # s
SCAN = re.compile(rb"SEN \{Time ([0-9.]+)\} \{Type RangeScanner\}")


def lateness(robots: int, seconds: float) -> Iterator[BenchmarkRow]:
    """Measure how late the scans of many robots arrive at a client.

    The lateness of a scan is its delay from simulated time to arrival, less the
    smallest delay of the run.
    """
    with served("empty_room") as (process, address):
        before = _resident_bytes(process.pid)
        sockets = [_spawn(address, i) for i in range(robots)]
        _listen(sockets, 1.0)  # robots have spawned and settled
        started, used = time.monotonic(), _cpu_seconds(process.pid)
        delays = _listen(sockets, seconds)
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


FLOODS = {
    "10 clients that repeat GETCONF": (10, b"GETCONF {Type RangeScanner}"),
    "40 clients that repeat GETCONF": (40, b"GETCONF {Type RangeScanner}"),
    "40 clients that ask for scans": (
        40,
        b"SET {Type RangeScanner} {Name lms200} {Opcode SCAN}",
    ),
    "200 clients that repeat GETSTARTPOSES": (200, b"GETSTARTPOSES"),
}
MAX_FLOOD_MS = 5.0  # ms of CPU that floods may add to a tick


def floods(ticks: int) -> Iterator[BenchmarkRow]:
    """Measure what clients that flood the server add to the CPU time of a tick.

    Two hosts in this process, with and without the flood, tick in turns.

    Args:
        ticks: Number of ticks to average over.
    """
    scene = load_map("empty_room")
    for name, (count, line) in FLOODS.items():
        robots = min(count, ROBOTS) if line != b"GETSTARTPOSES" else 0
        hosts = [_host_with_clients(scene, count, robots) for _ in range(2)]
        spent = [0.0, 0.0]
        for _ in range(ticks):
            for index, (host, flood) in enumerate(zip(hosts, (line, b""), strict=True)):
                spent[index] += _tick_seconds(host, count, (flood + b"\r\n") * 100)
        added = (spent[0] - spent[1]) / ticks * 1e3
        yield BenchmarkRow(
            "i", f"{name}: CPU added to a tick", added, "ms", MAX_FLOOD_MS
        )


def _host_with_clients(scene: Scene, count: int, robots: int) -> Host:
    """Return a host whose clients have numbers from 1; the first ones have robots."""
    host = Host(scene)
    for number in range(1, count + 1):
        host.connect()
        if number <= robots:
            row, column = divmod(number - 1, 20)
            place = f"{{Location {-9 + 0.95 * column:.2f},{row - 5:.2f},0}}"
            host.receive(number, f"INIT {{ClassName P3AT}} {place}\r\n".encode())
            host.step()
    for _ in range(200):  # robots have settled
        _tick_seconds(host, count, b"")
    return host


def _tick_seconds(host: Host, clients: int, data: bytes) -> float:
    """Return the CPU time of a tick in which all clients send as much as they may."""
    start = time.process_time()
    for number in range(1, clients + 1):
        if not host.is_busy(number):
            host.receive(number, data)
    host.step()
    elapsed = time.process_time() - start
    for number in range(1, clients + 1):
        host.take(number)
    return elapsed


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


def _spawn(address: tuple[str, int], number: int) -> socket.socket:
    sock = socket.create_connection(address, timeout=10)
    row, column = divmod(number, 20)
    place = f"{-9 + 0.95 * column:.2f},{-5 + 1.0 * row:.2f},0"
    init = (
        f"INIT {{ClassName USARBot.P3AT}} {{Name R{number}}} {{Location {place}}}\r\n"
    )
    sock.sendall(init.encode())
    sock.setblocking(False)
    return sock


def _listen(sockets: list[socket.socket], seconds: float) -> list[float]:
    """Read from all sockets for a while; return the delay of each scan, s."""
    delays = []
    with selectors.DefaultSelector() as selector:
        for sock in sockets:
            selector.register(sock, selectors.EVENT_READ)
        end = time.monotonic() + seconds
        while (now := time.monotonic()) < end:
            for key, _ in selector.select(end - now):
                data = key.fileobj.recv(65536)  # type: ignore[union-attr]
                arrived = time.monotonic()
                delays += [arrived - float(text) for text in SCAN.findall(data)]
    return delays


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
