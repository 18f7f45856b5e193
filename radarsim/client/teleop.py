"""Teleoperation: drive a robot by keyboard over TCP, with its scan in the terminal.

This module defines the keys, the screen layout and the main loop; ``teleop_view`` draws
the contents of the screen as text.

prompt_toolkit handles the terminal itself: raw keys, the alternate screen, changes of
size, incremental drawing, and restoring the terminal at the end.

Theory of operation
===================
Terminals report pressed keys but never released keys; a held key repeats after a pause
of up to 0.66 s. So every press moves the robot for a limited time: long enough to
bridge that pause, and much shorter once the key repeats. A released key or a lost
connection therefore stops the robot.

If two keys are held, only the key that was pressed later repeats. A turn key therefore
prolongs a forward or backward motion, so that the robot drives a curve; a forward or
backward key does not prolong a turn.
"""

import asyncio
import math
import signal
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final, TypeAlias

from prompt_toolkit.application import Application
from prompt_toolkit.filters import Condition
from prompt_toolkit.input import Input
from prompt_toolkit.key_binding import KeyBindings
from prompt_toolkit.layout import (
    ConditionalContainer,
    HSplit,
    Layout,
    UIContent,
    UIControl,
    VSplit,
    Window,
)
from prompt_toolkit.output import Output
from prompt_toolkit.styles import Style

from radarsim.client import AsyncClient, DriveUnit
from radarsim.client.teleop_view import (
    RADII,
    WIDTH,
    DrivenRobot,
    Fragments,
    draw_view,
    help_text,
    panel_lines,
)
from radarsim.errors import RadarsimError
from radarsim.listening import first_of, signal_callbacks

FIRST_HOLD: Final = 0.7  # s; bridges the pause before a held key repeats
REPEAT_HOLD: Final = 0.3  # s; some repeats may come late over a network
REPEAT_GAP: Final = 0.2  # s; faster presses of one key count as a held key
SPEED_STEP: Final = 0.05  # m/s
TURN_SHARE: Final = 0.3  # wheel speed in a turn on the spot, as a fraction of the speed
Draw: TypeAlias = Callable[[int, int], list[Fragments]]
ZOOM_KEYS: Final = {"z": -1, "x": 1}
# prompt_toolkit turns the signal SIGINT into a key of this name.
QUIT_KEYS: Final = {"q": 0, "escape": 0, "c-c": 130, "<sigint>": 130}
MIN_COLUMNS: Final = 64  # in a narrower terminal the panel is hidden
# Arrow keys also send an Esc byte first; after this time, s, it was the key Esc.
ESCAPE_TIMEOUT: Final = 0.05
MIN_REDRAW_INTERVAL: Final = 0.04  # s between two drawings
SILENCE_LIMIT: Final = 2.5  # s without reports until the connection counts as lost
STEERING_INTERVAL: Final = 0.02  # s between two evaluations of the keys
FIRST_ZOOM: Final = RADII.index(10)
# SIGHUP is sent when the terminal closes; it does not exist on Windows.
SIGNALS: Final = [
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
]
STYLE: Final = Style(
    [
        ("far", ""),
        ("middle", "ansiyellow"),
        ("near", "ansired bold"),
        ("robot", "ansicyan bold"),
        ("scale", "ansibrightblack"),
        ("help", "reverse"),
        ("warning", "ansired bold"),
    ]
)


class Key(StrEnum):
    """What a key of the keyboard makes the robot do."""

    AHEAD = "ahead"
    BACK = "back"
    LEFT = "left"
    RIGHT = "right"
    STOP = "stop"
    FASTER = "faster"
    SLOWER = "slower"


DIRECTIONS: Final = {Key.AHEAD: 1, Key.BACK: -1}
TURNS: Final = {Key.LEFT: 1, Key.RIGHT: -1}
SPEED_CHANGES: Final = {Key.FASTER: SPEED_STEP, Key.SLOWER: -SPEED_STEP}


