"""A line on stderr that tells how things stand, for as long as they go on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.live import Live
from rich.text import Text

REFRESHES: Final = 8  # a second


class Lines:
    """Lines for where no line can live, one below the other."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def add(self, line: str) -> None:
        """Print one."""
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def living(present: Callable[[], str]) -> Iterator[Lines | None]:
    """Show how things stand by one line, if stderr is a terminal that can.

    Args:
        present: Says it; called only when the line is drawn.

    Yields:
        Where to tell of changes if it cannot.
    """
    console = Console(stderr=True)
    if not console.is_terminal or console.is_dumb_terminal:
        yield Lines(console)
        return
    line = _Line(present)
    with Live(line, console=console, refresh_per_second=REFRESHES, transient=True):
        yield None


class _Line:
    def __init__(self, present: Callable[[], str]) -> None:
        self._present = present

    def __rich__(self) -> Text:
        return Text(self._present(), no_wrap=True, overflow="ellipsis")
