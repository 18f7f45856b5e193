"""Benchmarks of robots and their clients in one process: groups i, j, n and q.

Driving robots are measured over a tenth of a second of simulated time: ten times
``Host.step``, and ``take`` for the clients that are to be sent something, in which each
robot sends one scan and all its other readings.
"""

import gc
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.engine import first_hits
from benchmarks.scenes import POLES, drive_line, init_line, write_hall
from benchmarks.timing import Row, compare, measure, ratio_row
from radarsim.addons.gym import GoToEnv, VectorEnv
from radarsim.client import Session
from radarsim.geometry import Floats
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

ROBOTS: Final = 100
# Upper limits of the ratio to a raw first-hit call, by the number of poles in a row.
LIMITS: Final = {POLES: 4.0, 0: 8.0}
# Upper limits of what a robot costs among so many others, by what it costs among 100.
GROWTH_LIMITS: Final = {1: None, 400: 1.3, 1000: None}
SETTLE_TICKS: Final = 30  # until robots drive and their scans are spread over the ticks
TENTHS: Final = 50  # of a second whose lines are decoded
# The number of clients that flood, the first 100 with robots, and what each sends.
FLOODS: Final = {
    "10 clients that repeat GETCONF": (10, b"GETCONF {Type RangeScanner}"),
    "40 clients that repeat GETCONF": (40, b"GETCONF {Type RangeScanner}"),
    "40 clients that ask for scans": (
        40,
        b"SET {Type RangeScanner} {Name lms200} {Opcode SCAN}",
    ),
    "200 clients that repeat GETSTARTPOSES": (200, b"GETSTARTPOSES"),
}
LEARNERS: Final = 50


def hall(poles: int = POLES) -> Scene:
    """Return the scene of the hall of robots."""
    with tempfile.TemporaryDirectory() as folder:
        return load_map(write_hall(Path(folder), poles))


class DrivingRobots:
    """A host whose clients have a driving robot each."""

    def __init__(self, scene: Scene, robots: int) -> None:
        """Connect clients, and wait until all robots drive."""
        self.host = Host(scene)
        numbers = [self.host.connect() for _ in range(robots)]
        for robot, number in enumerate(numbers):
            self.host.receive(number, init_line(robot))
        # The host spreads spawns over ticks, so that none of them takes long.
        while len(self.host.simulation.vehicles) < robots:
            self.tick()
        for robot, number in enumerate(numbers):
            self.host.receive(number, drive_line(robot))
        for _ in range(SETTLE_TICKS):
            self.tick()

    def tick(self) -> None:
        """Advance by a tick, and take what clients are sent, as a server does."""
        self.host.step()
        for number in self.host.clients_to_send():
            self.host.take(number)

    def tenth(self) -> None:
        """Advance by a tenth of a second."""
        for _ in range(10):
            self.tick()

    def rays(self) -> tuple[Floats, Floats]:
        """Return origins and directions of the beams of all robots' scans, (N, 3)."""
        origins, directions = [], []
        for vehicle in self.host.simulation.vehicles:
            mounted = vehicle.scanners[0]
            pose, settings = vehicle.sensor_pose(mounted.item), mounted.scanner.settings
            half = np.radians(settings.fov_deg) / 2
            angles = pose.yaw + np.linspace(-half, half, settings.beams)
            level = np.zeros_like(angles)
            directions.append(np.stack([np.cos(angles), np.sin(angles), level], axis=1))
            origins.append(np.tile([pose.x, pose.y, pose.z], (len(angles), 1)))
        return np.concatenate(origins), np.concatenate(directions)


def driving_robots(seconds: float, robots: int = ROBOTS) -> Iterator[Row]:
    """Measure driving robots against raw first-hit calls on the rays of their scans."""
    for poles, limit in LIMITS.items():
        scene = hall(poles)
        driving = DrivingRobots(scene, robots)
        first = first_hits(scene, driving.rays())
        times = compare(
            driving.tenth, first.run, seconds=seconds, clock=time.thread_time
        )
        name = f"{robots} driving robots in a hall with {poles * poles} poles, 0.1 s"
        yield ratio_row("j", name, times, limit)


