"""Every byte passes the proxy, in order, whatever the connections do."""

import asyncio
import logging
import os
import signal
import socket
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.autonomy.proxy import TcpProxy, forward_until_signal
from radarsim.autonomy.proxy.line_queue import Side
from radarsim.errors import ServerError
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.tcp_server import Server

GREETING = b"NFO {Gametype BotDeathMatch} {Level DM-EmptyRoom} {TimeLimit 0}\r\n"
INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"
MUCH = 20_000_000
PIECES = st.binary(max_size=2000) | st.binary(max_size=4).map(lambda b: b * 30_000)
STEPS = st.lists(st.tuples(st.sampled_from(["client", "server"]), PIECES), max_size=12)


class Peer:
    """A client, or the server's side of a connection."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.reader = reader
        self.writer = writer

    async def send(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def get(self, count: int) -> bytes:
        return await asyncio.wait_for(self.reader.readexactly(count), 5)

    async def until(self, part: bytes) -> bytes:
        while part not in (line := await asyncio.wait_for(self.reader.readline(), 5)):
            assert line
        return line

    async def rest(self) -> bytes:
        """Read to the end of the connection."""
        return await asyncio.wait_for(self.reader.read(), 10)

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


class ProxySetup:
    """A server, clients, and the proxy between them."""

    def __init__(self) -> None:
        self.received: dict[tuple[int, Side], bytearray] = {}
        self.peers: list[Peer] = []
        self.arrivals: asyncio.Queue[Peer] = asyncio.Queue()
        self.proxy = TcpProxy(("", 0), self.on_data)

    def on_data(self, number: int, side: Side, data: bytes) -> None:
        self.received.setdefault((number, side), bytearray()).extend(data)

    def observed(self, number: int) -> tuple[bytes, bytes]:
        """Return the observed data of a connection, of the client and the server."""
        client = self.received.get((number, "client"), b"")
        return bytes(client), bytes(self.received.get((number, "server"), b""))

    async def client(self) -> Peer:
        peer = Peer(*await asyncio.open_connection(*self.proxy.address, limit=2**14))
        self.peers.append(peer)
        return peer

    async def pair(self) -> tuple[Peer, Peer]:
        """Return a client and the server's side of its connection."""
        client = await self.client()
        return client, await asyncio.wait_for(self.arrivals.get(), 5)

    def arrive(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        peer = Peer(reader, writer)
        self.peers.append(peer)
        self.arrivals.put_nowait(peer)


async def wait_until(condition: Callable[[], bool]) -> None:
    for _ in range(500):
        if condition():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("the condition does not become true")


@asynccontextmanager
async def opened() -> AsyncIterator[ProxySetup]:
    proxy_setup = ProxySetup()
    server = await asyncio.start_server(proxy_setup.arrive, "127.0.0.1", 0, limit=2**14)
    proxy_setup.proxy = TcpProxy(server.sockets[0].getsockname(), proxy_setup.on_data)
    await proxy_setup.proxy.start()
    try:
        yield proxy_setup
    finally:
        await proxy_setup.proxy.stop()
        server.close()
        for peer in proxy_setup.peers:
            peer.transport.abort()
        for peer in proxy_setup.peers:
            with suppress(OSError):
                await peer.writer.wait_closed()


@pytest.fixture
async def proxy_setup() -> AsyncIterator[ProxySetup]:
    async with opened() as proxy_setup:
        yield proxy_setup


@asynccontextmanager
async def proxy_for(address: tuple[str, int]) -> AsyncIterator[ProxySetup]:
    """Start a proxy for an address where a server is, or is not."""
    proxy_setup = ProxySetup()
    proxy_setup.proxy = TcpProxy(address, proxy_setup.on_data)
    await proxy_setup.proxy.start()
    try:
        yield proxy_setup
    finally:
        for peer in proxy_setup.peers:
            peer.writer.close()
        await proxy_setup.proxy.stop()
        for peer in proxy_setup.peers:
            with suppress(OSError):
                await peer.writer.wait_closed()


async def exchange(steps: list[tuple[str, bytes]]) -> None:
    sent = {"client": b"", "server": b""}
    async with opened() as proxy_setup:
        client, server = await proxy_setup.pair()
        peers = {"client": client, "server": server}
        reading = [asyncio.create_task(peer.rest()) for peer in (server, client)]
        for side, data in steps:
            await peers[side].send(data)
            sent[side] += data
        for peer in peers.values():
            peer.writer.write_eof()
        words = (sent["client"], sent["server"])
        assert tuple(await asyncio.gather(*reading)) == words
        assert proxy_setup.observed(1) == words
        await wait_until(lambda: proxy_setup.proxy.connections == 0)


@given(STEPS)
@settings(max_examples=40)
def test_both_sides_receive_what_the_other_sends(
    steps: list[tuple[str, bytes]],
) -> None:
    asyncio.run(exchange(steps))


async def test_large_data_passes_in_both_directions_at_once(
    proxy_setup: ProxySetup,
) -> None:
    client, server = await proxy_setup.pair()
    up, down = b"up" * 3_000_000, b"down" * 1_000_000
    reading = [asyncio.create_task(peer.rest()) for peer in (server, client)]
    await asyncio.gather(client.send(up), server.send(down))
    client.writer.write_eof()
    server.writer.write_eof()
    assert (
        tuple(await asyncio.gather(*reading)) == (up, down) == proxy_setup.observed(1)
    )


async def test_single_bytes_are_forwarded_at_once(proxy_setup: ProxySetup) -> None:
    client, server = await proxy_setup.pair()
    loop = asyncio.get_running_loop()
    began = loop.time()
    for k in range(200):
        await client.send(bytes([k]))
        assert await server.get(1) == bytes([k])
        await server.send(bytes([k]))
        assert await client.get(1) == bytes([k])
    assert loop.time() - began < 2  # any waiting for more to come takes 40 ms a time


@pytest.mark.parametrize("first", ["client", "server"])
async def test_half_closed_connection_still_receives(
    proxy_setup: ProxySetup, first: str
) -> None:
    one, other = await proxy_setup.pair()
    if first == "server":
        one, other = other, one
    await one.send(b"last words")
    one.writer.write_eof()
    assert await other.rest() == b"last words"
    await asyncio.sleep(0.02)
    for _ in range(3):
        await other.send(b"answer")
        assert await one.get(6) == b"answer"
    assert proxy_setup.proxy.connections == 2
    other.writer.write_eof()
    assert await one.rest() == b""
    await wait_until(lambda: proxy_setup.proxy.connections == 0)


async def test_data_sent_before_the_server_accepts_arrives(
    proxy_setup: ProxySetup,
) -> None:
    client = await proxy_setup.client()
    await client.send(b"impatient")
    client.writer.write_eof()
    server = await proxy_setup.arrivals.get()
    assert await server.rest() == b"impatient"


@pytest.mark.parametrize("broken", ["client", "server"])
async def test_broken_connection_ends_the_other_after_its_data(
    proxy_setup: ProxySetup, broken: str
) -> None:
    for number in range(1, 21):
        one, other = await proxy_setup.pair()
        if broken == "server":
            one, other = other, one
        await other.send(
            b"x" * 20_000
        )  # closing with unread data breaks the connection
        await one.send(b"last words")
        one.reset()
        assert await other.rest() == b"last words"
        assert b"last words" in proxy_setup.observed(number)
        other.writer.close()
    await wait_until(lambda: proxy_setup.proxy.connections == 0)


async def test_break_noticed_by_writing_loses_no_data(
    proxy_setup: ProxySetup,
) -> None:
    client, server = await proxy_setup.pair()
    talking = asyncio.create_task(talk(server))
    await client.get(100)
    client.transport.pause_reading()
    await client.send(b"last words")
    client.reset()
    assert await server.rest() == b"last words"
    talking.cancel()


async def test_late_reader_gets_all_data_after_a_break(proxy_setup: ProxySetup) -> None:
    client, server = await proxy_setup.pair()
    await server.send(b"x" * 20_000)
    sending = asyncio.create_task(client.send(b"last words" * 500_000))
    await wait_until(lambda: len(proxy_setup.observed(1)[0]) > 100_000)
    await asyncio.sleep(0.05)
    client.reset()
    with suppress(ConnectionError):
        await sending
    await server.send(b"x" * 20_000)
    await asyncio.sleep(0.05)
    words = await server.rest()
    assert words == proxy_setup.observed(1)[0]
    assert len(words) > 100_000


async def talk(peer: Peer) -> None:
    with suppress(ConnectionError):
        while True:
            await peer.send(b"x" * 1000)


async def test_peer_that_does_not_close_is_closed_soon(
    proxy_setup: ProxySetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.autonomy.proxy.tcp_proxy.CLOSE_GRACE", 0.05)
    client, server = await proxy_setup.pair()
    talking = asyncio.create_task(talk(server))
    await client.get(100)
    client.reset()
    await wait_until(lambda: proxy_setup.proxy.connections == 0)
    await wait_until(talking.done)


async def test_slow_reader_slows_only_its_sender(
    proxy_setup: ProxySetup,
) -> None:
    slow, server = await proxy_setup.pair()
    other, other_server = await proxy_setup.pair()
    slow.transport.pause_reading()
    sent = bytes(range(250)) * (MUCH // 250)
    sending = asyncio.create_task(server.send(sent))
    for _ in range(50):
        await other_server.send(b"tick")
        assert await other.get(4) == b"tick"
    await slow.send(b"still here")  # the other direction is free
    assert await server.get(10) == b"still here"
    await asyncio.sleep(0.1)
    assert not sending.done()
    assert len(proxy_setup.observed(1)[1]) < MUCH / 2
    slow.transport.resume_reading()
    assert await slow.get(MUCH) == sent
    await sending


async def test_client_is_closed_when_the_server_is_not_there(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = taken.getsockname()
    async with proxy_for(address) as proxy_setup:
        client = await proxy_setup.client()
        with suppress(ConnectionError):
            assert await client.rest() == b""
    assert f"no server at 127.0.0.1:{address[1]}: " in caplog.text


@asynccontextmanager
async def silent_address() -> AsyncIterator[tuple[str, int]]:
    """Yield an address where connections are neither accepted nor refused."""
    loop = asyncio.get_running_loop()
    with socket.create_server(("127.0.0.1", 0), backlog=0) as listener:
        waiting = [socket.socket() for _ in range(3)]
        address = listener.getsockname()
        for sock in waiting:
            sock.setblocking(False)
            with suppress(TimeoutError):
                await asyncio.wait_for(loop.sock_connect(sock, address), 0.05)
        try:
            yield address
        finally:
            for sock in waiting:
                sock.close()


async def test_connecting_to_a_silent_server_times_out(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.autonomy.proxy.tcp_proxy.CONNECT_TIMEOUT", 0.1)
    async with silent_address() as address, proxy_for(address) as proxy_setup:
        client = await proxy_setup.client()
        with suppress(ConnectionError):
            assert await client.rest() == b""
    assert "no answer in time" in caplog.text


async def test_proxy_stops_at_once_with_clients_connected(
    proxy_setup: ProxySetup,
) -> None:
    pairs = [await proxy_setup.pair() for _ in range(3)]
    talking = [asyncio.create_task(talk(peer)) for pair in pairs for peer in pair]
    await asyncio.sleep(0.05)
    async with silent_address() as address, proxy_for(address) as waiting:
        late = await waiting.client()
        await asyncio.sleep(0.02)
        async with asyncio.timeout(1):
            await waiting.proxy.stop()
            await proxy_setup.proxy.stop()
        with suppress(ConnectionError):
            assert await late.rest() == b""
    for task in talking:
        await asyncio.wait_for(task, 5)
    assert proxy_setup.proxy.connections == 0
    with pytest.raises(ConnectionError):
        await proxy_setup.client()


async def test_taken_port_is_a_server_error(proxy_setup: ProxySetup) -> None:
    host, port = proxy_setup.proxy.address
    proxy = TcpProxy((host, 1), proxy_setup.on_data)
    with pytest.raises(ServerError, match=f"cannot listen on 127.0.0.1:{port}: "):
        await proxy.start(port=port)
    await proxy.stop()


async def test_simultaneous_probes_are_answered_independently(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.autonomy.proxy")
    server = Server(Host(empty_room))
    await server.start(port=0)
    try:
        async with proxy_for(server.address) as proxy_setup:
            answers = await asyncio.gather(*[probe(proxy_setup) for _ in range(16)])
            assert len(set(answers)) == 1
            assert answers[0].startswith(GREETING + b"NFO {StartPoses 3}")
            assert {len(proxy_setup.observed(n)[1]) for n in range(1, 17)} == {
                len(answers[0])
            }
            await wait_until(lambda: proxy_setup.proxy.connections == 0)
    finally:
        await server.stop()
    assert "connected as number 16" in caplog.text


async def probe(proxy_setup: ProxySetup) -> bytes:
    client = await proxy_setup.client()
    await client.send(b"GETSTARTPOSES\r\n")
    client.writer.write_eof()
    return await client.rest()


async def test_robot_is_removed_with_its_client(empty_room: Scene) -> None:
    host = Host(empty_room)
    server = Server(host, speed=5)
    await server.start(port=0)
    try:
        async with proxy_for(server.address) as proxy_setup:
            for leave in (Peer.reset, lambda peer: peer.writer.close()):
                client = await proxy_setup.client()
                await client.send(INIT)
                await client.until(b"{Type RangeScanner}")
                assert len(host.simulation.vehicles) == 1
                leave(client)
                await wait_until(lambda: not host.simulation.vehicles)
    finally:
        await server.stop()


@pytest.mark.parametrize(
    ("number", "code"),
    [
        pytest.param(signal.SIGINT, 130, id="interrupt"),
        pytest.param(signal.SIGTERM, 0, id="terminate"),
    ],
)
async def test_signal_ends_the_proxy_with_its_exit_code(number: int, code: int) -> None:
    announced: list[tuple[str, int]] = []
    before = signal.getsignal(number)

    def announce(address: tuple[str, int]) -> None:
        announced.append(address)
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # some people press Ctrl-C twice

    proxy = TcpProxy(("127.0.0.1", 1), lambda *_: None)
    assert await forward_until_signal(proxy, "127.0.0.1", 0, announce) == code
    ((host, port),) = announced
    assert host == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, port), 1)
    assert signal.getsignal(number) == before


async def test_taken_port_fails_before_the_announcement() -> None:
    announced: list[tuple[str, int]] = []
    before = signal.getsignal(signal.SIGINT)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        proxy = TcpProxy(("127.0.0.1", 1), lambda *_: None)
        with pytest.raises(ServerError, match=f"cannot listen on 127.0.0.1:{port}"):
            await forward_until_signal(proxy, "127.0.0.1", port, announced.append)
    assert announced == []
    assert signal.getsignal(signal.SIGINT) == before
