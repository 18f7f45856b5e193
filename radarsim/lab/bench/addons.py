"""Benchmarks of add-ons: groups l to p of the table.

The commander, group l. Ten clients drive robots in a hall. What counts is by how much
they get their scans later, and how much more the server works, while a commander shows
the robots to viewers: one that reads what it is sent, and twenty that never read.

Recordings, group m. Clients drive robots in a hall. What counts is by how much they get
their scans later while the server records, what the process that writes costs, and how
much it writes.

Environments for reinforcement learning, group n. A robot with a turning FMCW radar
beside plain ones, group o. What a turn of such a radar costs, against its rays and one
FFT per direction, group p.
"""

import json
import re
import socket
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy import fft
from websockets.exceptions import ConnectionClosed
from websockets.sync import client as websocket_client
from websockets.typing import Origin

from radarsim.addons.fmcw.radar_equation import fft_length
from radarsim.addons.fmcw.viewpoints import fixed_viewpoints
from radarsim.geometry import Floats
from radarsim.lab.bench.clients import connect, init_line
from radarsim.lab.bench.server import (
    MAX_P99,
    PROGRAM,
    QUANTILES,
    Drive,
    cpu_seconds,
    lateness_of,
    served_hall,
)
from radarsim.lab.bench.timing import BenchmarkRow, compare
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

MAP = "foliage_room"
PLACE = (-8.0, 0.0, 0.0)
LIMIT = 5.0
PLAIN: Final = 20  # robots
SETTLE_SECONDS: Final = 2.0  # until the radar has turned twice
TURN: Final = re.compile(rb"\{Type RangeScanner\} \{Name Navtech\}")


