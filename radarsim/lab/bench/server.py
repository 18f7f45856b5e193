"""Benchmarks of the running server: groups e, f and i of the table.

Group i tells what clients that flood the server cost others: in the CPU time of a tick,
of hosts in this process, and in the lateness of scans.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.lab.bench.clients import SCAN, init_line, listen, spawn
from radarsim.lab.bench.robots import write_hall
from radarsim.lab.bench.timing import BenchmarkRow
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

PROGRAM = (sys.executable, "-m", "radarsim")
CLIENTS = (sys.executable, "-m", "radarsim.lab.bench.clients")
QUANTILES: Final = {"median": 0.5, "99th percentile": 0.99}
ROBOTS = 200
SWARMS: Final = (100, 200, 300, 400, 600, 800, 1000)  # numbers of robots, ascending
MAX_P99 = 20.0  # ms late
MIN_RATE = 9.8  # scans per second of a robot; fewer come if simulated time waits
MAX_HELP_SECONDS, MAX_SERVE_SECONDS = 0.5, 1.5  # s
MAX_COMPILE_SECONDS = 600.0

Flood: TypeAlias = tuple[int, bytes]

FLOODS: Final[Mapping[str, Flood]] = {
    "10 clients that repeat GETCONF": (10, b"GETCONF {Type RangeScanner}"),
    "40 clients that repeat GETCONF": (40, b"GETCONF {Type RangeScanner}"),
    "40 clients that ask for scans": (
        40,
        b"SET {Type RangeScanner} {Name lms200} {Opcode SCAN}",
    ),
    "200 clients that repeat GETSTARTPOSES": (200, b"GETSTARTPOSES"),
}
MOST_ROBOTS = 100  # of clients that flood
MAX_FLOOD_MS = 5.0  # ms of CPU that floods may add to a tick
BYSTANDERS: Final = 10  # robots of clients that do not flood
SETTLE_SECONDS = 0.7  # until robots have spawned, and the flood has its full strength

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
            # The rate as well: where simulated time waits, scans are few and need not
            # be late.
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
    """Measure a server that has nothing compiled."""
    listening, first_scan = zip(*(_cold_seconds() for _ in range(times)), strict=True)
    name = "serve foliage_room, nothing compiled"
    limit = MAX_SERVE_SECONDS * 1e3
    yield BenchmarkRow("f", f"{name}: listening", min(listening) * 1e3, "ms", limit)
    yield BenchmarkRow("f", f"{name}: first scan", min(first_scan) * 1e3, "ms")


def floods(ticks: int) -> Iterator[BenchmarkRow]:
    """Measure what clients that flood the server add to the CPU time of a tick.

    Two hosts in this process, with and without the flood, tick in turns.

    Args:
        ticks: Number of ticks to average over.
    """
    scene = load_map("empty_room")
    for name, (count, line) in FLOODS.items():
        robots = _robots_of(count, line)
        # In turns in one process, so that both meet the same disturbances of the
        # machine.
        hosts = [_host_with_clients(scene, count, robots) for _ in range(2)]
        spent = [0.0, 0.0]
        for _ in range(ticks):
            for index, (host, flood) in enumerate(zip(hosts, (line, b""), strict=True)):
                spent[index] += _tick_seconds(host, count, (flood + b"\r\n") * 100)
        added = (spent[0] - spent[1]) / ticks * 1e3
        yield BenchmarkRow(
            "i", f"{name}: CPU added to a tick", added, "ms", MAX_FLOOD_MS
        )


def lateness_beside_floods(
    pairs: int, seconds: float, floods: Mapping[str, Flood] = FLOODS
) -> Iterator[BenchmarkRow]:
    """Measure how late scans of ten robots are beside clients that flood the server.

    The clients are silent and flood in turns. The lateness of a scan is its delay from
    simulated time to arrival, less the smallest delay of the silent time before it.

    Args:
        pairs: Number of floods to measure, each after a silent time.
        seconds: Length of each flood and of each silent time.
        floods: Number of clients and repeated line of each flood, by its name.
    """
    with served("empty_room") as (_, address):
        bystanders = [spawn(address, number) for number in range(BYSTANDERS)]
        for name, (count, line) in floods.items():
            late = [
                _lateness_of_pair(bystanders, address, count, line, seconds)
                for _ in range(pairs)
            ]
            silent, flooded = (np.concatenate(part) for part in zip(*late, strict=True))
            for label, quantile in QUANTILES.items():
                what = f"{BYSTANDERS} robots beside {name}: late, {label}"
                value = float(np.quantile(flooded, quantile))
                note = f"{np.quantile(silent, quantile):.1f} ms beside silence"
                yield BenchmarkRow("i", what, value, "ms", note=note)
        for sock in bystanders:
            sock.close()


def _lateness_of_pair(
    bystanders: list[socket.socket],
    address: tuple[str, int],
    count: int,
    line: bytes,
    seconds: float,
) -> tuple[Floats, Floats]:
    """Return the lateness of scans, ms, beside silent clients and beside a flood."""
    words = (*map(str, address), str(count), str(_robots_of(count, line)))
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [*CLIENTS, "flood", *words, line.decode()], stdin=pipe, stdout=pipe, text=True
    ) as flooders:
        assert flooders.stdin is not None
        assert flooders.stdout is not None
        try:
            flooders.stdout.readline()
            listen(bystanders, SETTLE_SECONDS)
            silent = listen(bystanders, seconds)
            flooders.stdin.write("start\n")
            flooders.stdin.flush()
            listen(bystanders, SETTLE_SECONDS)
            flooded = listen(bystanders, seconds)
        finally:
            flooders.kill()
    listen(bystanders, SETTLE_SECONDS)  # the server forgets the clients
    # By the smallest delay of the silence: that of the flood may have grown by all that
    # it costs.
    least = min(silent)
    return (np.array(silent) - least) * 1e3, (np.array(flooded) - least) * 1e3


def _robots_of(count: int, line: bytes) -> int:
    """Return how many of the clients need a robot for what they ask."""
    return 0 if line == b"GETSTARTPOSES" else min(count, MOST_ROBOTS)


def _host_with_clients(scene: Scene, count: int, robots: int) -> Host:
    """Return a host whose clients have numbers from 1; the first ones have robots."""
    host = Host(scene)
    for number in range(1, count + 1):
        host.connect()
        if number <= robots:
            host.receive(number, init_line(number - 1))
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
    # A process of its own: a server in this one would share its interpreter lock with
    # the clients.
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
            [*CLIENTS, "drive", host, str(port)], stdin=pipe, stdout=pipe, text=True
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
        # The last bytes are kept, as a line may come in two pieces.
        received = received[-100:] + data


def cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process, s."""
    # After the last bracket: the name of the program before it may hold blanks and
    # brackets.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _resident_bytes(pid: int) -> int:
    """Return the resident memory of a process, bytes."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
