"""The teleoperation loop: read reports, send drive commands, draw the screen."""

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
from radarsim.client.teleop.robot_state import RobotState
from radarsim.client.teleop.terminal import Key, Steering, make_bindings, make_screen
from radarsim.client.teleop.view import RADII, Fragments, draw_view, panel_lines
from radarsim.errors import ClientError, RadarsimError, expected_one_of

SILENCE_LIMIT = 2.5  # s without reports after which the server counts as gone
STEERING_INTERVAL = 0.02  # s between two evaluations of the keys
FIRST_ZOOM = RADII.index(10)
SIGNALS = (
    "SIGTERM",
    "SIGHUP",
)  # SIGHUP, when the terminal closes, does not exist on Windows


@dataclass(frozen=True, slots=True)
class TeleopSettings:
    """Settings of a teleoperated drive.

    Attributes:
        robot: Class of the robot.
        start: Name of a start pose; None for the first one of the server.
        scanner: Name of the scanner to display; None for the first.
        speed: Speed that keys set at first, m/s.
        drive_unit: Unit in which the server expects wheel speeds.
    """

    robot: str
    start: str | None
    scanner: str | None
    speed: float
    drive_unit: DriveUnit


async def drive(
    host: str,
    port: int,
    settings: TeleopSettings,
    on_start: Callable[[], object] = lambda: None,
) -> int:
    """Connect, and drive from this process' terminal until a key ends it.

    Args:
        host: Host of the server.
        port: Port of the server.
        settings: Robot, start, scanner and speed.
        on_start: Called when the robot is there, and keys begin to drive it.

    Returns:
        The exit code.

    Raises:
        ClientError: If the server is not there, falls silent or lacks what the
            settings ask for.
        RadarsimError: If the keyboard is closed.
    """
    async with await AsyncClient.connect(host, port) as client:
        state = await prepare(client, settings)
        teleop = Teleop(client, state, settings.speed)
        on_start()
        return await teleop.run()


async def prepare(client: AsyncClient, settings: TeleopSettings) -> RobotState:
    """Spawn the robot, and query its properties.

    Raises:
        ClientError: If the server lacks what the settings ask for, or does not answer.
    """
    greeting = await client.greeting()
    start = await _choose_start(client, settings.start)
    await client.spawn(settings.robot, start=start)
    robot_info = await client.robot_info(drive_unit=settings.drive_unit)
    return RobotState(robot_info, robot_info.scanner(settings.scanner), greeting.level)


async def _choose_start(client: AsyncClient, wanted: str | None) -> str | None:
    try:
        names = list(await client.start_poses())
    except ClientTimeout:
        if wanted is not None:
            raise
        return None
    if wanted is None:
        return names[0] if names else None
    if wanted not in names:
        raise ClientError(f"start {expected_one_of(wanted, names)}")
    return wanted


class Teleop:
    """A robot, a keyboard and a screen.

    Attributes:
        state: Newest state of the robot.
        steering: The motion that the keys ask for.
        commanded: The motion commanded last: m/s ahead, and rad/s counter-clockwise.
        radius: Radius of the view around the robot, m.
    """

    def __init__(
        self,
        client: AsyncClient,
        state: RobotState,
        speed: float,
        *,
        silence_limit: float = SILENCE_LIMIT,
        keyboard: Input | None = None,
        terminal: Output | None = None,
    ) -> None:
        """Set up for a client whose robot is spawned; to be called in the event loop.

        Args:
            client: The connection.
            state: State of its robot.
            speed: Speed that keys set at first, m/s.
            silence_limit: Time without reports after which the server is gone, s.
            keyboard: Input; that of this process by default.
            terminal: Output; that of this process by default.
        """
        robot_info = state.robot_info
        self.state = state
        self.steering = Steering(
            speed,
            top_speed=robot_info.top_speed,
            wheel_separation=robot_info.wheel_separation,
        )
        self.commanded = 0.0, 0.0
        self._zoom = FIRST_ZOOM
        self._patience = silence_limit
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
        """Radius of the view around the robot, m."""
        return RADII[self._zoom]

    async def run(self) -> int:
        """Drive until a key or a signal ends it, and restore the terminal.

        Returns:
            The exit code.

        Raises:
            ClientError: If the server falls silent, or is gone.
            RadarsimError: If the keyboard is closed.
        """
        screen = asyncio.create_task(self._app.run_async(set_exception_handler=False))
        tasks: list[asyncio.Task[int]] = [
            screen,
            asyncio.create_task(self._listen()),
            asyncio.create_task(self._steer()),
        ]
        with _calling_on_signals(partial(self._leave, 0)):
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        # A key that ends it takes precedence over an error at the same moment.
        try:
            return (screen if screen in done else done.pop()).result()
        except EOFError:
            raise RadarsimError("the keyboard is gone, expected a key") from None

    async def _listen(self) -> int:
        while True:
            for report in await self._client.read(self._patience):
                self.state.take(report)
            self._heard = self._clock()
            self._app.invalidate()

    async def _steer(self) -> int:
        while True:
            motion = self.steering.motion(self._clock())
            if motion != self.commanded:
                left, right = self.state.robot_info.wheel_speeds(*motion)
                await self._client.drive(left, right)
                self.commanded = motion
            await asyncio.sleep(STEERING_INTERVAL)

    def _press(self, key: Key) -> None:
        self.steering.press(key, self._clock())

    def _change_zoom(self, step: int) -> None:
        self._zoom = min(max(self._zoom + step, 0), len(RADII) - 1)

    def _leave(self, code: int) -> None:
        if self._app.is_running and not self._app.is_done:
            self._app.exit(result=code)

    def _view(self, columns: int, rows: int) -> list[Fragments]:
        state = self.state
        return draw_view(state.points(), state.robot_info, self.radius, columns, rows)

    def _panel(self, _: int, rows: int) -> list[Fragments]:
        lines = panel_lines(
            self.state,
            speed=self.steering.speed,
            commanded=self.commanded,
            silence=self._clock() - self._heard,
        )
        return lines[:rows]


@contextmanager
def _calling_on_signals(end: Callable[[], None]) -> Iterator[None]:
    """Call a function in the event loop when a signal asks the process to end."""
    loop = asyncio.get_running_loop()

    def handle(_number: int, _frame: FrameType | None) -> None:
        loop.call_soon_threadsafe(end)

    numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
    before = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