def growth_of_robots(seconds: float, robots: int = ROBOTS) -> Iterator[Row]:
    """Measure what a robot costs among many, against a robot among 100."""
    scene = hall()
    some = DrivingRobots(scene, robots)
    for count, limit in GROWTH_LIMITS.items():
        many = DrivingRobots(scene, count)
        together, reference = compare(
            many.tenth, some.tenth, seconds=seconds, clock=time.process_time
        )
        name = f"0.1 s of a robot among {count}, by one among {robots}"
        yield ratio_row("j", name, (together / count, reference / robots), limit)


def decoding(seconds: float) -> Iterator[Row]:
    """Measure how long a client decodes 0.1 s of lines, by float() of the ranges."""
    host = Host(hall())
    number = host.connect()
    host.receive(number, init_line(0, "P3AT_Radar360"))
    host.receive(number, drive_line(0))
    for _ in range(SETTLE_TICKS):
        host.step()
    host.take(number)
    received: list[bytes] = []
    while len(received) < TENTHS:
        host.step()
        if data := host.take(number):
            received.append(data)
    scans = [data.split(b"{Range ") for data in received]
    lists = [scan.partition(b"}")[0] for _, *rest in scans for scan in rest]

    def decode() -> None:
        session = Session()
        for data in received:
            session.receive(data)

    def parse_ranges() -> None:
        for text in lists:
            np.array([float(word) for word in text.split(b",")])

    subject, reference = compare(
        decode, parse_ranges, seconds=seconds, clock=time.thread_time
    )
    times = subject / len(lists), reference / len(lists)
    yield ratio_row("q", "lines of 0.1 s of a radar of 360 beams, decoded", times, 4.0)


def floods(ticks: int) -> Iterator[Row]:
    """Measure the CPU time that clients that flood the server add to a tick.

    Two hosts, with and without the flood, tick in turns.
    """
    scene = load_map("empty_room")
    for name, (count, line) in FLOODS.items():
        robots = 0 if line == b"GETSTARTPOSES" else min(count, 100)
        hosts = [_host_with_clients(scene, count, robots) for _ in range(2)]
        spent = [0.0, 0.0]
        for _ in range(ticks):
            for i, (host, sent) in enumerate(zip(hosts, (line, b""), strict=True)):
                spent[i] += _tick_seconds(host, count, (sent + b"\r\n") * 100)
        added = (spent[0] - spent[1]) / ticks * 1e3
        yield Row("i", f"{name}: CPU added to a tick", added, "ms", 5.0)


def _host_with_clients(scene: Scene, count: int, robots: int) -> Host:
    """Return a host whose clients have numbers from 1; the first ones have robots."""
    host = Host(scene)
    for number in range(1, count + 1):
        host.connect()
        if number <= robots:
            row, column = divmod(number - 1, 20)
            place = f"{-9 + 0.95 * column:.2f},{-5 + 1.0 * row:.2f},0"
            line = f"INIT {{ClassName P3AT}} {{Location {place}}}\r\n"
            host.receive(number, line.encode())
            host.step()
    for _ in range(200):  # robots have settled
        _tick_seconds(host, count, b"")
    gc.collect()
    gc.freeze()  # as the server does
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


def decisions(seconds: float) -> Iterator[Row]:
    """Measure a decision of a learner, of 0.1 s and a scan of 181 beams."""
    alone, many = GoToEnv(), VectorEnv(LEARNERS)
    for env in (alone, many):
        env.reset(seed=1)
        env.action_space.seed(1)
    one = measure(lambda: alone.step(alone.action_space.sample()), seconds=seconds)
    yield Row("n", "decision of one robot", one * 1e6, "us", 1e6 / 400)
    each = measure(lambda: many.step(many.action_space.sample()), seconds=seconds)
    name = f"decision of one among {LEARNERS} robots"
    yield Row("n", name, each / LEARNERS * 1e6, "us", 1e6 / 9000)
    reset = measure(alone.reset, seconds=seconds)
    yield Row("n", "reset of one robot", reset * 1e6, "us", 2000.0)
