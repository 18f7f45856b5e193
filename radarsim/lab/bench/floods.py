"""Benchmarks of clients that flood the server: group i of the table."""

import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from socket import socket
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.lab.bench.clients import init_line, listen, spawn
from radarsim.lab.bench.server import served
from radarsim.lab.bench.timing import BenchmarkRow
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

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
BYSTANDERS = 10  # robots of clients that do not flood
SETTLE_SECONDS = 0.7  # until robots have spawned, and the flood has its full strength
FLOODERS = (sys.executable, "-m", "radarsim.lab.bench.flooding_clients")


def floods(ticks: int) -> Iterator[BenchmarkRow]:
    """Measure what clients that flood the server add to the CPU time of a tick.

    Two hosts in this process, with and without the flood, tick in turns.

    Args:
        ticks: Number of ticks to average over.
    """
    scene = load_map("empty_room")
    for name, (count, line) in FLOODS.items():
        robots = _robots_of(count, line)
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
            yield _lateness_row(name, "median", 0.5, silent, flooded)
            yield _lateness_row(name, "99th percentile", 0.99, silent, flooded)
        for sock in bystanders:
            sock.close()


def _lateness_of_pair(
    bystanders: list[socket],
    address: tuple[str, int],
    count: int,
    line: bytes,
    seconds: float,
) -> tuple[Floats, Floats]:
    """Return the lateness of scans, ms, beside silent clients and beside a flood."""
    words = (*map(str, address), str(count), str(_robots_of(count, line)))
    with _flooders(*words, line.decode()) as process:
        assert process.stdin is not None
        listen(bystanders, SETTLE_SECONDS)
        silent = listen(bystanders, seconds)
        process.stdin.write("start\n")
        process.stdin.flush()
        listen(bystanders, SETTLE_SECONDS)
        flooded = listen(bystanders, seconds)
    listen(bystanders, SETTLE_SECONDS)  # the server forgets the clients
    least = min(silent)
    return (np.array(silent) - least) * 1e3, (np.array(flooded) - least) * 1e3


@contextmanager
def _flooders(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Connect clients that flood in a process of their own."""
    pipe = subprocess.PIPE
    with subprocess.Popen([*FLOODERS, *words], stdin=pipe, stdout=pipe, text=True) as p:
        try:
            assert p.stdout is not None
            p.stdout.readline()
            yield p
        finally:
            p.kill()


def _lateness_row(
    name: str, label: str, quantile: float, silent: Floats, flooded: Floats
) -> BenchmarkRow:
    late = float(np.quantile(flooded, quantile))
    before = float(np.quantile(silent, quantile))
    what = f"{BYSTANDERS} robots beside {name}: late, {label}"
    return BenchmarkRow("i", what, late, "ms", note=f"{before:.1f} ms beside silence")


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
