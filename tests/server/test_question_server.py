"""USARTruth and wireless servers: programs that ask, written from the protocol."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial

import pytest
from peers import DEADLINE, Peer

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene, Victim
from radarsim.server.question_server import (
    MAX_CLIENTS,
    QuestionServer,
    truth_answer,
    wireless_answer,
)
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation

R1 = "{Name R1} {Class P3AT} {Time 0.03} {Location 1.0000,-2.0000,-0.1460} "
R1 += "{Rotation 0.0000,0.0000,-0.5000}"
R2 = "{Name R 2} {Class Talon} {Time 0.03} {Location -3.0000,0.0000,-0.1400} "
R2 += "{Rotation 0.0000,0.0000,0.0000}"


class Client(Peer):
    """A program with a connection."""

    async def ask(self, question: bytes) -> list[str]:
        """Return the lines of an answer, without its end."""
        self.writer.write(question)
        async with asyncio.timeout(DEADLINE):
            answer = await self.reader.readuntil(b"{End}\r\n")
        return answer.decode("ascii").split("\r\n")[:-2]


@asynccontextmanager
async def running(
    scene: Scene,
    dialect: Dialect = COMPAT,
    answer: Callable[[Simulation, str], bytes] = truth_answer,
) -> AsyncIterator[QuestionServer]:
    simulation = Simulation(scene, config=SimulationConfig(dialect))
    for name, kind, pose in (
        ("R1", "P3AT", Pose2(1, 2, 0.5)),
        ("R 2", "Talon", Pose2(-3, 0, 0)),
    ):
        simulation.spawn(name, load_robot(kind), pose)
    for _ in range(3):
        simulation.step()
    server = QuestionServer(partial(answer, simulation), port=0)
    await server.start()
    yield server
    await server.stop()


@asynccontextmanager
async def connected(server: QuestionServer) -> AsyncIterator[Client]:
    client = await Client.connect(server.address)
    yield client
    await client.close()


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (b"{Actors}\r\n", [R1, R2]),
        (b"{class USARBot.P3AT}\r", [R1]),
        (b"{class Pawn} {name R 2}\n", [R2]),
        (b"{Name R1} {Class Talon\n", [R1]),
        (b"\r\n", [R1, R2]),
    ],
)
async def test_questions_are_answered(
    empty_room: Scene, question: bytes, answer: list[str]
) -> None:
    async with running(empty_room) as server, connected(server) as client:
        assert await client.ask(question) == answer


@pytest.mark.parametrize(
    ("pieces", "blank"),
    [
        ([b"{Name R1}\r", b"\n{Name R1}\r\n"], 0),
        ([b"{Name R1}\n\r{Name R1}\n\r"], 0),
        ([b"{Name R1}\n", b"\r{Name", b" R1}\r\n"], 0),
        ([b"  ", b"\n{Name R1}", b"\r\n\r\n{Name R1}\n\n"], 3),
    ],
)
async def test_blank_lines_differ_from_the_ends_of_lines(
    pieces: list[bytes], blank: int
) -> None:
    asked: list[str] = []

    def answer(line: str) -> bytes:
        asked.append(line)
        return b"{End}\r\n"

    server = QuestionServer(answer, port=0)
    await server.start()
    async with connected(server) as client:
        for piece in pieces:
            client.writer.write(piece)
            await asyncio.sleep(0.03)  # most often a packet of its own
        for _ in range(2 + blank):
            await client.ask(b"")
    await server.stop()
    assert [each for each in asked if each] == ["{Name R1}"] * 2
    assert asked.count("") == blank


async def test_victims_are_reported_with_their_direction(empty_room: Scene) -> None:
    victim = Victim("Becky", (-4.0, 0.5, 0.1), yaw=1.0)
    scene = replace(empty_room, victims=(victim,))
    async with running(scene) as server, connected(server) as client:
        (line,) = await client.ask(b"{Class Victim}\r\n")
    assert line == (
        "{Name Becky} {Class Victim} {Time 0.03} {Location -4.0000,-0.5000,-0.1000} "
        "{Rotation 0.0000,0.0000,-1.0000}"
    )


async def test_numbers_of_the_original_have_its_decimals(empty_room: Scene) -> None:
    async with running(empty_room, UDK) as server, connected(server) as client:
        assert (await client.ask(b"{Name R1}\r"))[0] == (
            "{Name R1} {Class P3AT} {Time 0.0300} {Location 1.00,-2.00,-0.15} "
            "{Rotation 0.00,0.00,-0.50}"
        )


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


@pytest.mark.parametrize("answer", [truth_answer, wireless_answer])
async def test_request_of_a_web_page_is_closed_without_an_answer(
    empty_room: Scene,
    caplog: pytest.LogCaptureFixture,
    answer: Callable[[Simulation, str], bytes],
) -> None:
    async with (
        running(empty_room, answer=answer) as server,
        connected(server) as client,
    ):
        client.writer.write(b"POST / HTTP/1.1\r\nHost: evil.example\r\n\r\n")
        assert await client.rest() == b""
    assert "closed: an HTTP request, expected questions" in caplog.text


async def test_line_without_end_closes_the_connection(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(empty_room) as server, connected(server) as client:
        client.writer.write(b"x" * 3000)
        assert await client.rest() == b""
        assert "expected at most 1024" in caplog.text


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
        assert f"the limit is {MAX_CLIENTS} query clients" in caplog.text


R2_PLACE = "-3.0000,0.0000,-0.1400"
WALLS = (("a", 0.0, "concrete"), ("b", -1.5, "metal"), ("c", -2.0, "foliage"))


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (
            b"GETPOS\r\n",
            "POSITIONS {Robots 2} {Name R1 Location 1.0000,-2.0000,-0.1460 BatteryEmpty"
            f" False}} {{Name R 2 Location {R2_PLACE} BatteryEmpty False}}",
        ),
        (
            b"GETOBS {From R1} {To R 2}\r\n",
            "NUMOBS {From R1} {To R 2} {ObstCount 3.0000}",
        ),
        (
            b"GETOBS {Start 2,1,-1} {End -1.0,1,-1}\r\n",
            "NUMOBS {Start 2,1,-1} {End -1.0,1,-1} {ObstCount 1.0000}",
        ),
        (
            b"GETOBS {Start 900000000,1,-1} {End -900000000,1,-1}\r\n",
            "NUMOBS {Start 900000000,1,-1} {End -900000000,1,-1} {ObstCount 5.0000}",
        ),
    ],
)
async def test_wireless_server_learns_who_is_where_and_what_is_between(
    empty_room: Scene, question: bytes, answer: str
) -> None:
    scene = empty_room
    for name, x, material in WALLS:
        box = {"box": [0.2, 8.0, 2.0], "position": [x, 0.0, 1.0]}
        scene = scene.with_object(name, material=material, **box)
    smoke = {"box": [0.2, 8.0, 2.0], "position": [0.5, 0.0, 1.0]}
    scene = scene.with_object("smoke", material="smoke", **smoke)
    async with (
        running(scene, answer=wireless_answer) as server,
        connected(server) as client,
    ):
        client.writer.write(question)
        async with asyncio.timeout(DEADLINE):
            line = await client.reader.readuntil(b"\r\n")
    assert line.decode("ascii") == f"{answer}\r\n"
