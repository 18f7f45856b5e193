"""Progress display on stderr during a run: a status line or a progress bar."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, TypeVar

from rich.console import Console
from rich.live import Live
from rich.text import Text

from radarsim.errors import escape_unprintable

REFRESH_RATE: Final = 8  # Hz
_ESTIMATE_PERIOD: Final = 600.0  # s; long, since a single result may take a minute

_Result = TypeVar("_Result")


@contextmanager
def live_status(describe: Callable[[], str]) -> Iterator[Callable[[str], None]]:
    """Show a status line that is refreshed regularly, if stderr is a terminal.

    Args:
        describe: Returns the status; called only when the line is drawn.

    Yields:
        A function that prints a line, but only if stderr is not a terminal.
    """
    console = Console(stderr=True)
    if not console.is_terminal or console.is_dumb_terminal:
        # By default rich would wrap lines of a file at 80 columns, and read brackets in
        # names as markup.
        yield lambda line: console.print(
            escape_unprintable(line), highlight=False, markup=False, soft_wrap=True
        )
        return

    def status_line() -> Text:
        text = escape_unprintable(describe())
        return Text(text, no_wrap=True, overflow="ellipsis")

    with Live(
        get_renderable=status_line,
        console=console,
        refresh_per_second=REFRESH_RATE,
        transient=True,
    ):
        yield lambda _: None


def with_bar(results: Iterator[_Result], name: str, total: int) -> Iterator[_Result]:
    """Yield results, and show on stderr how many are done and the remaining time."""
    from rich.progress import MofNCompleteColumn, Progress

    console = Console(stderr=True)
    bar = Progress(
        *Progress.get_default_columns(),
        MofNCompleteColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
        speed_estimate_period=_ESTIMATE_PERIOD,
    )
    with bar:
        yield from bar.track(results, total, description=name)
