"""USARTruth with programs that ask where robots are, written from the protocol."""

import asyncio
import logging
import re
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress

import pytest

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.truth_server import MAX_CLIENTS, TruthServer
from radarsim.simulation.simulation import Simulation

DEADLINE = 30.0  # s of the wall clock, for what a busy machine does late
R1 = "{Name R1} {Class P3AT} {Time 0.03} {Location 1.0000,-2.0000,-0.1460} "
R1 += "{Rotation 0.0000,0.0000,-0.5000}"
R2 = "{Name R 2} {Class Talon} {Time 0.03} {Location -3.0000,0.0000,-0.1400} "
R2 += "{Rotation 0.0000,0.0000,0.0000}"


class Client:
    """A program with a connection."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.reader, self.writer = reader, writer

    async def close(self) -> None:
        """Close the connection."""
        self.writer.close()
        with suppress(ConnectionError):
            await self.writer.wait_closed()

    async def ask(self, question: bytes) -> list[str]:
        """Return the lines of an answer, without its end."""
        self.writer.write(question)
        async with asyncio.timeout(DEADLINE):
            answer = await self.reader.readuntil(b"{End}\r\n")
        return answer.decode("ascii").split("\r\n")[:-2]


@asynccontextmanager
async def running(
    scene: Scene, dialect: Dialect = COMPAT
) -> AsyncIterator[TruthServer]:
    simulation = Simulation(scene)
    for name, kind, pose in (
        ("R1", "P3AT", Pose2(1, 2, 0.5)),
        ("R 2", "Talon", Pose2(-3, 0, 0)),
    ):
        simulation.spawn(name, load_robot(kind), pose)
    for _ in range(3):
        simulation.step()
    server = TruthServer(dialect, port=0)
    await server.start()
    await server.begin(simulation)
    yield server
    await server.stop()


@asynccontextmanager
async def connected(server: TruthServer) -> AsyncIterator[Client]:
    client = Client(*await asyncio.open_connection(*server.address))
    yield client
    await client.close()


@pytest.mark.asyncio
@pytest.mark.parametrize(
    ("question", "answer"),
    [
        pytest.param(b"{Actors}\r\n", [R1, R2], id="RoboCupScore"),
        pytest.param(b"{class USARBot.P3AT}\r", [R1], id="class"),
        pytest.param(b"{class Pawn} {name R 2}\n", [R2], id="name"),
        pytest.param(b"{Class Engine.Pawn}\n", [R1, R2], id="all"),
        pytest.param(b"{Class Talon}{Name R1}\n", [], id="none"),
        pytest.param(b"{Class Talon\n", [], id="no brace"),
    ],
)
async def test_questions_are_answered(
    empty_room: Scene, question: bytes, answer: list[str]
) -> None:
    async with running(empty_room) as server, connected(server) as client:
        assert await client.ask(question) == answer


@pytest.mark.asyncio
async def test_numbers_of_the_original_have_its_decimals(empty_room: Scene) -> None:
    async with running(empty_room, UDK) as server, connected(server) as client:
        assert (await client.ask(b"{Name R1}\r"))[0] == (
            "{Name R1} {Class P3AT} {Time 0.0300} {Location 1.00,-2.00,-0.15} "
            "{Rotation 0.00,0.00,-0.50}"
        )


@pytest.mark.asyncio
async def test_a_score_follows_the_robots_without_exception(empty_room: Scene) -> None:
    """RoboCupScore: asks again and again, and takes groups of keys and values."""
    async with running(empty_room) as server, connected(server) as client:
        for _ in range(20):
            for line in await client.ask(b"{Actors}\r\n"):
                fields = dict(re.findall(r"\{(\w+) ([^}]*)\}", line))
                assert len(fields["Location"].split(",")) == 3
                assert float(fields["Time"]) > 0


@pytest.mark.asyncio
async def test_before_the_simulation_there_is_nobody() -> None:
    server = TruthServer(COMPAT, port=0)
    await server.start()
    async with connected(server) as client:
        assert await client.ask(b"{Actors}\n") == []
        await server.stop()
        with suppress(ConnectionError):
            assert await client.reader.read() == b""


@pytest.mark.asyncio
async def test_flood_of_questions_is_answered_in_turns(empty_room: Scene) -> None:
    """Whoever asks without end and reads nothing holds up nobody."""
    async with (
        running(empty_room) as server,
        connected(server) as greedy,
        connected(server) as calm,
    ):
        greedy.writer.write(b"{Actors}\n" * 100_000)
        loop = asyncio.get_running_loop()
        for _ in range(5):
            start = loop.time()
            assert await calm.ask(b"{Name R1}\n") == [R1]
            assert loop.time() - start < 1.0
        for _ in range(50):
            assert await greedy.ask(b"") == [R1, R2]


@pytest.mark.asyncio
async def test_line_without_end_closes_the_connection(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(empty_room) as server, connected(server) as client:
        client.writer.write(b"x" * 3000)
        with suppress(ConnectionError):
            async with asyncio.timeout(DEADLINE):
                assert await client.reader.read() == b""
        assert "expected at most 1024" in caplog.text


@pytest.mark.asyncio
async def test_one_client_too_many_is_refused(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    async with running(empty_room) as server, AsyncExitStack() as stack:
        for _ in range(MAX_CLIENTS):
            client = await stack.enter_async_context(connected(server))
            assert await client.ask(b"{Name R1}\n") == [R1]
        last = await stack.enter_async_context(connected(server))
        with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
            await last.ask(b"{Actors}\n")
        assert f"there are {MAX_CLIENTS} clients of the truth" in caplog.text
