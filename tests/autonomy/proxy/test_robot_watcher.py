"""A robot that another client drives is watched, and its lines are passed on."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from typing import cast

import pytest

from radarsim.autonomy.proxy.line_queue import Side
from radarsim.autonomy.proxy.observer import ConnectionState
from radarsim.autonomy.proxy.traffic_mapper import RobotWatcher, watch_until_signal
from radarsim.client import AsyncClient
from radarsim.errors import ClientError
from radarsim.protocol.reports import GroundTruth
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.tcp_server import Server

DEADLINE = 240.0  # s of the wall clock, for a busy machine
GREETING = b"NFO {Gametype X} {Level DM-Odd} {TimeLimit 0}\r\n"
Talk = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class Recorder:
    """What a watcher passes on."""

    def __init__(self) -> None:
        self.state = ConnectionState(1)
        self.lines: list[bytes] = []
        self.waits = 0

    def add(self, number: int, side: Side, data: bytes) -> None:
        assert number == 1
        text = data.decode("latin-1").strip()
        if side == "client":
            assert self.state.receive_client_line(text) is not None
        else:
            assert self.state.receive_server_line(text) is not None
            self.lines.append(data)

    def wait(self) -> None:
        self.waits += 1


@asynccontextmanager
async def served(scene: Scene) -> AsyncIterator[tuple[str, int]]:
    server = Server(Host(scene), speed=5)
    await server.start(port=0)
    try:
        yield server.address
    finally:
        await server.stop()


@asynccontextmanager
async def scripted(talk: Talk) -> AsyncIterator[tuple[str, int]]:
    """Serve clients by a function."""
    talks: list[asyncio.Task[None]] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        talks.append(cast("asyncio.Task[None]", asyncio.current_task()))
        try:
            await talk(reader, writer)
            await reader.read()  # until the client closes
        finally:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[:2]
    finally:
        server.close()
        async with asyncio.timeout(DEADLINE):
            await asyncio.gather(*talks)


async def watch(address: tuple[str, int], patience: float = 0.3) -> Recorder:
    """Watch ``R1`` to the end; shall raise if that is an error."""
    recorder = Recorder()
    watcher = RobotWatcher(address, "r1", recorder.add, patience=patience)
    watcher.on_wait = recorder.wait
    async with asyncio.timeout(DEADLINE):
        await watcher.run()
    return recorder


@pytest.mark.parametrize("echoes", [True, False])
async def test_lines_of_the_robot_are_passed_on_until_it_leaves(
    foliage_room: Scene, echoes: bool
) -> None:
    recorder = Recorder()
    async with served(foliage_room) as address:
        watcher = RobotWatcher(address, "r1", recorder.add, echoes=echoes, patience=0.3)
        watcher.on_wait = recorder.wait
        watching = asyncio.ensure_future(watch_until_signal(watcher))
        async with await AsyncClient.connect(*address) as other:
            await other.spawn("P3AT", name="R2", start="RobotStart2")
            async with asyncio.timeout(DEADLINE):
                while not recorder.waits:
                    await other.read()
            async with await AsyncClient.connect(*address) as driver:
                await driver.spawn("P3AT_Radar360", name="R1", start="RobotStart1")
                async with asyncio.timeout(DEADLINE):
                    while not recorder.state.is_described("lms200"):
                        await driver.read()
                truth = await driver.wait_for(GroundTruth)
            async with asyncio.timeout(DEADLINE):
                assert await watching == 0
    assert recorder.waits == 1
    assert watcher.robot == "R1"
    assert recorder.state.asks_for_echoes("lms200") is echoes
    data = b"".join(recorder.lines)
    assert (b"{Type Echoes}" in data) is echoes
    assert b"{Location -8.0000,-3.5000," not in data  # of the other robot
    info = recorder.state.scanner("lms200")
    assert info is not None
    assert (info.max_range, len(info.angles)) == (80, 360)
    assert info.mount.x > 0
    assert f"{{Location {truth.pose.x:.4f}".encode() in data


async def test_server_that_knows_no_watchers_is_told() -> None:
    async def talk(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(GREETING)

    async with scripted(talk) as address:
        with pytest.raises(ClientError, match="WATCH"):
            await watch(address)


async def test_server_that_refuses_is_quoted() -> None:
    async def talk(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(GREETING + b"NFO {Error there are 32 watchers}\r\n")

    async with scripted(talk) as address:
        with pytest.raises(ClientError, match="there are 32 watchers"):
            await watch(address, DEADLINE)


async def test_server_that_closes_is_told() -> None:
    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        writer.close()

    async with scripted(talk) as address:
        with pytest.raises(ClientError, match="server closed"):
            await watch(address, DEADLINE)
    with pytest.raises(ClientError, match="no server at"):
        await watch(address)


async def test_line_of_another_robot_and_odd_names_are_left_out() -> None:
    status = b"STA {Type GroundVehicle} {Time %d.00} {Battery 9}\r\n"

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(GREETING + b"NFO {Watching r1} {Echoes r1}\r\n")
        writer.write(b"SEE {Robot R\xe91} " + status % 1)
        writer.write(b"SEE {Robot R2} " + status % 2)
        assert b"WATCH {Robots r1}" in await reader.readline()
        writer.write(b"NFO {Error it has left}\r\n")

    async with scripted(talk) as address:
        recorder = await watch(address, DEADLINE)
    assert recorder.lines == [status % 1]


@pytest.mark.parametrize("name", ["", "a,b"])
def test_name_that_cannot_be_sent_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="robot"):
        RobotWatcher(("127.0.0.1", 1), name, Recorder().add)
