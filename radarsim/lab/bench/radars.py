"""Benchmark of a robot with a turning FMCW radar, beside plain ones: group o.

What a turn of an FMCW radar costs, against its rays and one FFT per direction.
"""

import re
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
from scipy import fft

from radarsim.addons.fmcw.radar_equation import fft_length
from radarsim.lab.bench.clients import connect, init_line
from radarsim.lab.bench.server import MAX_P99, cpu_seconds, lateness_of, served_hall
from radarsim.lab.bench.timing import BenchmarkRow, compare
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.sensors.range_scanner import load_sensor, sensor_pose

MAP = "foliage_room"
PLACE = (-8.0, 0.0, 0.0)
LIMIT = 4.0
PLAIN: Final = 20  # robots
SETTLE_SECONDS: Final = 2.0  # until the radar has turned twice
TURN: Final = re.compile(rb"\{Type RangeScanner\} \{Name Navtech\}")


def turns_of_a_radar(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure a turn, by the processor's time of tracing its rays and of the FFTs."""
    scene, radar = load_map(MAP), load_sensor("navtech_cts350x").fmcw
    pose, rng = sensor_pose(scene, PLACE), generator_for(0, "bench")
    settings, tracer = radar.settings, tracer_of(scene)
    _, rays = radar.aim(scene, pose, -1, range(settings.azimuths))
    signal = np.ones((settings.azimuths, fft_length(settings)), np.complex64)

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
    with served_hall() as (process, address, drive), ThreadPoolExecutor(1) as pool:
        drive(robots, 0.5)
        before = cpu_seconds(process.pid)
        alone = lateness_of(drive(robots, seconds))
        plain = cpu_seconds(process.pid) - before
        with connect(address) as radar:
            line = init_line(199).replace(b"USARBot.P3AT", b"USARBot.P3AT_Navtech")
            radar.sendall(line)
            time.sleep(SETTLE_SECONDS)
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