class Steering:
    """Computes the speed and yaw rate that the pressed keys command.

    Attributes:
        speed: Driving speed that the keys adjust, m/s.
    """

    def __init__(self, speed: float, *, top_speed: float, wheel_separation: float):
        """Create the steering of a robot that stands still.

        Args:
            speed: Initial driving speed, m/s; limited to the top speed.
            top_speed: Top speed of the robot, m/s.
            wheel_separation: Distance between left and right wheels, m.
        """
        self.speed = min(speed, top_speed)
        self._top_speed = top_speed
        self._wheel_separation = wheel_separation
        self._direction = 0  # 1 forward, -1 backward
        self._turn = 0  # 1 to the left, -1 to the right
        self._direction_ends = self._turn_ends = -math.inf
        self._last: Key | None = None
        self._last_time = -math.inf

    def press(self, key: Key, now: float) -> None:
        """Change the commanded motion or speed by a key press.

        Args:
            key: The key.
            now: Time of the press, s, not before the previous press.
        """
        if key is Key.STOP:
            self._direction = self._turn = 0
        elif key in SPEED_CHANGES:
            # The speed is rounded, because 3 * 0.05 is 0.15000000000000002 in floating
            # point.
            speed = round(self.speed + SPEED_CHANGES[key], 9)
            # The minimum is one step, or the present speed if that is lower, because
            # the key for slower must not raise a speed below one step.
            self.speed = max(min(SPEED_STEP, self.speed), min(speed, self._top_speed))
        else:
            is_held = self._last is key and now - self._last_time < REPEAT_GAP
            ends = now + (REPEAT_HOLD if is_held else FIRST_HOLD)
            if key in DIRECTIONS:
                self._direction, self._direction_ends = DIRECTIONS[key], ends
            else:
                self._turn, self._turn_ends = TURNS[key], ends
                # A held forward key stops repeating when another key is pressed.
                if now < self._direction_ends:
                    self._direction_ends = ends
        self._last, self._last_time = key, now

    def motion(self, now: float) -> tuple[float, float]:
        """Return the motion that the keys command at a given time.

        Returns:
            Forward speed, m/s, and yaw rate, rad/s counter-clockwise.
        """
        direction = self._direction if now < self._direction_ends else 0
        turn = self._turn if now < self._turn_ends else 0
        fastest_turn = TURN_SHARE * self.speed / (self._wheel_separation / 2)
        return direction * self.speed, turn * fastest_turn


DRIVE_KEYS: Final = {
    Key.AHEAD: ("up", "w"),
    Key.BACK: ("down", "s"),
    Key.LEFT: ("left", "a"),
    Key.RIGHT: ("right", "d"),
    Key.STOP: (" ",),
    Key.FASTER: ("pageup", "+", "="),
    Key.SLOWER: ("pagedown", "-"),
}


class DrawnControl(UIControl):
    """A part of the terminal screen whose lines a function draws."""

    def __init__(self, draw: Draw) -> None:
        self._draw = draw

    def create_content(self, width: int, height: int) -> UIContent:
        """Draw the lines for a width and height in characters."""
        lines = self._draw(width, height) if width > 0 and height > 0 else []
        # Lines are copied, because prompt_toolkit annotates a list of a wider type.
        return UIContent(
            lambda i: [*lines[i]], line_count=len(lines), show_cursor=False
        )


