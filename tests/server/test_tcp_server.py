"""Real sockets: what clients do to a server, and what they do not to each other."""

import asyncio
import logging
import re
import socket
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace

import numpy as np
import pytest

from radarsim.errors import ServerError
from radarsim.geometry import Pose3
from radarsim.host import Diagnostic, Host
from radarsim.scene.scene import Scene, StartPose
from radarsim.server.tcp_server import Connection, Server
from radarsim.simulation.config import SimulationConfig

GREETING = b"NFO {Gametype BotDeathMatch} {Level DM-EmptyRoom} {TimeLimit 0}\r\n"
STARTS = (
    b"NFO {StartPoses 3} {RobotStart1 -8.00,0.00,0.00 0.00,0.00,0.00 "
    b"RobotStart2 -8.00,-3.50,0.00 0.00,0.00,0.00 "
    b"RobotStart3 -8.00,3.50,0.00 0.00,0.00,0.00}\r\n"
)
INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"
LONG_LINES = SimulationConfig(item_settings={"lms200": {"resolution_deg": 0.1}})
TIME = re.compile(rb"SEN {Time ([0-9.]+)} {Type RangeScanner}")


class Peer:
    """A client of its own making."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.reader = reader
        self.writer = writer

    async def send(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def line(self) -> bytes:
        return await asyncio.wait_for(self.reader.readline(), 5)

    async def until(self, part: bytes) -> bytes:
        """Skip lines up to one that has a part; nothing is left when all was read."""
        while line := await self.line():
            if part in line:
                break
        return line

    async def rest(self) -> bytes:
        """Read to the end of the connection."""
        return await asyncio.wait_for(self.reader.read(), 5)

    async def scans(self, count: int) -> list[float]:
        """Give the times of the next scans."""
        lines = [await self.until(b"{Type RangeScanner}") for _ in range(count)]
        return [float(match[1]) for line in lines if (match := TIME.match(line))]

    @property
    def transport(self) -> asyncio.Transport:
        transport = self.writer.transport
        assert isinstance(transport, asyncio.Transport)
        return transport

    def reset(self) -> None:
        """Break the connection without closing it."""
        sock = self.writer.get_extra_info("socket")
        linger = struct.pack("ii", 1, 0)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.transport.abort()


class TraversabilityMap:
    """A running server, and the clients that came to it."""

    def __init__(self, host: Host, server: Server) -> None:
        self.host = host
        self.server = server
        self.peers: list[Peer] = []

    async def peer(self, *, small: bool = False) -> Peer:
        sock = socket.socket()
        if small:  # little fits on the way to who does not read
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.setblocking(False)
        try:
            await asyncio.get_running_loop().sock_connect(sock, self.server.address)
        except OSError:
            sock.close()
            raise
        peer = Peer(*await asyncio.open_connection(sock=sock, limit=2**14))
        self.peers.append(peer)
        return peer

    async def driver(self, init: bytes = INIT) -> Peer:
        peer = await self.peer()
        await peer.send(init)
        await peer.until(b"STA ")
        return peer

    async def comes_true(self, is_so: Callable[[], bool]) -> None:
        for _ in range(500):
            if is_so():
                return
            await asyncio.sleep(0.01)
        raise AssertionError("it does not come true")

    @property
    def robots(self) -> int:
        return len(self.host.simulation.vehicles)


@asynccontextmanager
async def running(
    host: Host, *, speed: float = 5.0
) -> AsyncIterator[TraversabilityMap]:
    server = Server(host, speed=speed)
    await server.start(port=0)
    floor = TraversabilityMap(host, server)
    try:
        yield floor
    finally:
        for peer in floor.peers:
            peer.writer.close()
        await server.stop()
        for peer in floor.peers:
            with suppress(ConnectionError):
                await peer.writer.wait_closed()


@pytest.fixture
async def floor(empty_room: Scene) -> AsyncIterator[TraversabilityMap]:
    async with running(Host(empty_room)) as floor:
        yield floor


def assert_every_scan_came(times: list[float]) -> None:
    assert np.diff(times) == pytest.approx(0.1)


async def test_bad_lines_are_skipped_and_the_next_is_answered(
    floor: TraversabilityMap,
) -> None:
    peer = await floor.peer()
    await peer.send(b"DRIVE Left\r\nFOO {}\n\r\xff\x00{{\r\nGETSTARTPOSES\r\n")
    peer.writer.write_eof()
    assert await peer.rest() == GREETING + STARTS


async def test_half_a_command_waits_and_hinders_nobody(
    floor: TraversabilityMap,
) -> None:
    silent, other = await floor.peer(), await floor.driver()
    assert await silent.line() == GREETING
    await silent.send(b"GETSTART")
    assert_every_scan_came(await other.scans(10))
    await silent.send(b"POSES\r")
    assert await silent.line() == STARTS


async def test_a_broken_connection_takes_its_robot_with_it(
    floor: TraversabilityMap, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    other = await floor.driver(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    broken = await floor.driver()
    assert floor.robots == 2
    broken.reset()
    await floor.comes_true(lambda: floor.robots == 1)
    assert_every_scan_came(await other.scans(5))
    assert "disconnected: [Errno" in caplog.text
    again = await floor.driver()
    assert await again.until(b"{Location -8.0000,0.0000,")


async def test_who_closes_takes_its_robot_with_it(
    floor: TraversabilityMap, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    peer = await floor.driver()
    peer.writer.close()
    await floor.comes_true(lambda: floor.robots == 0)
    assert "disconnected: it closed its side" in caplog.text


async def test_who_closes_its_side_and_does_not_read_leaves_as_well(
    floor: TraversabilityMap,
) -> None:
    peer = await floor.peer(small=True)
    await peer.send(INIT)
    await floor.comes_true(lambda: floor.robots == 1)
    peer.transport.pause_reading()
    await asyncio.sleep(0.5)
    peer.writer.write_eof()
    await floor.comes_true(lambda: floor.robots == 0)


async def test_who_does_not_read_delays_nobody(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    async with running(Host(empty_room, config=LONG_LINES)) as floor:
        deaf = await floor.peer(small=True)
        await deaf.send(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
        deaf.transport.pause_reading()
        other = await floor.driver()
        await other.scans(1)
        times: list[float] = []
        while floor.host.dropped_readings(1) == 0:
            times += await other.scans(5)
        assert_every_scan_came(times)
        assert floor.host.unsent_bytes(1) < 300_000
        deaf.reset()
        await floor.comes_true(lambda: floor.robots == 1)
        assert "readings it did not read were dropped" in caplog.text


async def test_who_reads_late_gets_whole_lines_and_the_newest(
    empty_room: Scene,
) -> None:
    async with running(Host(empty_room, config=LONG_LINES)) as floor:
        late = await floor.peer(small=True)
        await late.send(INIT)
        late.transport.pause_reading()
        await floor.comes_true(lambda: floor.host.dropped_readings(1) > 0)
        missed_until = floor.host.simulation.time
        late.transport.resume_reading()
        times: list[float] = []
        while not times or times[-1] < missed_until:
            line = await late.line()
            assert re.fullmatch(rb"(NFO|STA|SEN) \{.*\}\r\n", line)
            times += [float(match[1]) for match in TIME.finditer(line)]
        gaps = np.diff(times)
        assert gaps.min() == pytest.approx(0.1)
        assert gaps.max() > 0.5


async def test_an_endless_line_closes_that_connection_only(
    floor: TraversabilityMap, caplog: pytest.LogCaptureFixture
) -> None:
    other, bad = await floor.driver(), await floor.peer()
    with suppress(ConnectionError):
        await bad.send(b"x" * 70_000)
        await bad.rest()
    assert_every_scan_came(await other.scans(5))
    assert "expected at most 65536" in caplog.text
    assert "closed: endless line or unread answers" in caplog.text


async def test_who_asks_without_reading_is_disconnected(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    starts = tuple(StartPose(f"RobotStart{n}", Pose3(n, 0, 0)) for n in range(99))
    async with running(Host(replace(empty_room, starts=starts))) as floor:
        deaf = await floor.peer(small=True)
        deaf.transport.pause_reading()
        with suppress(ConnectionError):
            for _ in range(50):
                await deaf.send(b"GETSTARTPOSES\r\n" * 100)
        await floor.comes_true(lambda: "unread answers" in caplog.text)


async def test_a_flood_of_commands_delays_nobody(floor: TraversabilityMap) -> None:
    other, flood = await floor.driver(), await floor.peer()
    await flood.send(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    drives = [b"DRIVE {Left %d} {Right %d}\r\n" % (k, -k) for k in range(3000)]
    sending = asyncio.create_task(flood.send(b"".join(drives)))
    assert_every_scan_came(await other.scans(10))
    await sending
    await flood.send(b"DRIVE {Light True}\r\n")
    assert await flood.until(b"{LightToggle True}")


async def test_random_bytes_disturb_nobody(floor: TraversabilityMap) -> None:
    other, wild = await floor.driver(), await floor.peer()
    rng = np.random.Generator(np.random.PCG64(1))
    for _ in range(20):
        await wild.send(rng.bytes(3000) + b"\r\n")
    assert_every_scan_came(await other.scans(5))
    await wild.send(b"\r\nGETSTARTPOSES\r\n")
    assert await wild.until(b"StartPoses") == STARTS


async def test_what_had_no_effect_is_logged_once_for_each_kind_and_client(
    floor: TraversabilityMap, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(2):
        peer = await floor.peer()
        await peer.send(b"FOO\r\nBAR\r\nDRIVE {Left x}\r\nDRIVE {Left y}\r\n")
        await peer.send(b"DRIVE {Left 1} {Right 1}\r\nGETSTARTPOSES\r\n")
        await peer.until(b"StartPoses")
    texts = [record.getMessage().split(": ", 1)[1] for record in caplog.records]
    assert [text[:30] for text in texts] == 2 * [
        "verb 'FOO', expected one of ['",
        "DRIVE Left: 'x', expected a nu",
        "DRIVE without a robot, expecte",
    ]


async def test_commands_that_waited_are_logged_too(
    floor: TraversabilityMap, caplog: pytest.LogCaptureFixture
) -> None:
    peer = await floor.peer()
    await peer.send(INIT * 2 + b"FOO\r\n")
    await floor.comes_true(lambda: "verb 'FOO'" in caplog.text)


class Talkative(Host):
    """Finds ever new things to notice."""

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        super().receive(number, data)
        return [Diagnostic(f"kind {k}", f"kind {k}") for k in range(1000)]


async def test_the_kinds_logged_of_one_client_are_few(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(Talkative(empty_room)) as floor:
        peer = await floor.peer()
        await peer.send(b"GETSTARTPOSES\r\n")
        await peer.until(b"StartPoses")
        assert len(caplog.records) == 50


async def test_too_many_clients_are_turned_away(
    floor: TraversabilityMap,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.server.tcp_server.MAX_CLIENTS", 2)
    first, second, third = [await floor.peer() for _ in range(3)]
    assert await first.line() == GREETING
    assert await second.line() == GREETING
    with suppress(ConnectionError):
        assert await third.rest() == b""
    assert "refused: there are 2 clients" in caplog.text
    second.writer.close()
    await second.writer.wait_closed()
    await floor.comes_true(lambda: len(floor.peers) == 3)
    await asyncio.sleep(0.05)
    assert await (await floor.peer()).line() == GREETING


async def test_a_taken_port_is_said_in_one_sentence(floor: TraversabilityMap) -> None:
    port = floor.server.address[1]
    with pytest.raises(ServerError) as caught:
        await Server(floor.host).start(port=port)
    text = str(caught.value)
    assert text.startswith(f"cannot listen on 127.0.0.1:{port}: ")
    assert "address already in use" in text.lower()
    assert "\n" not in text


async def test_an_address_that_is_not_ours_is_said(empty_room: Scene) -> None:
    server = Server(Host(empty_room))
    with pytest.raises(ServerError, match=r"cannot listen on 192\.0\.2\.1:0: "):
        await server.start("192.0.2.1", 0)
    await server.stop()


async def test_it_stops_at_once_with_robots_on_the_floor(
    floor: TraversabilityMap,
) -> None:
    peers = [await floor.driver() for _ in range(4)]
    async with asyncio.timeout(1):
        await floor.server.stop()
        for peer in peers:
            with suppress(ConnectionError):
                while await peer.reader.read(4096):
                    pass
    assert floor.robots == 0
    with pytest.raises(ConnectionError):
        await floor.peer()


async def test_simulated_time_keeps_the_pace_of_the_clock(empty_room: Scene) -> None:
    async with running(Host(empty_room), speed=10) as floor:
        await asyncio.sleep(0.1)
        start, began = floor.host.simulation.time, asyncio.get_running_loop().time()
        await asyncio.sleep(0.5)
        passed = floor.host.simulation.time - start
        elapsed = asyncio.get_running_loop().time() - began
    assert 0.5 < passed / (10 * elapsed) < 1.2  # below 1 where the machine is busy


async def test_a_clock_that_is_too_late_says_so_and_goes_on(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(Host(empty_room), speed=1e9) as floor:
        peer = await floor.driver()
        await floor.comes_true(lambda: "too slow: simulated time waited" in caplog.text)
        assert_every_scan_came(await peer.scans(50))
    assert len(caplog.records) <= 2


class Broken(Host):
    """Stops working after a while."""

    def step(self) -> list[tuple[int, Diagnostic]]:
        if self.simulation.ticks == 5:
            raise RuntimeError("broken")
        return super().step()


async def test_a_bug_in_a_tick_is_told_to_who_waits_for_it(empty_room: Scene) -> None:
    server = Server(Broken(empty_room))
    await server.wait_failed()  # nothing can fail before the start
    await server.start(port=0)
    with pytest.raises(RuntimeError, match="broken"):
        await server.wait_failed()
    await server.stop()


def test_a_connection_that_is_not_served_does_nothing(empty_room: Scene) -> None:
    connection = Connection(Host(empty_room), set(), 0)
    connection.get_buffer(-1)[:6] = b"INIT\r\n"
    connection.buffer_updated(6)
    connection.flush()
    connection.close()
    assert not connection.eof_received()
    connection.connection_lost(None)
