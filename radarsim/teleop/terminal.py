"""Layout of the screen, and key bindings.

prompt_toolkit handles the terminal itself: raw keys, the alternate screen, changes of
size, incremental drawing, and restoring everything at the end.
"""

from collections.abc import Callable
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

from radarsim.teleop.keyboard import Key
from radarsim.teleop.panel import WIDTH, help_text
from radarsim.teleop.view import Fragments

Draw: TypeAlias = Callable[[int, int], list[Fragments]]

DRIVE_KEYS: Final = {
    Key.AHEAD: ("up", "w"),
    Key.BACK: ("down", "s"),
    Key.LEFT: ("left", "a"),
    Key.RIGHT: ("right", "d"),
    Key.STOP: (" ",),
    Key.FASTER: ("pageup", "+", "="),
    Key.SLOWER: ("pagedown", "-"),
}
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
