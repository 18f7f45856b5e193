"""Teleop at a keyboard of pipes, against real and faulty servers."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest
from prompt_toolkit.data_structures import Size
from prompt_toolkit.input import PipeInput, create_pipe_input
from prompt_toolkit.output import DummyOutput

from radarsim.addons.testing import UsarsimServer
from radarsim.client import AsyncClient, ClientError, ClientTimeout
from radarsim.client.teleop import Teleop, TeleopSettings, prepare
from radarsim.client.teleop_view import DrivenRobot
from radarsim.errors import RadarsimError
from radarsim.geometry import Pose2
from radarsim.protocol.reports import GroundTruth

GREETING = b"NFO {Gametype BotDeathMatch} {Level DM-Odd} {TimeLimit 0}\r\n"
STATUS = b"STA {Type GroundVehicle} {Time 1.00} {Battery 99}\r\n"
UP, PAGE_DOWN, ESCAPE, CTRL_C = "\x1b[A", "\x1b[6~", "\x1b", "\x03"
SETTINGS = TeleopSettings("P3AT", None, None, 0.4, "rad_per_s")


class Narrow(DummyOutput):
    """A terminal without place for the panel."""

    def get_size(self) -> Size:
        return Size(rows=10, columns=30)


def teleop(
    client: AsyncClient,
    state: DrivenRobot,
    keyboard: PipeInput,
    terminal: DummyOutput | None = None,
    silence_limit: float = 240.0,
) -> Teleop:
    terminal = terminal or DummyOutput()
    options = {"keyboard": keyboard, "terminal": terminal}
    return Teleop(client, state, 0.4, silence_limit=silence_limit, **options)  # type: ignore[arg-type]


@pytest.fixture
def keyboard() -> Iterator[PipeInput]:
    with create_pipe_input() as keys:
        yield keys


async def until(condition: Callable[[], bool], silence_limit: float = 120.0) -> None:
    async with asyncio.timeout(silence_limit):
        while not condition():  # noqa: ASYNC110 - the condition has no event
            await asyncio.sleep(0.01)


async def test_keys_drive_the_robot_and_it_stops_without_them(
    usarsim_server: UsarsimServer, keyboard: PipeInput
) -> None:
    async with await AsyncClient.connect(*usarsim_server.address) as client:
        state = await prepare(client, SETTINGS)
        driver = teleop(client, state, keyboard)
        running = asyncio.create_task(driver.run())
        await until(lambda: GroundTruth in state.poses)
        began = state.poses[GroundTruth]
        keyboard.send_text(UP)
        await until(lambda: state.poses[GroundTruth].x > began.x + 0.05)
        await until(lambda: driver.commanded == (0.0, 0.0))
        stopped = state.time
        await until(lambda: state.time > stopped + 0.2)
        there = state.poses[GroundTruth]
        await until(lambda: state.time > stopped + 0.4)
        assert state.poses[GroundTruth] == there
        assert there.x - began.x < 1.0, "one press is no journey"
        keyboard.send_text("A")
        await until(lambda: state.poses[GroundTruth].yaw > 0.02)
        keyboard.send_text("q")
        assert await running == 0


@asynccontextmanager
async def faulty_server(
    *, beats: int, drop: bool = False
) -> AsyncIterator[tuple[AsyncClient, list[bytes]]]:
    """Connect to a server that sends some lines, then nothing more, or disconnects.

    Yields the client, which has a robot, and the lines that the server received.
    """
    received: list[bytes] = []
    done = asyncio.Event()

    async def behave(
        reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        for _ in range(beats):
            writer.write(STATUS)
            await asyncio.sleep(0.02)
        if drop:
            writer.close()
        while line := await reader.readline():
            received.append(line)
        writer.close()
        done.set()

    server = await asyncio.start_server(behave, "127.0.0.1", 0)
    async with server:
        port = server.sockets[0].getsockname()[1]
        async with await AsyncClient.connect(port=port) as client:
            await client.spawn("P3AT", pose=Pose2(0.0, 0.0))
            yield client, received
        await done.wait()


@pytest.mark.parametrize("terminal", [DummyOutput(), Narrow()], ids=["wide", "narrow"])
async def test_keys_zoom_and_set_the_speed(
    state: DrivenRobot, keyboard: PipeInput, terminal: DummyOutput
) -> None:
    async with faulty_server(beats=5) as (client, _):
        driver = teleop(client, state, keyboard, terminal)
        running = asyncio.create_task(driver.run())
        assert driver.radius == 10
        keyboard.send_text("z" * 20 + "+")
        await until(lambda: driver.steering.speed > 0.4)
        assert driver.radius == 1
        keyboard.send_text("x" * 20 + PAGE_DOWN + PAGE_DOWN)
        await until(lambda: driver.steering.speed < 0.4)
        assert driver.radius == 100
        keyboard.send_text(ESCAPE)
        assert await running == 0


@pytest.mark.parametrize(
    ("text", "number", "code"),
    [
        ("q", None, 0),
        (CTRL_C, None, 130),
        (CTRL_C + "q", None, 130),
        ("", signal.SIGINT, 130),
        ("", signal.SIGTERM, 0),
    ],
)
async def test_exit_code_and_stop_command_at_the_end(
    state: DrivenRobot, keyboard: PipeInput, text: str, number: int | None, code: int
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    async with faulty_server(beats=3) as (client, received):
        driver = teleop(client, state, keyboard)
        running = asyncio.create_task(driver.run())
        while len(received) < 2:  # a busy machine may forget a key
            keyboard.send_text("W")
            await asyncio.sleep(0.05)
        keyboard.send_text(text)
        for _ in range(0 if number is None else 2):
            os.kill(os.getpid(), number or 0)
        assert await running == code
    assert received[1].startswith(b"DRIVE {Left 4.0}")
    assert received[-1].startswith(b"DRIVE {Left 0.0}")
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize(
    ("drop", "kind", "text"),
    [
        (False, ClientTimeout, "^no report within 0.2 s"),
        (True, ClientError, "connection"),
    ],
)
async def test_lost_server_ends_teleop(
    state: DrivenRobot, keyboard: PipeInput, drop: bool, kind: type, text: str
) -> None:
    async with faulty_server(beats=3, drop=drop) as (client, received):
        driver = teleop(client, state, keyboard, silence_limit=5.0 if drop else 0.2)
        keyboard.send_text("w")
        with pytest.raises(kind, match=text):
            await driver.run()
    assert drop or received[-1].startswith(b"DRIVE {Left 0.0}")


async def test_closed_keyboard_ends_teleop(
    state: DrivenRobot, keyboard: PipeInput
) -> None:
    async with faulty_server(beats=1) as (client, received):
        driver = teleop(client, state, keyboard)
        keyboard.close()
        with pytest.raises(RadarsimError, match="keyboard"):
            await driver.run()
    assert len(received) == 2, "nothing but INIT and a stop"


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (SETTINGS, ""),
        (replace(SETTINGS, start="RobotStart1"), ""),
        (replace(SETTINGS, start="Nowhere"), "'Nowhere', expected one of"),
        (replace(SETTINGS, scanner="sonar"), "the scanner 'sonar'"),
    ],
)
async def test_settings_are_applied_or_reported_as_missing(
    usarsim_server: UsarsimServer, settings: TeleopSettings, expected: str
) -> None:
    async with await AsyncClient.connect(*usarsim_server.address) as client:
        if expected:
            with pytest.raises(ClientError, match=expected):
                await prepare(client, settings)
            return
        state = await prepare(client, settings)
        assert (state.level, state.scanner.name) == ("DM-EmptyRoom", "lms200")


@pytest.mark.parametrize("start", [None, "RobotStart1"], ids=["any", "one"])
async def test_server_without_start_poses_chooses_the_start(start: str | None) -> None:
    done = asyncio.Event()

    async def behave(
        reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        writer.write(GREETING)
        await reader.read()
        writer.close()
        done.set()

    async with await asyncio.start_server(behave, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        async with await AsyncClient.connect(port=port, timeout=0.4) as client:
            with pytest.raises(ClientTimeout, match="reading of the robot"):
                await prepare(client, replace(SETTINGS, start=start))
        await done.wait()
