"""Layout of the screen, key bindings, and the motion that keys mean.

prompt_toolkit handles the terminal itself: raw keys, the alternate screen, changes of
size, incremental drawing, and restoring everything at the end.

Theory of operation
===================
Terminals report keys that are pressed, never keys that are released; a key that is held
repeats, after a pause of up to 0.66 s. So every press moves the robot for a limited
time: long enough to bridge that pause, and much shorter once the key repeats. A
released key or a lost connection therefore stops the robot.

Of two keys that are held only the later one repeats. A turn key therefore prolongs a
motion ahead or back, so that the robot drives a curve; a key for ahead or back does not
prolong a turn.
"""

import math
from collections.abc import Callable
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

from radarsim.client.teleop.view import WIDTH, Fragments, help_text

FIRST_HOLD: Final = 0.7  # s; bridges the pause before a held key repeats
REPEAT_HOLD: Final = 0.3  # s; some repeats may come late over a network
REPEAT_GAP: Final = 0.2  # s; faster presses of one key count as a held key
SPEED_STEP: Final = 0.05  # m/s
TURN_SHARE: Final = 0.3  # share of the speed that wheels have in a turn on the spot
Draw: TypeAlias = Callable[[int, int], list[Fragments]]
ZOOM_KEYS: Final = {"z": -1, "x": 1}
QUIT_KEYS: Final = {"q": 0, "escape": 0, "c-c": 130, "<sigint>": 130}
MIN_COLUMNS: Final = 64  # in a narrower terminal the panel is hidden
ESCAPE_TIMEOUT: Final = (
    0.05  # s; a longer pause after the byte of Esc means the key Esc itself
)
MIN_REDRAW_INTERVAL: Final = 0.04  # s between two drawings
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
    """The effect of a key on the motion."""

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
    """The motion that the keys pressed so far ask for.

    Attributes:
        speed: Speed that the keys set, m/s.
    """

    def __init__(self, speed: float, *, top_speed: float, wheel_separation: float):
        """Start at rest.

        Args:
            speed: Speed that keys set at first, m/s; limited to the top speed.
            top_speed: Top speed of the robot, m/s.
            wheel_separation: Distance between left and right wheels, m.
        """
        self.speed = min(speed, top_speed)
        self._top_speed = top_speed
        self._wheel_separation = wheel_separation
        self._direction = self._turn = (
            0  # 1 ahead and to the left, -1 back and to the right
        )
        self._direction_ends = self._turn_ends = -math.inf
        self._last: tuple[Key, float] | None = None

    def press(self, key: Key, now: float) -> None:
        """Process a key press at a time, s, that never decreases."""
        if key is Key.STOP:
            self._direction = self._turn = 0
        elif key in SPEED_CHANGES:
            speed = round(self.speed + SPEED_CHANGES[key], 9)
            self.speed = max(min(SPEED_STEP, self.speed), min(speed, self._top_speed))
        else:
            self._move(key, now)
        self._last = key, now

    def motion(self, now: float) -> tuple[float, float]:
        """Return the motion at a time.

        Returns:
            Speed ahead, m/s, and turn, rad/s counter-clockwise.
        """
        direction = self._direction if now < self._direction_ends else 0
        turn = self._turn if now < self._turn_ends else 0
        fastest_turn = TURN_SHARE * self.speed / (self._wheel_separation / 2)
        return direction * self.speed, turn * fastest_turn

    def _move(self, key: Key, now: float) -> None:
        ends = now + self._hold(key, now)
        if key in DIRECTIONS:
            self._direction, self._direction_ends = DIRECTIONS[key], ends
            return
        self._turn, self._turn_ends = TURNS[key], ends
        if now < self._direction_ends:
            self._direction_ends = ends

    def _hold(self, key: Key, now: float) -> float:
        if self._last is None:
            return FIRST_HOLD
        last, when = self._last
        return REPEAT_HOLD if last is key and now - when < REPEAT_GAP else FIRST_HOLD


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
    """A part of the screen drawn by a function of its columns and rows."""

    def __init__(self, draw: Draw) -> None:
        self._draw = draw

    def create_content(self, width: int, height: int) -> UIContent:
        """Draw the content."""
        lines = self._draw(width, height) if width > 0 and height > 0 else []
        # Copied, since prompt_toolkit expects a list of a wider type.
        return UIContent(
            lambda i: [*lines[i]], line_count=len(lines), show_cursor=False
        )


def make_bindings(
    press: Callable[[Key], None],
    zoom: Callable[[int], None],
    leave: Callable[[int], None],
) -> KeyBindings:
    """Bind all keys; upper case equals lower case.

    Args:
        press: Called with the effect of a key on the motion.
        zoom: Called with -1 for a smaller radius of the view, or 1 for a larger one.
        leave: Called with an exit code.
    """
    bindings = KeyBindings()

    def bind(name: str, act: Callable[[], None]) -> None:
        for one in {name, name.upper()} if len(name) == 1 else {name}:
            bindings.add(one)(lambda _: act())

    for key, names in DRIVE_KEYS.items():
        for name in names:
            bind(name, partial(press, key))
    for name, step in ZOOM_KEYS.items():
        bind(name, partial(zoom, step))
    for name, code in QUIT_KEYS.items():
        bind(name, partial(leave, code))
    return bindings


def make_screen(
    view: Draw,
    panel: Draw,
    bindings: KeyBindings,
    *,
    keyboard: Input | None = None,
    terminal: Output | None = None,
) -> Application[int]:
    """Create the application, whose result is an exit code.

    Args:
        view: Draws the scan.
        panel: Draws the text beside it, ``WIDTH`` columns wide.
        bindings: Bindings of all keys.
        keyboard: Input; that of this process by default.
        terminal: Output; that of this process by default.
    """
    app: Application[int]

    def is_wide() -> bool:
        return app.output.get_size().columns >= MIN_COLUMNS

    beside = VSplit(
        [Window(width=1, char="│"), Window(DrawnControl(panel), width=WIDTH)],
    )
    picture = VSplit(
        [Window(DrawnControl(view)), ConditionalContainer(beside, Condition(is_wide))]
    )
    footer = Window(DrawnControl(_help), height=1, style="class:help")
    app = Application(
        Layout(HSplit([picture, footer])),
        key_bindings=bindings,
        style=STYLE,
        full_screen=True,
        min_redraw_interval=MIN_REDRAW_INTERVAL,
        refresh_interval=0.2,
        input=keyboard,
        output=terminal,
    )
    app.ttimeoutlen = ESCAPE_TIMEOUT
    return app


def _help(width: int, _: int) -> list[Fragments]:
    return [[("", help_text(width))]]
