"""A simulated UsarCommander probes, drives and maps, in lockstep and over TCP.

It parses, ignores and rejects what the source of UsarCommander does, and shares no code
with the server. An assertion inside it is where the real program would throw.
"""

import asyncio
import math
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pytest
from client_parsers import groups_of
from usarcommander_parser import UsarCommanderParser

from radarsim.geometry import Floats
from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig

ONE_READ = 4096
# What it asks for after each answer: a type, and a name, which may be empty.
QUESTIONS = {
    "P3AT": {"Robot": ("RangeScanner", "lms200"), "RangeScanner": ("Camera", "Camera")},
    "P2AT": {
        "Robot": ("Sonar", ""),
        "Sonar": ("GPS", ""),
        "GPS": ("RangeScanner", "Scanner1"),
    },
}
STILL = {"sigma": 0, "position_bias": 0, "angle_bias": 0}
NO_DRIFT = SimulationConfig(item_settings={"InsTest": STILL})
NO_NOISE = SimulationConfig(
    item_settings={"InsTest": STILL, "lms200": {"side_offset_uu": 0}}
)

# seconds, forward, left: turns on the spot, curves and straight stretches
TOUR = (
    *((2, 0, 0), (6, 0, 1), (8, 4, 0), (2.5, 0, -1.5), (5, 4, 0.5), (6, 5, -0.4)),
    *((3, 0, -2), (4, 3, 0), (1, 0, 0)),
)
SHORT_TOUR = ((2, 0, 0), (4, 0, 1.5), (3, 4, 0), (3, 3, 1), (1, 0, 0))


class Transport(Protocol):
    """A connection with a clock."""

    def send(self, data: bytes) -> None: ...
    def read(self) -> bytes: ...
    def sleep(self, seconds: float) -> None: ...
    def seconds(self) -> float: ...
    def milliseconds(self) -> int: ...
    def close(self) -> None: ...


class World:
    """A host and its connections in lockstep; all use its clock."""

    def __init__(self, host: Host, *, phase: int = 0) -> None:
        self.host = host
        self.phase = phase  # ms that the client's clock is ahead
        self.links: list[LockstepLink] = []
        self.diagnostics: list[Diagnostic] = []

    def connect(self) -> Transport:
        return LockstepLink(self)

    def tick(self) -> None:
        self.diagnostics += [notice for _, notice in self.host.step()]
        for link in self.links:
            link.inbox += self.host.take(link.number)


class LockstepLink:
    def __init__(self, world: World) -> None:
        self.world = world
        self.number = world.host.connect()
        self.inbox = bytearray(world.host.take(self.number))
        world.links.append(self)

    def send(self, data: bytes) -> None:
        self.world.diagnostics += self.world.host.receive(self.number, data)

    def read(self) -> bytes:
        for _ in range(100):
            if self.inbox:
                break
            self.world.tick()
        data = bytes(self.inbox[:ONE_READ])
        del self.inbox[:ONE_READ]
        return data

    def sleep(self, seconds: float) -> None:
        if not self.world.host.has_robot(self.number):
            self.inbox += self.world.host.take(self.number)
        for _ in range(round(seconds * 100)):
            self.world.tick()

    def seconds(self) -> float:
        return self.world.host.simulation.time

    def milliseconds(self) -> int:
        return round(self.seconds() * 1000) + self.world.phase

    def close(self) -> None:
        self.world.links.remove(self)
        self.world.host.disconnect(self.number)


class SocketTransport:
    """A TCP connection; its seconds are simulated, so that a slow server may lag."""

    def __init__(self, address: tuple[str, int], seconds: Callable[[], float]) -> None:
        self.socket = socket.create_connection(address, timeout=240)
        self.seconds = seconds

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def read(self) -> bytes:
        return self.socket.recv(ONE_READ)

    def sleep(self, seconds: float) -> None:
        until = self.seconds() + seconds
        while self.seconds() < until:
            time.sleep(0.001)

    def milliseconds(self) -> int:
        return int(time.monotonic() * 1000)

    def close(self) -> None:
        self.socket.close()


@dataclass
class Patch:
    """A scan in the map: the estimated pose of the robot, and ranges left to right."""

    pose: tuple[float, float, float]
    fov: float
    step: float
    ranges: list[float]


