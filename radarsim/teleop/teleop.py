"""The loop: reports in, orders out, the screen in between."""

import asyncio
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from types import FrameType

from prompt_toolkit.application import Application
from prompt_toolkit.input import Input
from prompt_toolkit.output import Output

from radarsim.client import AsyncClient, ClientTimeout, DriveUnit
from radarsim.errors import ClientError, RadarsimError
from radarsim.teleop.keyboard import Key, Steering
from radarsim.teleop.panel import panel_lines
from radarsim.teleop.robot_state import RobotState
from radarsim.teleop.terminal import make_bindings, make_screen
from radarsim.teleop.view import RADII, Fragments, draw_view

PATIENCE = 2.5  # s; a server that says nothing for so long is given up
TICK = 0.02  # s between two looks at what the keys ask for
FIRST_ZOOM = RADII.index(10)
ENDINGS = ("SIGTERM", "SIGHUP")  # the latter: the terminal is gone; not on Windows


@dataclass(frozen=True, slots=True)
class Wish:
    """What is to be driven.

    Attributes:
        robot: Its class.
        start: Name of a start pose; None for the first that the server tells.
        scanner: Its name; None for the robot's first.
        speed: That keys set at first, m/s.
        drive_unit: In which the server counts wheel speeds.
    """

    robot: str
    start: str | None
    scanner: str | None
    speed: float
    drive_unit: DriveUnit


async def drive(host: str, port: int, wish: Wish) -> int:
    """Connect, and drive at this process' terminal until a key ends it.

    Returns:
        The exit code.

    Raises:
        ClientError: If the server is not there, falls silent or lacks what is wished.
        RadarsimError: If the keyboard is gone.
    """
    async with await AsyncClient.connect(host, port) as client:
        readings = await prepare(client, wish)
        return await Teleop(client, readings, wish.speed).run()


async def prepare(client: AsyncClient, wish: Wish) -> RobotState:
    """Have the robot made, and find out what it is.

    Raises:
        ClientError: If the server lacks what is wished, or does not say.
    """
    greeting = await client.greeting()
    start = await _choose_start(client, wish.start)
    await client.spawn(wish.robot, start=start)
    facts = await client.robot_info(drive_unit=wish.drive_unit)
    return RobotState(facts, facts.scanner(wish.scanner), greeting.level)


async def _choose_start(client: AsyncClient, wished: str | None) -> str | None:
    try:
        names = list(await client.start_poses())
    except ClientTimeout:
        if wished is not None:
            raise
        return None
    if wished is None:
        return names[0] if names else None
    if wished not in names:
        raise ClientError(f"start {wished[:80]!r}, expected one of {names}")
    return wished


class Teleop:
    """A robot, a keyboard and a screen.

    Attributes:
        readings: What the robot has told.
        steering: What the keys ask for.
        ordered: The motion that the robot was told last: m/s ahead, and rad/s
            counter-clockwise.
        radius: What is seen around the robot, m.
    """

    def __init__(
        self,
        client: AsyncClient,
        readings: RobotState,
        speed: float,
        *,
        patience: float = PATIENCE,
        keyboard: Input | None = None,
        terminal: Output | None = None,
    ) -> None:
        """Take over a client whose robot is there; to be called in the event loop.

        Args:
            client: Connected.
            readings: Of its robot.
            speed: That keys set at first, m/s.
            patience: Longest silence of the server, s.
            keyboard: That of this process by default.
            terminal: That of this process by default.
        """
        facts = readings.facts
        self.readings = readings
        self.steering = Steering(
            speed, top_speed=facts.top_speed, wheel_separation=facts.wheel_separation
        )
        self.ordered = 0.0, 0.0
        self._zoom = FIRST_ZOOM
        self._patience = patience
        self._client = client
        self._clock = asyncio.get_running_loop().time
        self._heard = self._clock()
        self._app: Application[int] = make_screen(
            self._view,
            self._panel,
            make_bindings(self._press, self._change_zoom, self._leave),
            keyboard=keyboard,
            terminal=terminal,
        )

    @property
    def radius(self) -> float:
        """What is seen around the robot, m."""
        return RADII[self._zoom]

    async def run(self) -> int:
        """Drive until a key or a signal ends it; the terminal is then as it was.

        Returns:
            The exit code.

        Raises:
            ClientError: If the server falls silent, or is gone.
            RadarsimError: If the keyboard is gone.
        """
        screen = asyncio.create_task(self._app.run_async(set_exception_handler=False))
        tasks: list[asyncio.Task[int]] = [
            screen,
            asyncio.create_task(self._listen()),
            asyncio.create_task(self._steer()),
        ]
        try:
            with _calling_at_signals(partial(self._leave, 0)):
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        # A key that ends it counts more than what went wrong at the same moment.
        try:
            return (screen if screen in done else done.pop()).result()
        except EOFError:
            raise RadarsimError("the keyboard is gone, expected a key") from None

    async def _listen(self) -> int:
        while True:
            for report in await self._client.read(self._patience):
                self.readings.take(report)
            self._heard = self._clock()
            self._app.invalidate()

    async def _steer(self) -> int:
        while True:
            motion = self.steering.motion(self._clock())
            if motion != self.ordered:
                left, right = self.readings.facts.wheel_speeds(*motion)
                await self._client.drive(left, right)
                self.ordered = motion
            await asyncio.sleep(TICK)

    def _press(self, key: Key) -> None:
        self.steering.press(key, self._clock())

    def _change_zoom(self, step: int) -> None:
        self._zoom = min(max(self._zoom + step, 0), len(RADII) - 1)

    def _leave(self, code: int) -> None:
        if self._app.is_running and not self._app.is_done:
            self._app.exit(result=code)

    def _view(self, columns: int, rows: int) -> list[Fragments]:
        readings = self.readings
        return draw_view(readings.points(), readings.facts, self.radius, columns, rows)

    def _panel(self, _: int, rows: int) -> list[Fragments]:
        lines = panel_lines(
            self.readings,
            speed=self.steering.speed,
            ordered=self.ordered,
            silence=self._clock() - self._heard,
        )
        return lines[:rows]


@contextmanager
def _calling_at_signals(end: Callable[[], None]) -> Iterator[None]:
    """Have signals that would end the process call something in the loop instead."""
    loop = asyncio.get_running_loop()

    def handle(_number: int, _frame: FrameType | None) -> None:
        loop.call_soon_threadsafe(end)

    numbers = [getattr(signal, name) for name in ENDINGS if hasattr(signal, name)]
    before = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