def turns_of_a_radar(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure a turn, by the processor's time of tracing its rays and of the FFTs."""
    scene, radar = load_map(MAP), load_sensor("navtech_cts350x").fmcw
    pose, rng = sensor_pose(scene, PLACE), generator_for(0, "bench")
    settings, tracer = radar.settings, tracer_of(scene)
    view = fixed_viewpoints(pose, radar.times(0))
    _, rays = radar.aim(scene, view, -1, range(settings.azimuths))
    signal = np.ones((settings.azimuths, fft_length(settings) // 2), np.complex64)

    def trace_and_transform() -> None:
        tracer.trace(rays, events=True, incidence=True)
        fft.fft(signal, axis=1)

    result = compare(
        lambda: radar.spectrum(scene, pose, rng),
        trace_and_transform,
        seconds=seconds,
        clock=time.thread_time,
    )
    note = f"{result.subject * 1e3:.0f} ms against {result.reference * 1e3:.0f}"
    title = f"{settings.azimuths} x {settings.bins} bins in {MAP}"
    yield BenchmarkRow("p", title, result.ratio, "x", LIMIT, note)


def turning_radar(seconds: float, robots: int = PLAIN) -> Iterator[BenchmarkRow]:
    """Measure how late the scans of plain robots are beside a radar that turns."""
    # The radar's client is read in a thread, as drive() waits for the other process.
    with served_hall() as (process, address, drive), ThreadPoolExecutor(1) as pool:
        # Robots spawn and connect in this time, which is not to be measured.
        drive(robots, 0.5)
        before = cpu_seconds(process.pid)
        alone = lateness_of(drive(robots, seconds))
        plain = cpu_seconds(process.pid) - before
        with connect(address) as radar:
            line = init_line(199).replace(b"USARBot.P3AT", b"USARBot.P3AT_Navtech")
            radar.sendall(line)
            time.sleep(SETTLE_SECONDS)
            # Sockets of connect() do not block, and this one is read alone.
            radar.setblocking(True)
            turns = pool.submit(_count_turns, radar, seconds)
            before = cpu_seconds(process.pid)
            late = lateness_of(drive(robots, seconds))
            added = cpu_seconds(process.pid) - before - plain
            rate = turns.result() / seconds
    name = f"{robots} robots beside a radar of 400 x 3768 that turns"
    p99, before_p99 = (float(np.quantile(each, 0.99)) for each in (late, alone))
    note = f"without it {before_p99:.1f} ms"
    yield BenchmarkRow("o", f"{name}: late, 99 %", p99, "ms", MAX_P99, note)
    yield BenchmarkRow("o", f"{name}: its turns", rate, "1/s")
    share = 100 * added / seconds
    yield BenchmarkRow("o", f"{name}: its share of a processor", share, "%")


def _count_turns(radar: socket.socket, seconds: float) -> int:
    """Read from a client with a radar; return how many turns come."""
    end, text = time.monotonic() + seconds, b""
    radar.settimeout(seconds)
    while time.monotonic() < end:
        text += radar.recv(65536)
    return len(TURN.findall(text))


LEARNERS: Final = 50
# Upper limits, us of processor time.
ALONE: Final = 1e6 / 400
AMONG_MANY: Final = 1e6 / 9000
RESET: Final = 2000.0


def decisions(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure the processor time of a decision, of 0.1 s and a scan of 181 beams.

    Args:
        seconds: Length of each measurement.
    """
    try:
        from radarsim.addons.gym import GoToEnv, VectorEnv  # noqa: PLC0415 - an extra
    except ImportError as error:
        yield BenchmarkRow("n", "needs Gymnasium", 0.0, "us", note=str(error))
        return
    alone, many = GoToEnv(), VectorEnv(LEARNERS)
    for env in (alone, many):
        env.reset(seed=1)
        env.action_space.seed(1)
    alone_us = _cpu_us(lambda: alone.step(alone.action_space.sample()), seconds)
    yield BenchmarkRow("n", "decision of one robot", alone_us, "us", ALONE)
    many_us = _cpu_us(lambda: many.step(many.action_space.sample()), seconds) / LEARNERS
    name = f"decision of one among {LEARNERS} robots"
    yield BenchmarkRow("n", name, many_us, "us", AMONG_MANY)
    yield BenchmarkRow(
        "n", "reset of one robot", _cpu_us(alone.reset, seconds), "us", RESET
    )


def _cpu_us(run: Callable[[], object], seconds: float) -> float:
    """Return the processor time of a function, us; not that of its first call."""
    run()
    runs, started = 0, time.process_time()
    while (used := time.process_time() - started) < seconds or not runs:
        run()
        runs += 1
    return used / runs * 1e6


RECORDED: Final = 50


class _Usage(NamedTuple):
    """What a server and its children use."""

    late: Floats  # ms, one for each scan
    cpu: float  # of the server, s per s
    writer: float  # CPU of the process that writes, s per s
    written: float  # bytes per s


def recording_robots(seconds: float, robots: int = RECORDED) -> Iterator[BenchmarkRow]:
    """Measure a server that records, and one before and one after that does not.

    Args:
        seconds: Length of each measurement.
        robots: Number of robots, each with a client.
    """
    # One before and one after: what else runs on the machine changes in the meantime.
    before = _measure_recording(robots, seconds, None)
    with tempfile.TemporaryDirectory() as folder:
        during = _measure_recording(robots, seconds, Path(folder) / "run")
    after = _measure_recording(robots, seconds, None)
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


def _measure_recording(robots: int, seconds: float, folder: Path | None) -> _Usage:
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


ROBOTS: Final = 10
DEAF_VIEWERS: Final = 20  # that do not read
MAX_CPU_RATIO: Final = 1.1


class Viewer:
    """A browser of the commander that reads frames, and takes their delays."""

    def __init__(self, connection: websocket_client.ClientConnection) -> None:
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
                # The commander waits for it, and would send no other frame without.
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
def _enter(
    url: str, token: str, *, deaf: bool
) -> Iterator[websocket_client.ClientConnection]:
    """Connect a viewer that selects a robot, whose echoes it is shown."""
    with websocket_client.connect(
        f"{url.replace('http', 'ws', 1)}/ws",
        origin=Origin(url),
        compression=None,
        # With a longer queue, a viewer that does not read would still take in frames
        # for a while.
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
        before = _measure_beside(process.pid, drive, robots, seconds)
        with commander_of(address) as (url, token):
            alone = _measure_beside(process.pid, drive, robots, seconds)
            with watched(url, token, deaf) as viewer:
                drive(robots, 2.0)  # until all are connected
                viewer.delays.clear()
                during = _measure_beside(process.pid, drive, robots, seconds)
                frames = np.array(viewer.delays)
        after = _measure_beside(process.pid, drive, robots, seconds)
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


def _measure_beside(
    pid: int, drive: Drive, robots: int, seconds: float
) -> tuple[Floats, float]:
    """Return the delays of scans, s, and the CPU time of the server per scan, s.

    Per scan, as on a busy machine simulated time waits, and less is to be done.
    """
    used = cpu_seconds(pid)
    delays = drive(robots, seconds)
    return delays, (cpu_seconds(pid) - used) / max(1, delays.size)