@dataclass(frozen=True, slots=True)
class TeleopSettings:
    """Settings of a teleoperated drive.

    Attributes:
        robot: Class of the robot.
        start: Name of a start pose; None for the first one of the server.
        scanner: Name of the scanner to display; None for the first one.
        speed: Initial driving speed, m/s.
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
    """Connect to a server and drive a robot by keyboard until the user quits.

    Args:
        host: Host of the server.
        port: Port of the server.
        settings: Robot, start, scanner and speed.
        on_start: Called when the robot has spawned and before the screen appears.

    Returns:
        The exit code.

    Raises:
        ClientError: If the server cannot be reached, sends no reports, or has no such
            robot, start or scanner.
        RadarsimError: If the keyboard is closed.
    """
    async with await AsyncClient.connect(host, port) as client:
        state = await prepare(client, settings)
        teleop = Teleop(client, state, settings.speed)
        on_start()
        return await teleop.run()


async def prepare(client: AsyncClient, settings: TeleopSettings) -> DrivenRobot:
    """Spawn the robot, and request the properties that the display needs.

    Raises:
        ClientError: If the server does not answer, or has no such robot, start or
            scanner.
    """
    greeting = await client.greeting()
    await client.spawn(settings.robot, start=settings.start)
    robot_info = await client.robot_info(drive_unit=settings.drive_unit)
    scanner = robot_info.scanner(settings.scanner)
    return DrivenRobot(robot_info, scanner, greeting.level)


class Teleop:
    """Drives a robot by the keyboard and shows its state on the screen.

    Attributes:
        state: Newest state of the robot.
        steering: Computes the motion from the keys.
        commanded: Last commanded forward speed, m/s, and yaw rate, rad/s
            counter-clockwise.
        radius: Radius of the view around the robot, m.
    """

    def __init__(
        self,
        client: AsyncClient,
        state: DrivenRobot,
        speed: float,
        *,
        silence_limit: float = SILENCE_LIMIT,
        keyboard: Input | None = None,
        terminal: Output | None = None,
    ) -> None:
        """Create the screen for a spawned robot; an event loop must be running.

        Args:
            client: The connection.
            state: State of the client's robot.
            speed: Initial driving speed, m/s.
            silence_limit: Time without reports, s, after which the connection counts as
                lost.
            keyboard: Input; None for the terminal of this process.
            terminal: Output; None for the terminal of this process.
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
        self._app = self._make_screen(keyboard, terminal)

    @property
    def radius(self) -> float:
        """Radius, m, of the area around the robot that the screen shows."""
        return RADII[self._zoom]

    async def run(self) -> int:
        """Drive the robot by keyboard until the user quits, then restore the terminal.

        Returns:
            The exit code.

        Raises:
            ClientError: If the server sends no reports, or the connection is lost.
            RadarsimError: If the keyboard is closed.
        """
        with signal_callbacks(SIGNALS, lambda _: self._leave(0)):
            try:
                # A key that quits takes precedence over a simultaneous error. The
                # exception handler of prompt_toolkit is disabled, as it would show the
                # error and wait for Enter while the robot drives on.
                screen = self._app.run_async(set_exception_handler=False)
                code: int = await first_of(screen, self._listen(), self._steer())
            except EOFError:
                text = "the keyboard input has ended, expected a key"
                raise RadarsimError(text) from None
        return code

    async def _listen(self) -> int:
        while True:
            for report in await self._client.read(self._patience):
                self.state.take(report)
            # A report of any kind shows that the connection is alive.
            self._heard = self._clock()
            self._app.invalidate()

    async def _steer(self) -> int:
        while True:
            motion = self.steering.motion(self._clock())
            # Servers keep the last wheel speeds, so only changed speeds are sent.
            if motion != self.commanded:
                left, right = self.state.robot_info.wheel_speeds(*motion)
                await self._client.drive(left, right)
                self.commanded = motion
            await asyncio.sleep(STEERING_INTERVAL)

    def _make_screen(
        self, keyboard: Input | None, terminal: Output | None
    ) -> Application[int]:
        """Create the screen, an application that returns an exit code."""
        app: Application[int]

        def is_wide() -> bool:
            return app.output.get_size().columns >= MIN_COLUMNS

        panel = Window(DrawnControl(self._panel), width=WIDTH)
        column = VSplit([Window(width=1, char="│"), panel])
        view = Window(DrawnControl(self._view))
        picture = VSplit([view, ConditionalContainer(column, Condition(is_wide))])
        keys = DrawnControl(lambda width, _: [[("", help_text(width))]])
        footer = Window(keys, height=1, style="class:help")
        app = Application(
            Layout(HSplit([picture, footer])),
            key_bindings=self._bind_keys(),
            style=STYLE,
            full_screen=True,
            min_redraw_interval=MIN_REDRAW_INTERVAL,
            # The panel shows the time since the last report, so it is redrawn even if
            # no report comes.
            refresh_interval=0.2,
            input=keyboard,
            output=terminal,
        )
        app.ttimeoutlen = ESCAPE_TIMEOUT
        return app

    def _bind_keys(self) -> KeyBindings:
        """Bind the keys for driving, zooming and quitting; letters in either case."""
        bindings = KeyBindings()

        def bind(name: str, act: Callable[[], None]) -> None:
            for one in {name, name.upper()} if len(name) == 1 else {name}:
                bindings.add(one)(lambda _: act())

        def press(key: Key) -> None:
            self.steering.press(key, self._clock())

        def zoom(step: int) -> None:
            self._zoom = min(max(self._zoom + step, 0), len(RADII) - 1)

        for key, names in DRIVE_KEYS.items():
            for name in names:
                bind(name, partial(press, key))
        for name, step in ZOOM_KEYS.items():
            bind(name, partial(zoom, step))
        for name, code in QUIT_KEYS.items():
            bind(name, partial(self._leave, code))
        return bindings

    def _leave(self, code: int) -> None:
        # A second exit() before the screen has closed would raise an error.
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
