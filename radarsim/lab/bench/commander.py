"""Benchmarks of the commander: group l of the table.

Ten clients drive robots in a hall. What counts is by how much they get their scans
later, and how much more the server works, while a commander shows the robots to
viewers: one that reads what it is sent, and twenty that never read.
"""

import json
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Final

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from radarsim.geometry import Floats
from radarsim.lab.bench.server import (
    PROGRAM,
    Drive,
    cpu_seconds,
    lateness_of,
    served_hall,
)
from radarsim.lab.bench.timing import BenchmarkRow

ROBOTS: Final = 10
DEAF_VIEWERS: Final = 20  # that do not read
MAX_CPU_RATIO: Final = 1.1
QUANTILES: Final = {"median": 0.5, "99th percentile": 0.99}


class Viewer:
    """A browser of the commander that reads frames, and takes their delays."""

    def __init__(self, connection: ClientConnection) -> None:
        """Begin to read in a thread, which ends with the connection."""
        self.delays: list[float] = []
        self._connection = connection
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        newest = 0.0
        try:
            for data in self._connection:
                arrived = time.monotonic()
                if isinstance(data, str):
                    continue
                (size,) = struct.unpack_from("<I", data)
                header = json.loads(data[4 : 4 + size])
                self._connection.send(json.dumps({"op": "ack", "t": header["t"]}))
                scans = [scan["t"] for r in header["robots"] for scan in r["scans"]]
                # of scans that it has not shown yet
                self.delays += [arrived - t for t in scans if t > newest]
                newest = max([newest, *scans])
        except ConnectionClosed:
            pass


@contextmanager
def commander_of(address: tuple[str, int]) -> Iterator[tuple[str, str]]:
    """Run a commander of a server, at host and port; return its address and token."""
    words = ("commander", "--connect", f"{address[0]}:{address[1]}")
    with subprocess.Popen(
        [*PROGRAM, *words, "--web", "0"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            url, token = process.stdout.readline().split()[-1].split("/#token=")
            yield url, token
        finally:
            process.terminate()


@contextmanager
def watched(url: str, token: str, deaf: int) -> Iterator[Viewer]:
    """Connect a viewer to a commander, and others that do not read.

    Args:
        url: Address of the commander.
        token: Its token.
        deaf: Number of viewers that do not read.
    """
    with ExitStack() as stack:
        viewers = [
            stack.enter_context(_enter(url, token, deaf=number > 0))
            for number in range(1 + deaf)
        ]
        yield Viewer(viewers[0])


@contextmanager
def _enter(url: str, token: str, *, deaf: bool) -> Iterator[ClientConnection]:
    """Connect a viewer that selects a robot, whose echoes it is shown."""
    with connect(
        f"{url.replace('http', 'ws', 1)}/ws",
        origin=Origin(url),
        compression=None,
        max_queue=1 if deaf else 16,
        close_timeout=0.1,
    ) as connection:
        connection.send(json.dumps({"op": "hello", "token": token}))
        connection.send(json.dumps({"op": "select", "robot": "R0"}))
        yield connection


def commander_beside_robots(
    seconds: float, robots: int = ROBOTS, deaf: int = DEAF_VIEWERS
) -> Iterator[BenchmarkRow]:
    """Measure a server with and without a commander, in turns.

    Args:
        seconds: Length of each measurement: there is one before the commander, one with
            it but without viewers, one with these, and one after it.
        robots: Number of robots.
        deaf: Number of viewers that do not read.
    """
    with served_hall() as (process, address, drive):
        drive(robots, 1.0)
        before = _measure(process.pid, drive, robots, seconds)
        with commander_of(address) as (url, token):
            alone = _measure(process.pid, drive, robots, seconds)
            with watched(url, token, deaf) as viewer:
                drive(robots, 2.0)  # until all are connected
                viewer.delays.clear()
                during = _measure(process.pid, drive, robots, seconds)
                frames = np.array(viewer.delays)
        after = _measure(process.pid, drive, robots, seconds)
    # Each time by its own smallest delay: simulated time may have waited in between.
    without = np.concatenate([lateness_of(before[0]), lateness_of(after[0])])
    name = f"{robots} robots beside a commander, {deaf} viewers do not read"
    for label, quantile in QUANTILES.items():
        late = float(np.quantile(lateness_of(during[0]), quantile))
        note = f"{np.quantile(without, quantile):.1f} ms without"
        yield BenchmarkRow("l", f"{name}: late, {label}", late, "ms", note=note)
    work = (before[1] + after[1]) / 2
    cases = {"a commander": during, "one that nobody looks at": alone}
    for case, (_, cpu) in cases.items():
        name = f"CPU of the server with {case}, by that without"
        note = f"{cpu * 1e3:.2f} against {work * 1e3:.2f} ms per scan"
        yield BenchmarkRow("l", name, cpu / work, "x", MAX_CPU_RATIO, note)
    shown = (frames - during[0].min(initial=np.inf)) * 1e3
    for label, quantile in QUANTILES.items():
        name = f"from a scan to the viewer that reads: {label}"
        yield BenchmarkRow("l", name, float(np.quantile(shown, quantile)), "ms")


def _measure(
    pid: int, drive: Drive, robots: int, seconds: float
) -> tuple[Floats, float]:
    """Return the delays of scans, s, and the CPU time of the server per scan, s.

    Per scan, as on a busy machine simulated time waits, and less is to be done.
    """
    used = cpu_seconds(pid)
    delays = drive(robots, seconds)
    return delays, (cpu_seconds(pid) - used) / max(1, delays.size)