@dataclass
class Commander:
    """The agent: each reply triggers the next request, scans make the map."""

    link: Transport
    name: str = "Rob"
    battery: int = 0
    sent: list[str] = field(default_factory=list)
    answers: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    offset: tuple[float, float] = (0.0, 0.0)
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scans: int = 0
    first: tuple[float, float, float] | None = None
    patches: list[Patch] = field(default_factory=list)
    rest: str = ""
    class_name: str = "P3AT"

    def __post_init__(self) -> None:
        self.parser = UsarCommanderParser(self.class_name)

    def send(self, line: str) -> None:
        self.sent.append(line)
        self.link.send(f"{line}\r\n".encode("ascii"))

    def start(self, location: str, rotation: str) -> None:
        self.send(
            f"INIT {{ClassName USARBot.{self.class_name}}} {{Name {self.name}}} "
            f"{{Location {location}}} {{Rotation {rotation}}} "
        )

    def drive(self, forward: float, left: float) -> None:
        """Send speeds unless the reported battery is empty."""
        if self.battery >= 1:
            a, b = forward - left, forward + left
            line = f"DRIVE {{Left {a:g}}} {{Right {b:g}}} {{Light False}}"
            if line not in self.sent[-1:]:
                self.send(line)

    def run(self, seconds: float) -> None:
        until = self.link.seconds() + seconds
        while self.link.seconds() < until:
            self.receive(self.link.read())

    def tour(self, legs: Iterable[tuple[float, float, float]]) -> None:
        for seconds, forward, left in legs:
            self.drive(forward, left)
            self.run(seconds)

    def receive(self, data: bytes) -> None:
        *lines, self.rest = (self.rest + data.decode("ascii")).split("\n")
        for line in lines:
            self.handle(line.removesuffix("\r"))

    def handle(self, line: str) -> None:
        reading = self.parser.parse(line)
        if reading is None:
            return
        kind, values = reading.kind, reading.values
        if kind == "NFO":
            self.send(f"GETGEO {{Type Robot}} {{Name {self.name}}}")
            self.send(f"GETCONF {{Type Robot}} {{Name {self.name}}}")
        elif kind == "STA":
            self.battery = values["battery"]
        elif " " in kind:
            self.on_answer(kind, values)
        elif kind == "INS":
            x, y, _ = values["Location"]
            self.pose = (x, y, values["Orientation"][2])
        elif kind == "RangeScanner":
            self.on_scan(values)

    def on_answer(self, answer: str, values: Mapping[str, Any]) -> None:
        self.answers[answer] = values
        head, kind = answer.split(" ")
        if kind in QUESTIONS[self.class_name]:
            following, name = QUESTIONS[self.class_name][kind]
            self.send(f"GET{head} {{Type {following}}} {{Name {name}}}")
        if answer == "GEO RangeScanner":
            x, y, _ = values["Location"]
            self.offset = (x, y)

    def on_scan(self, values: Mapping[str, Any]) -> None:
        self.scans += 1
        if self.link.milliseconds() % 200 > 100:
            return
        if self.first is None:
            self.first = self.pose
        elif self.is_patch():
            ranges = values["Range"][::-1]
            self.patches.append(
                Patch(self.pose, values["FOV"], values["Resolution"], ranges)
            )

    def is_patch(self) -> bool:
        """Return whether a scan extends the map or starts it at the first pose."""
        if not self.patches:
            assert self.first is not None
            return not apart(self.pose, self.first, 0.020, math.radians(2))
        return apart(self.pose, self.patches[-1].pose, 0.200, math.radians(5))

    def walls(self) -> Floats:
        """Return the points of the map, (N, 2) m, in USARSim's frame with y right."""
        points = []
        for patch in self.patches:
            x, y, yaw = patch.pose
            x += self.offset[0] * math.cos(yaw) - self.offset[1] * math.sin(yaw)
            y += self.offset[0] * math.sin(yaw) + self.offset[1] * math.cos(yaw)
            for i, distance in enumerate(patch.ranges):
                if 0.2 <= distance <= 79:
                    angle = yaw - patch.fov / 2 + i * patch.step
                    points.append(
                        (x + distance * math.cos(angle), y + distance * math.sin(angle))
                    )
        return np.array(points)


def apart(
    one: tuple[float, float, float],
    other: tuple[float, float, float],
    distance: float,
    turn: float,
) -> bool:
    moved = math.hypot(one[0] - other[0], one[1] - other[1])
    return (
        moved > distance or abs(math.remainder(one[2] - other[2], 2 * math.pi)) > turn
    )


def probe_level(connect: Callable[[], Transport]) -> str:
    """Read the level as the dialogs do, without a robot."""
    link = connect()
    link.sleep(1)
    text = link.read().decode("ascii")
    link.close()
    return next(p[6:] for p in groups_of(text) if p.startswith("Level "))


def probe_starts(connect: Callable[[], Transport]) -> dict[str, tuple[str, str]]:
    """Read the start poses as the dialogs do: one read a second after the request."""
    link = connect()
    link.sleep(1)
    link.read()
    link.send(b"GETSTARTPOSES\r\n")
    link.sleep(1)
    text = link.read().decode("ascii")
    link.close()
    words = groups_of(text)[-1].split(" ")
    starts = dict(
        zip(words[::3], zip(words[1::3], words[2::3], strict=True), strict=True)
    )
    for name in starts:
        assert name.startswith(("Playe", "Robot", "ComSt"))
        assert name.isalnum()
    return starts


def dialogue(
    connect: Callable[[], Transport], legs: Iterable[tuple[float, float, float]]
) -> tuple[str, Commander]:
    """Do what a user does: read the map name, choose a start pose, drive about."""
    level = probe_level(connect)
    location, rotation = probe_starts(connect)["RobotStart1"]
    commander = Commander(connect())
    commander.link.sleep(3)
    commander.start(location, rotation)
    commander.run(0.5)
    commander.tour(legs)
    return level, commander


