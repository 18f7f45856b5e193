"""The server of a robot's radar: its clients read turns, and none holds up another."""

import asyncio
import socket
import subprocess
from collections.abc import AsyncIterator, Callable
from typing import Any

import numpy as np
import pytest
import pytest_asyncio
from colossus_client import (
    CONFIGURATION,
    FFT_8_BIT,
    START,
    STOP,
    Azimuth,
    ColossusClient,
    Configuration,
    ProtocolError,
)
from processes import start_radarsim

import radarsim
from radarsim.addons.fmcw.navtech_server import MAX_CLIENTS, NavtechServer
from radarsim.geometry import Pose3
from radarsim.presets.robots import load_robot
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

INIT = b"INIT {ClassName USARBot.P3AT_Navtech} {Name %s} {Start RobotStart%d}\r\n"


class Running:
    """A host with robots, and the server of a radar, whose ticks the test lets pass."""

    def __init__(self, scene: Scene) -> None:
        self.host = Host(scene)
        self.radar = NavtechServer(port=0)
        self.radar.begin(self.host.simulation)

    def spawn(self, name: bytes, start: int) -> int:
        number = self.host.connect()
        assert self.host.receive(number, INIT % (name, start)) == []
        return number

    def tick(self) -> None:
        self.radar.step(passes=True)
        self.host.step()

    async def connect(self) -> ColossusClient:
        client = await asyncio.to_thread(ColossusClient, self.radar.address)
        await asyncio.sleep(0.05)
        return client

    async def until(self, action: Callable[[], Any]) -> Any:
        """Let time pass until something that waits in a thread is done."""
        task = asyncio.create_task(asyncio.to_thread(action))
        while not task.done():
            self.tick()
            await asyncio.sleep(0.001)
        return task.result()


@pytest_asyncio.fixture
async def running(foliage_room: Scene) -> AsyncIterator[Running]:
    running = Running(foliage_room)
    await running.radar.start()
    yield running
    await running.radar.stop()


async def test_client_reads_the_turns_of_a_standing_robot(
    running: Running, foliage_room: Scene
) -> None:
    client = await running.connect()
    client.send(START)
    await asyncio.sleep(0.05)
    running.tick()
    running.spawn(b"R1", 1)
    expected = Configuration(400, 0.0438, 3768, 5600, 4.0, 1600)
    assert await running.until(client.request_configuration) == expected

    def read_turn() -> list[Azimuth]:
        return [client.read_azimuth() for _ in range(401)]

    rows = await running.until(read_turn)
    client.close()
    assert [row.sweep for row in rows] == list(range(401))
    assert [row.encoder for row in rows] == [*range(0, 5600, 14), 0]
    assert np.diff([row.seconds + row.split * 1e-9 for row in rows]) == pytest.approx(
        [0.25 / 400] * 400
    )
    counts = np.array([row.counts for row in rows[:400]], np.uint8)
    model = load_robot("P3AT_Navtech")
    mount = model.items_of("RangeScanner")[1].mount
    start = foliage_room.starts[0].pose
    pose = start.compose(Pose3(0.0, 0.0, model.origin_height)).compose(mount)
    radar = radarsim.load_sensor("navtech_cts350x")
    rng = radarsim.generator_for(0, "R1", "Navtech")
    assert (counts == radar.spectrum(foliage_room, pose, rng).counts).all()


async def test_garbage_ends_its_connection_and_no_other(running: Running) -> None:
    running.spawn(b"R1", 1)
    good, bad, silent = [await running.connect() for _ in range(3)]
    bad.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
    good.send(START)
    row = await running.until(good.read_azimuth)
    assert len(row.counts) == 3768
    with pytest.raises((ProtocolError, ConnectionError)):
        await running.until(lambda: bad.receive(FFT_8_BIT))
    good.send(STOP)
    for client in (good, bad, silent):
        client.close()


async def test_slow_reader_misses_directions(running: Running) -> None:
    running.spawn(b"R1", 1)
    slow = await running.connect()
    slow.send(START)
    await asyncio.sleep(0.05)
    for _ in range(80):
        running.tick()
        await asyncio.sleep(0)

    def read_past_a_gap() -> int:
        last = slow.read_azimuth().sweep
        while True:
            sweep = slow.read_azimuth().sweep
            if sweep != last + 1:
                return sweep - last
            last = sweep

    assert await running.until(read_past_a_gap) > 1
    slow.close()


async def test_server_follows_the_first_robot_that_carries_a_radar(
    running: Running,
) -> None:
    client = await running.connect()
    first = running.spawn(b"R1", 1)
    running.spawn(b"R2", 2)
    running.tick()
    client.send(START)
    before = (await running.until(client.read_azimuth)).counts
    running.host.disconnect(first)
    # The other one is reported again; its data are of another place.
    await running.until(lambda: client.receive(CONFIGURATION))
    after = (await running.until(client.read_azimuth)).counts
    assert before != after
    client.close()


async def test_one_client_too_many_is_refused(running: Running) -> None:
    clients = [await running.connect() for _ in range(MAX_CLIENTS + 1)]
    with pytest.raises((ProtocolError, ConnectionError)):
        await asyncio.to_thread(clients[-1].read, 1)
    for client in clients:
        client.close()


async def test_radar_of_a_named_robot_is_served(foliage_room: Scene) -> None:
    running = Running(foliage_room)
    running.radar = NavtechServer(port=0, robot="r2")
    running.radar.begin(running.host.simulation)
    await running.radar.start()
    running.spawn(b"R1", 1)
    client = await running.connect()
    client.socket.settimeout(0.2)
    running.tick()
    with pytest.raises(TimeoutError):
        client.receive(CONFIGURATION)
    client.socket.settimeout(240)
    running.spawn(b"R2", 2)
    assert await running.until(lambda: client.receive(CONFIGURATION))
    client.close()
    await running.radar.stop()


@pytest.mark.slow
def test_client_reads_a_turn_of_a_served_radar() -> None:
    words = ("serve", "empty_room", "--port", "0", "--navtech", "0")
    with start_radarsim(*words) as server:
        try:
            robots, radar = _addresses_of(server)
            with socket.create_connection(robots, timeout=240) as robot:
                robot.sendall(INIT % (b"R1", 1))
                client = ColossusClient(radar)
                client.send(START)
                turn = client.read_turn()
                client.close()
        finally:
            server.terminate()
        server.communicate(timeout=240)
    assert [azimuth.encoder for azimuth in turn] == list(range(0, 5600, 14))
    # Straight ahead, to both sides and behind are walls, brighter than the noise. One
    # close by may saturate the converter: its harmonics fill a few bins far away.
    far = []
    for azimuth in turn[::100]:
        assert len(azimuth.counts) == 3768
        assert max(azimuth.counts[60:500]) > 60
        far.append(np.mean(np.array(azimuth.counts[2000:]) > 60))
    assert sorted(far)[:3] == [0, 0, 0]
    assert max(far) < 0.05


def _addresses_of(server: subprocess.Popen[bytes]) -> list[tuple[str, int]]:
    """Return where a server listens, for robots and for a radar's clients."""
    assert server.stdout is not None
    found = []
    for _ in range(2):
        host, port = server.stdout.readline().split()[-1].decode().split(":")
        found.append((host, int(port)))
    return found
