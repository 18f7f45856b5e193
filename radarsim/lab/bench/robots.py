"""Benchmarks of robots and their clients in one process: groups j and q of the table.

What is measured is a tenth of a second of simulated time: ten times ``Host.step``, and
``take`` for the clients that are to be sent something, in which each robot sends one
scan and all its other readings.

They drive in a hall that holds a thousand of them. Of one robot, also the time is
measured in which its client decodes what it is sent.
"""

import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from radarsim.client import Session
from radarsim.geometry import Floats
from radarsim.lab.bench.timing import BenchmarkRow, compare
from radarsim.raycast.embree import FirstHits, Mesh
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

SIDE: Final = 90.0  # m
WALL: Final = 0.2  # m
POLES: Final = 11  # in a row, and rows
# Robots stand on a grid, and poles between them.
ROBOTS_IN_A_ROW: Final = 36
GAP: Final = 2.4  # m between robots
STRIDE: Final = 803  # has no divisor in common with the number of places
TURN: Final = 2.4  # rad from each robot to the next
FAST, SLOW = 4.0, 2.5  # rad/s of the wheels outside and inside of a circle
ROBOTS: Final = 100
# Upper limits of the ratio to a raw first-hit call, by the number of poles in a row.
LIMITS: Final = {POLES: 4.0, 0: 8.0}
# Upper limits of what a robot costs among so many others, by what it costs among 100.
GROWTH_LIMITS: Final = {1: None, 400: 1.3, 1000: None}
DECODING_LIMIT: Final = 4.0  # of the ratio to float() of the ranges alone
TENTHS: Final = 50  # of a second of which the lines are decoded
SETTLE_TICKS: Final = 30  # until robots drive and their scans are spread over the ticks


def hall_map(poles: int) -> str:
    """Return a map file of a hall with so many poles in each of as many rows."""
    ends = (SIDE + WALL) / 2
    objects = [
        _box("floor", (SIDE, SIDE, WALL), (0.0, 0.0, -WALL / 2)),
        _box("north", (SIDE, WALL, 3.0), (0.0, ends, 1.5)),
        _box("south", (SIDE, WALL, 3.0), (0.0, -ends, 1.5)),
        _box("east", (WALL, SIDE, 3.0), (ends, 0.0, 1.5)),
        _box("west", (WALL, SIDE, 3.0), (-ends, 0.0, 1.5)),
    ]
    for i in range(poles * poles):
        x, y = (3 * GAP * (k - (poles - 1) / 2) for k in divmod(i, poles))
        objects.append(
            f"{{name: pole_{i}, cylinder: [0.3, 2.5], position: [{x:g}, {y:g}, 1.25],"
            " material: concrete}"
        )
    lines = ["version: 1", "materials: {concrete: {density: opaque}}", "objects:"]
    lines += [f"  - {text}" for text in objects]
    lines += ["starts:", "  - {name: RobotStart1, position: [1.2, 1.2, 0], yaw_deg: 0}"]
    return "\n".join(lines) + "\n"


def write_hall(folder: Path, poles: int = POLES) -> Path:
    """Write the map file of a hall into a folder, and return its path."""
    path = folder / f"hall_{poles}.yaml"
    path.write_text(hall_map(poles), encoding="utf-8")
    return path


def init_line(number: int) -> bytes:
    """Return the line that spawns a robot at the place of its number, from 0.

    Few robots are spread over the whole hall, as many are.
    """
    places = ROBOTS_IN_A_ROW * ROBOTS_IN_A_ROW
    # A stride without common divisor visits all places once, far apart from the start.
    row, column = divmod(number * STRIDE % places, ROBOTS_IN_A_ROW)
    x, y = (GAP * (k - (ROBOTS_IN_A_ROW - 1) / 2) for k in (column, row))
    yaw = math.remainder(TURN * number, math.tau)
    place = f"{{Location {x:.2f},{y:.2f},0}} {{Rotation 0,0,{yaw:.4f}}}"
    return f"INIT {{ClassName P3AT}} {{Name R{number}}} {place}\r\n".encode()


def drive_line(number: int) -> bytes:
    """Return the line that lets a robot drive in circles, half of them to the left."""
    left, right = (SLOW, FAST) if number % 2 else (FAST, SLOW)
    return f"DRIVE {{Left {left}}} {{Right {right}}}\r\n".encode()


def _box(
    name: str, size: tuple[float, float, float], at: tuple[float, float, float]
) -> str:
    return (
        f"{{name: {name}, box: [{size[0]:g}, {size[1]:g}, {size[2]:g}],"
        f" position: [{at[0]:g}, {at[1]:g}, {at[2]:g}], material: concrete}}"
    )


class DrivingRobots:
    """A host whose clients have a driving robot each.

    Attributes:
        host: The host.
    """

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


def driving_robots(seconds: float, robots: int = ROBOTS) -> Iterator[BenchmarkRow]:
    """Measure driving robots against raw first-hit calls on the rays of their scans."""
    with tempfile.TemporaryDirectory() as folder:
        for poles, limit in LIMITS.items():
            scene = load_map(write_hall(Path(folder), poles))
            driving = DrivingRobots(scene, robots)
            meshes = [Mesh(part.vertices, part.faces) for part in scene.parts]
            first = FirstHits(meshes, driving.rays())
            result = compare(
                driving.tenth, first.run, seconds=seconds, clock=time.thread_time
            )
            where = f"{poles * poles} poles" if poles else "nothing in it"
            name = f"{robots} driving robots in a hall with {where}, 0.1 s simulated"
            note = f"{result.subject * 1e3:.1f} ms against {result.reference * 1e3:.2f}"
            yield BenchmarkRow("j", name, result.ratio, "x", limit, note)


def growth_of_robots(seconds: float, robots: int = ROBOTS) -> Iterator[BenchmarkRow]:
    """Measure what a robot costs among many, against a robot among 100."""
    with tempfile.TemporaryDirectory() as folder:
        scene = load_map(write_hall(Path(folder)))
    some = DrivingRobots(scene, robots)
    for count, limit in GROWTH_LIMITS.items():
        many = DrivingRobots(scene, count)
        result = compare(
            many.tenth, some.tenth, seconds=seconds, clock=time.process_time
        )
        each, reference = result.subject / count * 1e6, result.reference / robots * 1e6
        name = f"0.1 s simulated of a robot among {count}, by one among {robots}"
        note = f"{each:.0f} us against {reference:.0f}"
        yield BenchmarkRow("j", name, each / reference, "x", limit, note)


def decoding(seconds: float) -> Iterator[BenchmarkRow]:
    """Measure how long a client decodes a scan and the other lines of 0.1 s."""
    with tempfile.TemporaryDirectory() as folder:
        host = Host(load_map(write_hall(Path(folder))))
    number = host.connect()
    host.receive(number, init_line(0).replace(b"P3AT", b"P3AT_Radar360"))
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

    result = compare(decode, parse_ranges, seconds=seconds, clock=time.thread_time)
    each, reference = (
        total / len(lists) * 1e6 for total in (result.subject, result.reference)
    )
    note = f"{each:.0f} us against {reference:.0f}"
    name = "lines of 0.1 s of a robot with a radar of 360 beams, decoded"
    yield BenchmarkRow("q", name, result.ratio, "x", DECODING_LIMIT, note)
