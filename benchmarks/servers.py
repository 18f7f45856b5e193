"""Benchmarks of servers over loopback TCP: groups e, f, l, m and o.

The lateness of a scan is its delay from simulated time to arrival at the client, less
the smallest delay of the run. The clients are in a process of their own.
"""

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync import client as websocket_client
from websockets.typing import Origin

from benchmarks.clients import SCAN
from benchmarks.scenes import init_line, write_hall
from benchmarks.timing import Row
from radarsim.geometry import Floats

PROGRAM = (sys.executable, "-m", "radarsim")
CHECKOUT = Path(__file__).parents[1]
SWARMS: Final = (100, 200, 300, 400, 600, 800, 1000)  # numbers of robots, ascending
MAX_P99: Final = 20.0  # ms late
MIN_RATE: Final = 9.8  # scans per second of a robot; fewer come if simulated time waits
TURN: Final = re.compile(rb"\{Type RangeScanner\} \{Name Navtech\}")

# Connects clients until there are so many robots; returns the delays of all scans that
# come in so many seconds, s.
Drive: TypeAlias = Callable[[int, float], Floats]


@contextmanager
def served(
    map_: str, *options: str
) -> Iterator[tuple[subprocess.Popen[str], tuple[str, int]]]:
    """Run a server on a free port; yield its process and address once it listens.

    Args:
        map_: Name of a map, or path of a map file.
        options: Other options of the server.
    """
    process = subprocess.Popen(
        [*PROGRAM, "serve", map_, "--port", "0", *options],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        host, port = process.stdout.readline().split()[-1].rsplit(":", 1)
        yield process, (host, int(port))
    finally:
        process.send_signal(signal.SIGTERM)
        process.stdout.close()
        process.wait()


@contextmanager
def served_hall(
    *options: str,
) -> Iterator[tuple[subprocess.Popen[str], tuple[str, int], Drive]]:
    """Serve the hall, with clients in another process."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        hall = str(write_hall(folder))
        process, address = stack.enter_context(served(hall, *options))
        clients = stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", "benchmarks.clients", *map(str, address)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                cwd=CHECKOUT,
            )
        )
        stack.callback(clients.kill)

        def drive(robots: int, seconds: float) -> Floats:
            assert clients.stdin is not None
            assert clients.stdout is not None
            clients.stdin.write(f"{robots} {seconds}\n")
            clients.stdin.flush()
            return np.array(json.loads(clients.stdout.readline()), np.float64)

        yield process, address, drive


def lateness_of(delays: Floats) -> Floats:
    """Return by how much delays exceed the smallest of them, ms."""
    late: Floats = (delays - delays.min(initial=np.inf)) * 1e3
    return late


def late_rows(
    group: str, name: str, late: Floats, without: Floats | None = None
) -> Iterator[Row]:
    """Return the rows of the median and the 99th percentile of lateness."""
    for label, quantile in {"median": 0.5, "99th percentile": 0.99}.items():
        note = ""
        if without is not None:
            note = f"{np.quantile(without, quantile):.1f} ms without"
        value = float(np.quantile(late, quantile))
        yield Row(group, f"{name}: late, {label}", value, "ms", note=note)


def cpu_seconds(pid: int) -> float:
    """Return the CPU time of a process, s."""
    # After the last bracket: the name of the program before it may hold blanks and
    # brackets.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_bytes(pid: int) -> int:
    """Return the resident memory of a process, bytes."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def lateness(seconds: float, robots: int = 200) -> Iterator[Row]:
    """Measure how late the scans of many driving robots arrive at a client."""
    with served_hall() as (process, _, drive):
        before = resident_bytes(process.pid)
        drive(robots, 1.0)
        started, used = time.monotonic(), cpu_seconds(process.pid)
        late = lateness_of(drive(robots, seconds))
        used, elapsed = cpu_seconds(process.pid) - used, time.monotonic() - started
        grown = resident_bytes(process.pid) - before
    name = f"{robots} robots at 10 Hz, 181 beams"
    rate = len(late) / robots / seconds
    yield Row("e", f"{name}: scans per second and robot", rate, "1/s")
    yield from late_rows("e", name, late)
    yield Row("e", f"{name}: late, worst", float(late.max()), "ms")
    yield Row("e", f"{name}: CPU per robot", 100 * used / elapsed / robots, "%")
    yield Row("e", f"{name}: memory per robot", grown / robots / 2**20, "MiB")


def capacity(seconds: float, swarms: Sequence[int] = SWARMS) -> Iterator[Row]:
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
            note = f"of {robots} {rate:.1f} scans a second, 99 % < {p99:.1f} ms late"
            # Where simulated time waits, scans are few and need not be late.
            if rate < MIN_RATE or p99 > MAX_P99:
                break
            most = robots
    yield Row("e", "robots that this machine holds", most, "robots", None, note)


def start_up(times: int = 5) -> Iterator[Row]:
    """Measure the start-up time of the program, the best of a few runs."""
    seconds = min(_help_seconds() for _ in range(times))
    yield Row("f", "radarsim --help", seconds * 1e3, "ms", 500.0)
    runs = [_first_scan_seconds() for _ in range(times)]
    listening, first_scan = (min(each) for each in zip(*runs, strict=True))
    yield Row("f", "serve foliage_room: listening", listening * 1e3, "ms", 1500.0)
    yield Row("f", "serve foliage_room: first scan", first_scan * 1e3, "ms")


def _help_seconds() -> float:
    start = time.perf_counter()
    subprocess.run([*PROGRAM, "--help"], stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


def _first_scan_seconds() -> tuple[float, float]:
    """Return the time until a server listens, and until the first scan comes, s."""
    start = time.perf_counter()
    with served("foliage_room") as (_, address):
        listening = time.perf_counter() - start
        with socket.create_connection(address) as client:
            client.sendall(b"INIT {ClassName P3AT} {Start RobotStart1}\r\n")
            received = b""
            while not SCAN.search(received):
                data = client.recv(65536)
                if not data:
                    raise ConnectionError("the server has ended before a scan")
                received += data
            return listening, time.perf_counter() - start


def recording(seconds: float, robots: int = 50) -> Iterator[Row]:
    """Measure a server that records, and one before and one after that does not."""
    # One before and one after: what else runs on the machine changes in the meantime.
    before, cpu_before, _, _ = _measure_recording(robots, seconds, None)
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        delays, cpu, writer, written = _measure_recording(robots, seconds, run)
    after, cpu_after, _, _ = _measure_recording(robots, seconds, None)
    without = np.concatenate([lateness_of(before), lateness_of(after)])
    name = f"{robots} robots that are recorded"
    yield from late_rows("m", name, lateness_of(delays), without)
    ratio = 2 * cpu / (cpu_before + cpu_after)
    yield Row("m", "CPU of a server that records, by that without", ratio, "x")
    share = 100 * writer / robots
    yield Row("m", "CPU of the process that writes, per robot", share, "%")
    size = 60 * written / robots / 2**20
    yield Row("m", "written for a robot in a minute", size, "MiB")


def _measure_recording(
    robots: int, seconds: float, folder: Path | None
) -> tuple[Floats, float, float, float]:
    """Let robots drive on a server of their own, which records into a folder.

    Returns:
        Delays of scans, s; CPU of the server and of the process that writes, s per s;
        bytes written per s.
    """
    options = () if folder is None else ("--record", str(folder))
    with served_hall(*options) as (process, _, drive):
        drive(robots, 2.0)  # until all are connected
        tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
        writers = [int(pid) for task in tasks for pid in task.read_text().split()]
        pids = [process.pid, *writers]
        started, used = time.monotonic(), list(map(cpu_seconds, pids))
        size = _size(folder)
        delays = drive(robots, seconds)
        elapsed = time.monotonic() - started
        spent = [cpu_seconds(p) - u for p, u in zip(pids, used, strict=True)]
        written = _size(folder) - size
    return delays, spent[0] / elapsed, sum(spent[1:]) / elapsed, written / elapsed


def _size(folder: Path | None) -> int:
    """Return the size of the files in a folder, bytes."""
    return 0 if folder is None else sum(f.stat().st_size for f in folder.iterdir())


def turning_radar(seconds: float, robots: int = 20) -> Iterator[Row]:
    """Measure how late the scans of plain robots are next to a radar that turns."""
    # The radar's client is read in a thread, as drive() waits for the other process.
    with served_hall() as (process, address, drive), ThreadPoolExecutor(1) as pool:
        drive(robots, 0.5)  # until all are connected
        before = cpu_seconds(process.pid)
        alone = lateness_of(drive(robots, seconds))
        plain = cpu_seconds(process.pid) - before
        with socket.create_connection(address) as radar:
            radar.sendall(init_line(199, "P3AT_Navtech"))
            time.sleep(2.0)  # until the radar has turned twice
            turns = pool.submit(_count_turns, radar, seconds)
            before = cpu_seconds(process.pid)
            late = lateness_of(drive(robots, seconds))
            added = cpu_seconds(process.pid) - before - plain
            rate = turns.result() / seconds
    name = f"{robots} robots beside a radar of 400 x 3768 that turns"
    yield from late_rows("o", name, late, alone)
    yield Row("o", f"{name}: its turns", rate, "1/s")
    yield Row("o", f"{name}: its share of a processor", 100 * added / seconds, "%")


def _count_turns(radar: socket.socket, seconds: float) -> int:
    """Read from a client with a radar; return how many turns come."""
    end, text = time.monotonic() + seconds, b""
    radar.settimeout(seconds)
    with suppress(TimeoutError):
        while time.monotonic() < end:
            text += radar.recv(65536)
    return len(TURN.findall(text))


class Viewer:
    """A browser of the commander that reads frames, and notes their delays."""

    def __init__(self, connection: websocket_client.ClientConnection) -> None:
        """Begin to read in a thread, which ends with the connection."""
        self.delays: list[float] = []
        self._connection = connection
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        newest = 0.0
        with suppress(ConnectionClosed):
            for data in self._connection:
                arrived = time.monotonic()
                if isinstance(data, str):
                    continue
                (size,) = struct.unpack_from("<I", data)
                header = json.loads(data[4 : 4 + size])
                # The commander sends no other frame before this answer.
                self._connection.send(json.dumps({"op": "ack", "t": header["t"]}))
                scans = [scan["t"] for r in header["robots"] for scan in r["scans"]]
                self.delays += [arrived - t for t in scans if t > newest]
                newest = max([newest, *scans])


@contextmanager
def commander_of(address: tuple[str, int]) -> Iterator[tuple[str, str]]:
    """Run a commander of a server; yield its URL and token."""
    words = ("commander", "--connect", f"{address[0]}:{address[1]}", "--web", "0")
    with subprocess.Popen(
        [*PROGRAM, *words], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            url, token = process.stdout.readline().split()[-1].split("/#token=")
            yield url, token
        finally:
            process.terminate()


@contextmanager
def connected_viewer(
    url: str, token: str, *, reads: bool
) -> Iterator[websocket_client.ClientConnection]:
    """Connect a viewer that selects a robot, whose echoes it is shown."""
    with websocket_client.connect(
        f"{url.replace('http', 'ws', 1)}/ws",
        origin=Origin(url),
        compression=None,
        # With a longer queue, a viewer that does not read would still take in frames
        # for a while.
        max_queue=16 if reads else 1,
        close_timeout=0.1,
    ) as connection:
        connection.send(json.dumps({"op": "hello", "token": token}))
        connection.send(json.dumps({"op": "select", "robot": "R0"}))
        yield connection


def commander(seconds: float, robots: int = 10, silent: int = 20) -> Iterator[Row]:
    """Measure a server with and without a commander, in turns.

    Args:
        seconds: Length of each measurement: there is one before the commander, one with
            it but without viewers, one with these, and one after it.
        robots: Number of robots.
        silent: Number of viewers that never read, besides one that reads.
    """
    with served_hall() as (process, address, drive):

        def run() -> tuple[Floats, float]:
            """Return delays of scans, s, and CPU of the server per scan, s."""
            used = cpu_seconds(process.pid)
            delays = drive(robots, seconds)
            # Per scan: on a busy machine simulated time waits, and less is to be done.
            return delays, (cpu_seconds(process.pid) - used) / max(1, delays.size)

        drive(robots, 1.0)
        before = run()
        with commander_of(address) as (url, token), ExitStack() as stack:
            alone = run()
            reader, *_ = [
                stack.enter_context(connected_viewer(url, token, reads=number == 0))
                for number in range(1 + silent)
            ]
            viewer = Viewer(reader)
            drive(robots, 2.0)  # until all are connected
            viewer.delays.clear()
            during = run()
            frames = np.array(viewer.delays)
        after = run()
    # Each time by its own smallest delay: simulated time may have waited in between.
    without = np.concatenate([lateness_of(before[0]), lateness_of(after[0])])
    name = f"{robots} robots beside a commander, {silent} viewers do not read"
    yield from late_rows("l", name, lateness_of(during[0]), without)
    plain = (before[1] + after[1]) / 2
    for case, (_, cpu) in {"a commander": during, "one without viewers": alone}.items():
        name = f"CPU of the server with {case}, by that without"
        yield Row("l", name, cpu / plain, "x", 1.1)
    shown = (frames - during[0].min(initial=np.inf)) * 1e3
    yield from late_rows("l", "frames at the viewer that reads", shown)
