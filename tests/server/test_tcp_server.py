"""The TCP server with real clients, which must not disturb each other."""

import asyncio
import logging
import re
import socket
import struct
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

import numpy as np
import pytest
from host_client import GREETING, STARTS
from peers import DEADLINE, Peer, wait_until

from radarsim.errors import ServerError
from radarsim.geometry import Pose2
from radarsim.listening import raise_file_limit
from radarsim.presets.robots import load_robot
from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.tcp_server import MAX_CLIENTS, Connection, Server
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.vehicle import DueItems, Vehicle

INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"
LONG_LINES = SimulationConfig(item_settings={"lms200": {"resolution_deg": 0.1}})
TIME = re.compile(rb"SEN {Time ([0-9.]+)} {Type RangeScanner}")


class RunningServer:
    """A running server and its clients."""

    def __init__(self, host: Host, server: Server) -> None:
        self.host = host
        self.server = server
        self.peers: list[Peer] = []

    async def peer(self, *, small: bool = False) -> Peer:
        self.peers.append(await Peer.connect(self.server.address, small=small))
        return self.peers[-1]

    async def driver(self, init: bytes = INIT) -> Peer:
        peer = await self.peer()
        await peer.send(init)
        await peer.until(b"STA ")
        return peer

    @property
    def robots(self) -> int:
        return len(self.host.simulation.vehicles)


@asynccontextmanager
async def serving(
    host: Host, *, speed: float = 5.0, max_clients: int = MAX_CLIENTS
) -> AsyncIterator[RunningServer]:
    server = Server(host, speed=speed, max_clients=max_clients)
    await server.start(port=0)
    running_server = RunningServer(host, server)
    try:
        yield running_server
    finally:
        for peer in running_server.peers:
            peer.writer.close()
        await server.stop()
        for peer in running_server.peers:
            await peer.close()


@pytest.fixture
async def running_server(empty_room: Scene) -> AsyncIterator[RunningServer]:
    async with serving(Host(empty_room)) as running_server:
        yield running_server


async def scans(peer: Peer, count: int) -> list[float]:
    """Return the times of the next scans."""
    lines = [await peer.until(b"{Type RangeScanner}") for _ in range(count)]
    return [float(match[1]) for line in lines if (match := TIME.match(line))]


def assert_every_scan_came(times: list[float]) -> None:
    assert np.diff(times) == pytest.approx(0.1)