def wall_errors(points: Floats) -> Floats:
    """Return the distances of points from the walls of the shipped rooms, m."""
    beyond = np.abs(points) - (10.4, 6.4)
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    errors: Floats = np.abs(np.where(outside > 0, outside, beyond.max(axis=1)))
    return errors


def seen_share(points: Floats) -> float:
    """Return the share of 0.5 m pieces of the four walls that have a point."""
    pieces = set()
    for x, y in points:
        if abs(abs(y) - 6.4) < 0.1:
            pieces.add(("long", y > 0, x // 0.5))
        if abs(abs(x) - 10.4) < 0.1:
            pieces.add(("short", x > 0, y // 0.5))
    return len(pieces) / (2 * (20.8 + 12.8) / 0.5)


def test_level_start_poses_and_robot_are_found(empty_room: Scene) -> None:
    world = World(Host(empty_room))
    level, commander = dialogue(world.connect, [(1, 0, 0)])
    assert level == "DM-EmptyRoom"
    assert commander.sent[0].startswith("INIT")
    assert commander.sent[1:7] == [
        "GETGEO {Type Robot} {Name Rob}",
        "GETCONF {Type Robot} {Name Rob}",
        "GETGEO {Type RangeScanner} {Name lms200}",
        "GETCONF {Type RangeScanner} {Name lms200}",
        "GETGEO {Type Camera} {Name Camera}",
        "GETCONF {Type Camera} {Name Camera}",
    ]
    geo = commander.answers["GEO Robot"]
    assert geo["wheelradius"] == [0.098]
    assert geo["wheelseparation"] == [0.36]
    assert geo["wheelbase"] == [0.248]
    assert commander.offset == (0.2085, 0.0)
    assert commander.pose == (-8.0, 0.0, 0.0)
    assert world.diagnostics == []


def test_answers_about_a_p2at_lead_to_the_mount_of_its_scanner(
    empty_room: Scene,
) -> None:
    world = World(Host(empty_room))
    commander = Commander(world.connect(), class_name="P2AT")
    commander.start("-8,0,0", "0,0,0")
    commander.run(2)
    kinds = ("Robot", "Sonar", "GPS", "RangeScanner")
    assert list(commander.answers) == [
        f"{head} {kind}" for kind in kinds for head in ("GEO", "CONF")
    ]
    assert commander.offset == (0.15, 0.0)
    assert commander.scans >= 15
    assert world.diagnostics == []


@pytest.mark.parametrize("phase", [0, 40, 100, 105, 190])
def test_map_starts_at_any_phase_of_the_clock(empty_room: Scene, phase: int) -> None:
    world = World(Host(empty_room), phase=phase)
    _, commander = dialogue(world.connect, [(2, 0, 0)])
    assert len(commander.patches) == 1
    assert commander.patches[0].pose == (-8.0, 0.0, 0.0)


def test_mapped_walls_match_the_room_without_noise(empty_room: Scene) -> None:
    world = World(Host(empty_room, config=NO_NOISE))
    _, commander = dialogue(world.connect, TOUR)
    points = commander.walls()
    assert len(commander.patches) > 100
    assert wall_errors(points).max() < 0.05
    assert seen_share(points) > 0.95


@pytest.mark.slow
def test_mapped_walls_match_the_room_on_average_with_side_beams(
    empty_room: Scene,
) -> None:
    world = World(Host(empty_room, config=NO_DRIFT))
    _, commander = dialogue(world.connect, TOUR)
    errors = wall_errors(commander.walls())
    assert math.sqrt(np.mean(errors**2)) < 0.05
    assert 0.05 < errors.max() < 0.105  # no ray is farther from its beam than 25 units


def test_mapped_walls_match_the_room_in_front_of_bushes(foliage_room: Scene) -> None:
    world = World(Host(foliage_room, config=NO_NOISE))
    _, commander = dialogue(world.connect, TOUR)
    points = commander.walls()
    in_front = points[points[:, 0] < -1]
    assert wall_errors(in_front).max() < 0.05
    assert len(in_front) > 2000
    assert (points[:, 0] > 2.5).sum() > 100  # and through the bushes it sees the rest


async def test_mapped_walls_match_the_room_over_tcp(empty_room: Scene) -> None:
    host = Host(empty_room, config=NO_NOISE)
    server = Server(host, speed=8)
    await server.start(port=0)
    try:
        level, commander = await asyncio.to_thread(
            dialogue,
            lambda: SocketTransport(server.address, lambda: host.simulation.time),
            SHORT_TOUR,
        )
        commander.link.close()
    finally:
        await server.stop()
    assert level == "DM-EmptyRoom"
    points = commander.walls()
    assert len(commander.patches) > 10
    assert wall_errors(points).max() < 0.05
    assert seen_share(points) > 0.5
