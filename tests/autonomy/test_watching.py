"""A robot that another client drives is watched, and its lines are passed on."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from typing import cast

import pytest

from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.watching import RobotWatcher, WatchMapper
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
        self.lines: list[str] = []
        self.waits = 0

    def run(self, watcher: RobotWatcher) -> None:
        watcher.on_wait = self.wait
        for copies in watcher.copies():
            self.lines += [copy.line for copy in copies]

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
    async with asyncio.timeout(DEADLINE):
        watcher = RobotWatcher(address, "r1", patience=patience)
        await asyncio.to_thread(recorder.run, watcher)
    return recorder


@pytest.mark.parametrize("echoes", [True, False])
async def test_robot_is_mapped_until_it_leaves(
    foliage_room: Scene, echoes: bool
) -> None:
    follower = WatchMapper(ExplorationPlan(resolution=0.1, echoes=echoes))
    sent: list[tuple[str, bytes]] = []
    follower.on_data = lambda side, data: sent.append((side, data))
    waits: list[None] = []
    async with served(foliage_room) as address:
        watcher = RobotWatcher(address, "r1", echoes=echoes, patience=0.3)
        watcher.on_wait = lambda: waits.append(None)
        watching = asyncio.to_thread(follower.watch, watcher)
        following = asyncio.ensure_future(watching)
        async with await AsyncClient.connect(*address) as other:
            await other.spawn("P3AT", name="R2", start="RobotStart2")
            async with asyncio.timeout(DEADLINE):
                while not waits:
                    await other.read()
            async with await AsyncClient.connect(*address) as driver:
                await driver.spawn("P3AT_Radar360", name="R1", start="RobotStart1")
                async with asyncio.timeout(DEADLINE):
                    while follower.mapper is None or not follower.mapper.scans:
                        await driver.read()
                truth = await driver.wait_for(GroundTruth)
            async with asyncio.timeout(DEADLINE):
                assert await following == 0
    assert len(waits) == 1
    assert watcher.robot == "R1"
    assert follower.error == ""
    data = b"".join(line for side, line in sent if side == "server")
    assert [side for side, _ in sent].count("client") == echoes
    assert (b"{Type Echoes}" in data) is echoes
    assert b"{Location -8.0000,-3.5000," not in data  # of the other robot
    info = follower.mapper.scanner
    assert (info.name, info.max_range, len(info.angles)) == ("lms200", 80, 360)
    assert info.mount.x > 0
    assert f"{{Location {truth.pose.x:.4f}".encode() in data


@pytest.mark.parametrize(
    ("answer", "patience", "text"),
    [
        pytest.param(b"", 0.3, "WATCH", id="server that knows no watchers"),
        (b"NFO {Error there are 32 watchers}\r\n", DEADLINE, "there are 32 watchers"),
    ],
)
async def test_server_that_lets_nobody_watch_is_reported(
    answer: bytes, patience: float, text: str
) -> None:
    async def talk(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(GREETING + answer)

    async with scripted(talk) as address:
        with pytest.raises(ClientError, match=text):
            await watch(address, patience)


async def test_server_that_closes_is_reported() -> None:
    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        writer.close()

    async with scripted(talk) as address:
        with pytest.raises(ClientError, match="server closed"):
            await watch(address, DEADLINE)
    with pytest.raises(ClientError, match="no server at"):
        await watch(address)


async def test_line_of_another_robot_and_odd_names_are_left_out() -> None:
    status = b"STA {Type GroundVehicle} {Time %d.00} {Battery 9}"

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(GREETING + b"NFO {Watching r1} {Echoes r1}\r\n")
        writer.write(b"SEE {Robot R\xe91} " + status % 1 + b"\r\n")
        writer.write(b"SEE {Robot R2} " + status % 2 + b"\r\n")
        assert b"WATCH {Robots r1}" in await reader.readline()
        writer.write(b"NFO {Error it has left}\r\n")

    async with scripted(talk) as address:
        recorder = await watch(address, DEADLINE)
    assert recorder.lines == [(status % 1).decode()]


@pytest.mark.parametrize("name", ["", "a,b"])
def test_name_that_cannot_be_sent_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="robot"):
        RobotWatcher(("127.0.0.1", 1), name)