async def test_robot_of_a_broken_connection_is_removed(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    other = await running_server.driver(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    broken = await running_server.driver()
    assert running_server.robots == 2
    broken.reset()
    await wait_until(lambda: running_server.robots == 1)
    assert_every_scan_came(await scans(other, 5))
    assert "disconnected: [Errno" in caplog.text
    again = await running_server.driver()
    assert await again.until(b"{Location -8.0000,0.0000,")
    again.writer.close()
    await wait_until(lambda: running_server.robots == 1)
    assert "disconnected: closed by the client" in caplog.text


async def test_client_that_closes_its_side_gets_replies_to_commands_that_waited(
    running_server: RunningServer,
) -> None:
    peer = await running_server.peer()
    await peer.send(b"GETSTARTPOSES\r\n" * 100)
    peer.writer.write_eof()
    assert await peer.rest() == GREETING + 100 * STARTS


async def test_client_that_closes_its_side_is_removed_when_it_does_not_read(
    running_server: RunningServer,
) -> None:
    peer = await running_server.peer(small=True)
    await peer.send(INIT)
    await wait_until(lambda: running_server.robots == 1)
    peer.transport.pause_reading()
    sent_after = running_server.host.simulation.time + 2.5
    await wait_until(lambda: running_server.host.simulation.time > sent_after)
    peer.writer.write_eof()
    await wait_until(lambda: running_server.robots == 0)


@pytest.mark.slow
async def test_client_that_reads_the_rest_late_is_not_closed_twice(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits when it closes its side is still sent; then the connection is lost."""
    monkeypatch.setattr("radarsim.server.peer_connections.CLOSE_GRACE", 1.0)
    errors: list[dict[str, object]] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: errors.append(context))
    host = Host(empty_room, config=LONG_LINES)
    async with serving(host) as running_server:
        peer = await running_server.peer(small=True)
        await peer.send(INIT)
        await wait_until(lambda: running_server.robots == 1)
        peer.transport.pause_reading()
        await wait_until(lambda: host.unsent_bytes(1) > 0)
        peer.writer.write_eof()
        await wait_until(lambda: running_server.robots == 0)
        peer.transport.resume_reading()
        await peer.rest()
        await asyncio.sleep(1.2)
    assert errors == []


async def test_client_that_does_not_read_does_not_delay_others(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    async with serving(Host(empty_room, config=LONG_LINES)) as running_server:
        deaf = await running_server.peer(small=True)
        await deaf.send(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
        deaf.transport.pause_reading()
        other = await running_server.driver()
        await scans(other, 1)
        times: list[float] = []
        while running_server.host.dropped_readings(1) == 0:
            times += await scans(other, 5)
        assert_every_scan_came(times)
        assert running_server.host.unsent_bytes(1) < 300_000
        deaf.reset()
        await wait_until(lambda: running_server.robots == 1)
        assert "unread readings were dropped" in caplog.text


async def test_client_that_reads_late_gets_whole_and_newest_lines(
    empty_room: Scene,
) -> None:
    async with serving(Host(empty_room, config=LONG_LINES)) as running_server:
        late = await running_server.peer(small=True)
        await late.send(INIT)
        late.transport.pause_reading()
        await wait_until(lambda: running_server.host.dropped_readings(1) > 0)
        missed_until = running_server.host.simulation.time
        late.transport.resume_reading()
        times: list[float] = []
        while not times or times[-1] < missed_until:
            line = await late.line()
            assert re.fullmatch(rb"(NFO|STA|SEN) \{.*\}\r\n", line)
            times += [float(match[1]) for match in TIME.finditer(line)]
        gaps = np.diff(times)
        assert gaps.min() == pytest.approx(0.1)
        assert gaps.max() > 0.5


async def test_endless_line_closes_only_its_connection(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    other, bad = await running_server.driver(), await running_server.peer()
    with suppress(ConnectionError):
        await bad.send(b"x" * 70_000)
        await bad.rest()
    assert_every_scan_came(await scans(other, 5))
    assert "expected at most 65536" in caplog.text
    assert "closed: a line without end" in caplog.text


async def test_request_of_a_web_page_is_closed_and_drives_no_robot(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    other, page = await running_server.driver(), await running_server.peer()
    assert await page.line() == GREETING
    await page.send(
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1:3000\r\nOrigin: http://a.example\r\n\r\n"
        b"INIT {ClassName P3AT} {Location 0,0,0}\r\nDRIVE {Left 3} {Right 3}\r\n"
    )
    assert await page.rest() == b""
    assert_every_scan_came(await scans(other, 5))
    assert running_server.robots == 1
    (line,) = [record for record in caplog.messages if "HTTP" in record]
    assert "closed" in line


async def test_flood_of_commands_does_not_delay_others(
    running_server: RunningServer,
) -> None:
    other, flood = await running_server.driver(), await running_server.peer()
    await flood.send(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    drives = [b"DRIVE {Left %d} {Right %d}\r\n" % (k, -k) for k in range(3000)]
    sending = asyncio.create_task(flood.send(b"".join(drives)))
    assert_every_scan_came(await scans(other, 10))
    await sending
    await flood.send(b"DRIVE {Light True}\r\n")
    assert await flood.until(b"{LightToggle True}")


async def test_diagnostics_are_logged_once_for_each_kind_and_client(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(2):
        peer = await running_server.peer()
        await peer.send(b"FOO\r\nBAR\r\nDRIVE {Left x}\r\nDRIVE {Left y}\r\n")
        await peer.send(b"DRIVE {Left 1} {Right 1}\r\nGETSTARTPOSES\r\n")
        await peer.until(b"StartPoses")
    texts = [text.split(": ", 1)[1] for text in caplog.messages if "slow" not in text]
    assert [text[:30] for text in texts] == 2 * [
        "verb 'FOO', expected one of ['",
        "DRIVE Left: 'x', expected a nu",
        "DRIVE without a robot, expecte",
    ]


async def test_diagnostics_of_commands_that_waited_are_logged(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    peer = await running_server.peer()
    await peer.send(INIT * 2 + b"FOO\r\n")
    await wait_until(lambda: "verb 'FOO'" in caplog.text)


def test_robots_for_which_nobody_waits_any_more_delay_no_other(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    model, crowded = load_robot("P3AT"), Pose2(5.0, 0.0, 0.0)
    while host.simulation.spawn("other", model, crowded):
        pass  # until no place is free there

    def ticks_to_spawn() -> int:
        number, ticks = host.connect(), 0
        host.receive(number, INIT)
        while b"STA " not in host.take(number):
            host.step()
            ticks += 1
        host.disconnect(number)
        return ticks

    alone = ticks_to_spawn()
    for _ in range(1000):
        number = host.connect()
        host.receive(number, b"INIT {ClassName P3AT} {Location 5,0,0}\r\n")
        host.disconnect(number)
    assert ticks_to_spawn() <= 2 * alone + 1


@pytest.mark.parametrize("broken", [False, True])
async def test_closed_connection_gives_up_its_place_while_its_init_waits(
    empty_room: Scene, caplog: pytest.LogCaptureFixture, broken: bool
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    host = Host(empty_room)
    async with serving(host, max_clients=1) as running_server:
        peer = await running_server.peer()
        await peer.send(b"GETSTARTPOSES\r\n" + INIT + b"GETSTARTPOSES\r\n")
        await peer.until(STARTS)
        if broken:
            peer.reset()
        else:
            peer.writer.close()
        await wait_until(lambda: "disconnected" in caplog.text)
        assert await (await running_server.peer()).line() == GREETING


class Busy(Host):
    """A host in which what a client has sent takes without end."""

    def is_busy(self, number: int) -> bool:  # noqa: ARG002 - of every client
        return True


async def test_what_a_closed_client_had_sent_ends_in_time(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    async with serving(Busy(empty_room)) as running_server:
        peer = await running_server.peer()
        await peer.until(GREETING)
        await peer.send(b"DRIVE {Left 1} {Right 1}\r\n" * 100)
        peer.writer.close()
        await wait_until(lambda: "disconnected" in caplog.text)


async def test_flood_is_closed(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    """What it has sent would be executed for minutes after its end."""
    async with serving(Busy(empty_room)) as running_server:
        peer, modest = [await running_server.peer() for _ in range(2)]
        await modest.send(b"DRIVE {Left 1} {Right 1}\r\n" * 900)
        with suppress(ConnectionError):
            await peer.send(b"DRIVE {Left 1} {Right 1}\r\n" * 900_000)
        await wait_until(lambda: "too many commands" in caplog.text)
        await peer.rest()
        assert await modest.line() == GREETING
        assert caplog.text.count("too many commands") == 1


async def test_robot_of_a_flood_ends_in_time_once_its_client_has_gone(
    running_server: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    loop = asyncio.get_running_loop()
    drives = b"DRIVE {Left 1} {Right 1}\r\n" * 1_000_000
    with socket.create_connection(running_server.server.address) as flood:
        flood.setblocking(False)
        await loop.sock_sendall(flood, INIT)
        await wait_until(lambda: running_server.robots == 1)
        began = running_server.host.simulation.time
        with suppress(TimeoutError):
            async with asyncio.timeout(2):
                await loop.sock_sendall(flood, drives)
        assert running_server.robots == 1  # whose client has gone on sending
    await wait_until(lambda: running_server.robots == 0)
    assert running_server.host.simulation.time > began


async def test_error_of_one_robot_closes_its_connection_with_a_message(
    running_server: RunningServer,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    good, bad = [await running_server.driver() for _ in range(2)]
    failing = running_server.host.simulation.vehicles[1]
    due = Vehicle.due

    def fail(vehicle: Vehicle) -> DueItems:
        if vehicle is failing:
            raise ArithmeticError("a bug")
        return due(vehicle)

    monkeypatch.setattr(Vehicle, "due", fail)
    last = (await bad.rest()).splitlines()[-1]
    assert last.startswith(b"NFO {Error an error in the server, which is a bug")
    assert "closed: an error in the server: ArithmeticError: a bug" in caplog.text
    assert "Traceback" in caplog.text
    assert_every_scan_came(await scans(good, 3))
    assert running_server.robots == 1


@pytest.mark.slow
async def test_five_thousand_connections_come_and_go(
    running_server: RunningServer,
) -> None:
    other = await running_server.driver()
    address, loop = running_server.server.address, asyncio.get_running_loop()

    def come_and_go() -> None:
        for number in range(5000):
            with suppress(ConnectionError), socket.create_connection(address) as sock:
                if number % 3:
                    sock.sendall(INIT[: number % len(INIT)])
                if number % 2:
                    linger = struct.pack("ii", 1, 0)
                    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)

    coming = loop.run_in_executor(None, come_and_go)
    while not coming.done():
        assert_every_scan_came(await scans(other, 5))
    await coming
    again = await running_server.driver(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    assert_every_scan_came(await scans(again, 5))
    await wait_until(lambda: running_server.robots == 2)


async def test_two_hundred_connect_at_the_same_time(
    running_server: RunningServer,
) -> None:
    peers = await asyncio.gather(*(running_server.peer() for _ in range(200)))
    for peer in peers:
        assert await peer.line() == GREETING


async def test_robots_of_clients_that_never_read_do_not_fill_the_memory(
    empty_room: Scene,
) -> None:
    host = Host(empty_room, config=LONG_LINES)
    async with serving(host, speed=50) as running_server:
        deaf = [await running_server.peer(small=True) for _ in range(20)]
        for index, peer in enumerate(deaf):
            place = b"{Location %d,%d,0}" % (index % 5 * 2 - 4, index // 5 * 2 - 4)
            await peer.send(b"INIT {ClassName P3AT} %b\r\n" % place)
            peer.transport.pause_reading()
        numbers = range(1, len(deaf) + 1)
        await wait_until(
            lambda: all(host.dropped_readings(number) for number in numbers)
        )
        assert max(host.unsent_bytes(number) for number in numbers) < 300_000
        for peer in deaf:
            peer.reset()
        await wait_until(lambda: running_server.robots == 0)


class Counting(Host):
    """Counts the bytes that are read between two ticks."""

    read: tuple[int, ...] = (0,)

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        self.read = (*self.read[:-1], self.read[-1] + len(data))
        return super().receive(number, data)

    def step(self, *, passes: bool = True) -> list[tuple[int, Diagnostic]]:
        self.read = (*self.read, 0)
        return super().step(passes=passes)


async def test_flood_of_blank_lines_is_read_in_small_pieces(empty_room: Scene) -> None:
    host = Counting(empty_room)
    async with serving(host) as running_server:
        other = await running_server.driver()
        floods = [await running_server.peer() for _ in range(20)]
        sending = [asyncio.create_task(peer.send(b" \n" * 500_000)) for peer in floods]
        await wait_until(lambda: sum(host.read) > 500_000)
        assert_every_scan_came(await scans(other, 5))
        assert max(host.read) < 100_000
        for task in sending:
            task.cancel()
        for peer in floods:
            peer.reset()


class Talkative(Host):
    """Reports 1000 kinds of diagnostics for every packet."""

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        super().receive(number, data)
        return [Diagnostic(f"kind {k}", f"kind {k}") for k in range(1000)]


async def test_number_of_logged_kinds_of_a_client_is_limited(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(Talkative(empty_room)) as running_server:
        peer = await running_server.peer()
        await peer.send(b"GETSTARTPOSES\r\n")
        await peer.until(b"StartPoses")
        assert sum(": kind " in text for text in caplog.messages) == 50


async def _greeting_or_end(peer: Peer) -> bytes:
    with suppress(ConnectionError):
        return await peer.line()
    return b""


async def test_client_is_refused_when_there_are_too_many(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(Host(empty_room), max_clients=2) as running_server:
        first, second, third = [await running_server.peer() for _ in range(3)]
        assert await first.line() == GREETING
        assert await second.line() == GREETING
        with suppress(ConnectionError):
            await third.send(INIT)
        assert await third.rest() == b""
        assert running_server.robots == 0
        assert "refused: the limit is 2 clients" in caplog.text
        await second.close()
        async with asyncio.timeout(DEADLINE):
            while await _greeting_or_end(await running_server.peer()) != GREETING:  # noqa: ASYNC110
                await asyncio.sleep(0.01)  # until the server has noticed that it left


@pytest.mark.slow
async def test_server_takes_a_thousand_clients(empty_room: Scene) -> None:
    raise_file_limit(3000)  # both ends of the connections are in this process
    async with serving(Host(empty_room), speed=1) as running_server:
        peers = [await running_server.peer() for _ in range(MAX_CLIENTS)]
        assert {await peer.line() for peer in peers} == {GREETING}
        assert await _greeting_or_end(await running_server.peer()) == b""


async def test_only_connections_with_something_to_do_are_looked_at(
    running_server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent, driver = await running_server.peer(), await running_server.driver()
    flushed: Counter[Connection] = Counter()
    flush = Connection.flush

    def count(connection: Connection, *, only_replies: bool = False) -> None:
        flushed[connection] += 1
        flush(connection, only_replies=only_replies)

    monkeypatch.setattr(Connection, "flush", count)
    assert_every_scan_came(await scans(driver, 3))
    assert len(flushed) == 1
    await silent.send(b"GETSTARTPOSES\r\n" * 50)  # as many as 20 in a tick
    for _ in range(50):
        assert await silent.until(b"NFO {StartPoses") == STARTS
    assert len(flushed) == 2


async def test_clients_of_the_host_without_a_connection_are_left_alone(
    running_server: RunningServer,
) -> None:
    host = running_server.host
    number = host.connect()
    host.receive(number, INIT + b"BOGUS\r\n" * 30)
    driver = await running_server.driver(b"INIT {ClassName P3AT} {Location 0,0,0}\r\n")
    assert_every_scan_came(await scans(driver, 3))
    assert host.take(number).startswith(GREETING)


async def test_foreign_address_is_an_error(empty_room: Scene) -> None:
    server = Server(Host(empty_room))
    with pytest.raises(ServerError, match=r"cannot listen on 192\.0\.2\.1:0: "):
        await server.start("192.0.2.1", 0)
    await server.stop()


async def test_server_stops_while_robots_are_connected(
    running_server: RunningServer,
) -> None:
    peers = [await running_server.driver() for _ in range(4)]
    async with asyncio.timeout(DEADLINE):
        await running_server.server.stop()
        for peer in peers:
            with suppress(ConnectionError):
                while await peer.reader.read(4096):
                    pass
    assert running_server.robots == 0
    with pytest.raises(ConnectionError):
        await running_server.peer()


async def test_simulated_time_follows_the_wall_clock(empty_room: Scene) -> None:
    async with serving(Host(empty_room), speed=10) as running_server:
        clock = asyncio.get_running_loop().time
        start, began = running_server.host.simulation.time, clock()
        await wait_until(lambda: running_server.host.simulation.time >= start + 5)
        elapsed = clock() - began
    assert elapsed > 0.4  # 5 s at a speed of 10; more where the machine is busy


async def test_lost_time_is_logged_and_no_scan_is_skipped(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(Host(empty_room), speed=1e9) as running_server:
        peer = await running_server.driver()
        await wait_until(lambda: "too slow: simulated time fell" in caplog.text)
        assert_every_scan_came(await scans(peer, 50))
    assert len(caplog.records) <= 5
