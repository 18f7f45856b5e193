"""UsarCommander drives through the proxy, which maps and changes no byte.

Client and server take turns over real sockets, so that the bytes are the same in
every run: with a proxy between them, and without one.
"""

import asyncio
import importlib.util
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest

from radarsim.autonomy.mapping.mapper import Mapper, MapperSettings
from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
)
from radarsim.autonomy.proxy import (
    ConnectionState,
    RobotSelector,
    TcpProxy,
    TrafficObserver,
)
from radarsim.autonomy.proxy.line_queue import LineQueue
from radarsim.geometry import Pose3
from radarsim.protocol.reports import decode_report
from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from tests.dialogues import test_usarcommander as usarcommander

LEGS = ((1, 0, 0), (1, 0, 1.5), (3, 4, 0.2))
TIMEOUT = 240.0  # s
NOISELESS = {"sigma": 0, "position_bias": 0, "angle_bias": 0}
CONDITIONS = SimulationConfig(item_settings={"InsTest": NOISELESS})

Address = tuple[str, int]


@cache
def client_module() -> Any:
    """Return the module of the stand-in for UsarCommander, which is itself a test."""
    path = Path(__file__).parents[2] / "dialogues" / "test_usarcommander.py"
    name = "stand_in_for_usarcommander"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Recorder(Host):
    """Records the data of both directions, by connection."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, config=CONDITIONS, seed=7)
        self.received: list[bytes] = []
        self.sent_bytes: list[bytes] = []

    def connect(self, address: str = "") -> int:
        number = super().connect(address)
        self.received.append(b"")
        self.sent_bytes.append(b"")
        return number

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        notices = super().receive(number, data)
        self.received[number - 1] += data
        return notices

    def take(self, number: int) -> bytes:
        return self._record(number, super().take(number))

    def finish(self, number: int) -> bytes:
        return self._record(number, super().finish(number))

    def _record(self, number: int, data: bytes) -> bytes:
        self.sent_bytes[number - 1] += data
        return data


class World:
    """A server whose time passes only when its client waits, in a thread of its own."""

    def __init__(self, scene: Scene) -> None:
        self.host = Recorder(scene)
        self.server = Server(self.host, speed=1e-9)
        self.address = ("", 0)
        self.links: list[Transport] = []
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self.loop.run_forever)
        self._thread.start()

    def run(self, coroutine: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(TIMEOUT)

    async def tick(self) -> None:
        self.server.tick()

    def connect(self) -> "Transport":
        return Transport(self)

    def close(self) -> None:
        self.run(self.server.stop())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()


class Transport:
    """A socket whose bytes have arrived when a call returns."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.sent = b""
        self.got = b""
        self.inbox = b""
        self.index = len(world.host.sent_bytes)
        self.socket = socket.create_connection(world.address, TIMEOUT)
        world.links.append(self)
        self._wait(lambda: len(world.host.sent_bytes) > self.index)
        self._arrive()

    def send(self, data: bytes) -> None:
        self.sent += data
        self.socket.sendall(data)
        received = self.world.host.received
        self._wait(lambda: len(received[self.index]) == len(self.sent))
        self._arrive()

    def read(self) -> bytes:
        while not self.inbox:
            self._tick()
        data, self.inbox = self.inbox[:4096], self.inbox[4096:]
        return data

    def sleep(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self._tick()

    def seconds(self) -> float:
        return self.world.host.simulation.time

    def milliseconds(self) -> int:
        return round(self.seconds() * 1000)

    def close(self) -> None:
        self.socket.shutdown(socket.SHUT_WR)
        while data := self.socket.recv(65536):
            self.got += data
        self.socket.close()

    def _tick(self) -> None:
        self.world.run(self.world.tick())
        self._arrive()

    def _arrive(self) -> None:
        """Wait for all that the server has sent."""
        self.world.run(asyncio.sleep(0))  # the server has handled the data
        while len(self.got) < len(self.world.host.sent_bytes[self.index]):
            data = self.socket.recv(65536)
            self.got += data
            self.inbox += data

    def _wait(self, condition: Callable[[], bool]) -> None:
        until = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < until
            time.sleep(0.0001)


class Dialogue(NamedTuple):
    """One dialogue: the data of each side, by connection, and the client."""

    sent_bytes: list[bytes]
    received: list[bytes]
    got: list[bytes]
    sent: list[bytes]
    commander: "usarcommander.Commander"


@contextmanager
def running(scene: Scene) -> Iterator[World]:
    world = World(scene)
    try:
        world.run(world.server.start(port=0))
        world.address = world.server.address
        yield world
    finally:
        for link in world.links:
            link.socket.close()
        world.close()


@contextmanager
def with_proxy(world: World, listener: TrafficObserver) -> Iterator[None]:
    proxy = TcpProxy(world.server.address, listener.add_data)
    world.run(proxy.start())
    world.address = proxy.address
    listener.start()
    try:
        yield
    finally:
        world.run(proxy.stop())
        assert listener.finish(600)  # it may have to compile the mapper


def play(world: World) -> Dialogue:
    _, commander = client_module().dialogue(world.connect, LEGS)
    commander.link.close()
    host, links = world.host, world.links
    got, sent = [link.got for link in links], [link.sent for link in links]
    return Dialogue(host.sent_bytes, host.received, got, sent, commander)


class Mapping:
    """Makes a map of the observed traffic."""

    def __init__(self) -> None:
        self.connection: ConnectionState | None = None
        self.mapper: Mapper | None = None

    def begin(self, connection: ConnectionState, scanner: str) -> Mapper:
        facts = connection.scanner(scanner)
        assert facts is not None
        assert facts.mount == Pose3(0.2085, 0.0, 0.2)
        assert facts.max_range == 80.0
        assert not connection.asks_for_echoes(scanner)
        self.connection = connection
        self.mapper = Mapper(facts, MapperSettings(echo_wait=0.0))
        return self.mapper


@pytest.fixture(scope="module")
def direct(empty_room: Scene) -> Dialogue:
    with running(empty_room) as world:
        return play(world)


def test_proxy_changes_no_byte_and_observer_maps(
    empty_room: Scene, direct: Dialogue
) -> None:
    mapping = Mapping()
    listener = TrafficObserver(
        RobotSelector(mapping.begin), LineQueue(max_scans=10_000)
    )
    with running(empty_room) as world:
        with with_proxy(world, listener):
            through = play(world)
        assert len(through.sent_bytes) == 3
        assert through.sent_bytes == through.got == direct.sent_bytes == direct.got
        assert through.received == through.sent == direct.received == direct.sent
    commander = through.commander
    assert len(commander.patches) > 5
    assert commander.patches == direct.commander.patches
    assert_mapped(mapping, commander, listener)


def assert_mapped(
    mapping: Mapping, commander: "usarcommander.Commander", listener: TrafficObserver
) -> None:
    connection, mapper = mapping.connection, mapping.mapper
    assert listener.error is None
    assert connection is not None
    assert mapper is not None
    assert connection.number == 3
    assert connection.robot is not None
    assert (connection.robot.class_name, connection.robot.name) == ("P3AT", "Rob")
    assert len(mapper.trajectory) == commander.scans
    x, y, _ = commander.pose
    pose = mapper.trajectory.poses[-1]
    assert (pose.x, pose.y) == pytest.approx((x, -y), abs=0.05)
    assert mapper.grid.sensed(-5.0, 0.0)
    across, up = np.meshgrid(*mapper.grid.frame.cell_centers())
    walls = mapper.grid.classes() == CellClass.OBSTACLE
    off = client_module().wall_errors(np.column_stack([across[walls], up[walls]]))
    assert np.mean(off < 0.13) > 0.95  # two cells and a half


def test_map_equals_that_of_what_the_client_received(
    empty_room: Scene, direct: Dialogue
) -> None:
    mapping = Mapping()
    listener = TrafficObserver(
        RobotSelector(mapping.begin), LineQueue(max_scans=10_000)
    )
    with running(empty_room) as world, with_proxy(world, listener):
        play(world)
    assert mapping.mapper is not None
    own = Mapper(mapping.mapper.scanner, mapping.mapper.settings)
    for line in direct.got[2].decode().splitlines():
        report = decode_report(line)
        if report is not None:
            own.take(report)
    assert own.scans == mapping.mapper.scans > 40
    assert (own.grid.classes() == mapping.mapper.grid.classes()).all()
