"""Progress on stderr while kernels are compiled, and while a run lasts."""

import functools
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from typing import Final, ParamSpec, TypeVar

from rich.console import Console
from rich.live import Live
from rich.text import Text

from radarsim import plugins
from radarsim.cli.output import log_line_contexts, print_message
from radarsim.errors import escape_unprintable
from radarsim.kernel_cache import ENGINE, compilation, describe, is_cold
from radarsim.processes import exit_immediately_on_signals

REFRESH_RATE: Final = 8  # Hz
_ESTIMATE_PERIOD: Final = 600.0  # s; results may take a minute each

_Result = TypeVar("_Result")


@contextmanager
def live_status(describe: Callable[[], str]) -> Iterator[Callable[[str], None]]:
    """Show the status in one line that is kept up to date, if stderr is a terminal.

    Args:
        describe: Returns the status; called only when the line is drawn.

    Yields:
        A function that prints a line if stderr is not a terminal, and nothing if it is.
    """
    console = Console(stderr=True)
    if not console.is_terminal or console.is_dumb_terminal:
        # A file has no width: rich would break lines at 80 columns, and read brackets
        # in names as markup.
        yield lambda line: console.print(
            escape_unprintable(line), highlight=False, markup=False, soft_wrap=True
        )
        return
    line = _StatusLine(describe)
    with Live(line, console=console, refresh_per_second=REFRESH_RATE, transient=True):
        yield lambda _: None


def with_bar(results: Iterator[_Result], name: str, total: int) -> Iterator[_Result]:
    """Yield results, and show on stderr how many there are, and the time left."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    bar = Progress(
        *columns,
        console=console,
        disable=not console.is_terminal,
        transient=True,
        speed_estimate_period=_ESTIMATE_PERIOD,
    )
    with bar:
        task = bar.add_task(name, total=total)
        for result in results:
            bar.advance(task)
            yield result


class _StatusLine:
    def __init__(self, describe: Callable[[], str]) -> None:
        self._describe = describe

    def __rich__(self) -> Text:
        text = escape_unprintable(self._describe())
        return Text(text, no_wrap=True, overflow="ellipsis")


P = ParamSpec("P")
R = TypeVar("R")

_INTERVAL: Final = 0.1  # s between two drawings
_FRAMES: Final = "⠋⠙⠹⠸⠼⠴⠦⠧⠇⠏"
_PLAIN_FRAMES: Final = "|/-\\"
_ERASE: Final = "\r\x1b[K"


def with_compile_progress(command: Callable[P, R]) -> Callable[P, R]:
    """Make a command tell on stderr when it has to compile."""

    @functools.wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with compile_progress(at_start=True):
            return command(*args, **kwargs)

    return run


@contextmanager
def compile_progress(*, at_start: bool = False) -> Iterator[None]:
    """Tell on stderr when something is compiled: nothing if all of it is cached.

    On a terminal a line with the seconds so far is shown as long as it takes, else a
    line is printed at the beginning, one for each part of the program that has to be
    compiled.

    Args:
        at_start: Whether the first line comes at once if nothing is cached, before
            numba is imported: for what compiles in this thread.
    """
    if sys.stderr.isatty():
        display: _LiveLine | _PlainLine = _LiveLine()
    else:
        display = _PlainLine()
    log_line_contexts.append(display.hidden)
    observers = display.update, _SignalGuard().update
    compilation.observers.extend(observers)
    try:
        if at_start and is_cold():
            for observer in observers:
                observer(ENGINE)
        yield
    finally:
        log_line_contexts.remove(display.hidden)
        for observer in observers:
            compilation.observers.remove(observer)
            # An exception may have come half-way: the line goes, and signals raise
            # exceptions again.
            observer(None)


def compile_now(*parts: str) -> None:
    """Compile what is not cached, before worker processes or another display start.

    Workers would compile the same, each for itself and in silence.

    Args:
        parts: Entries of ``radarsim.kernels`` in ``plugins`` besides the server's.
    """
    for part in ("server", *parts):
        plugins.load(plugins.KERNELS, part)()


class _SignalGuard:
    """Lets signals end the process at once while something is compiled.

    An exception would get lost in the compiler, or crash it.
    """

    def __init__(self) -> None:
        self._until_end = ExitStack()

    def update(self, subject: str | None) -> None:
        """Begin or end to guard."""
        if subject is not None:
            self._until_end.enter_context(exit_immediately_on_signals())
        else:
            self._until_end.close()


class _PlainLine:
    """A line for those who read stderr from a pipe or a file."""

    def __init__(self) -> None:
        self._printed: set[str] = set()

    def update(self, subject: str | None) -> None:
        """Print the line when something begins to be compiled for the first time."""
        if subject is not None and subject not in self._printed:
            print_message(describe(subject, again=bool(self._printed)))
            self._printed.add(subject)

    def hidden(self) -> AbstractContextManager[None]:
        """Hide nothing: a printed line stays."""
        return nullcontext()


class _LiveLine:
    """A line on a terminal that counts seconds, drawn by a thread of its own.

    It hides no cursor, so that a signal can end the process at any moment, and vanishes
    as soon as compiling pauses, so that no other text gets into it.
    """

    def __init__(self) -> None:
        self._stream = sys.stderr
        self._began = time.monotonic()
        self._lock = threading.Lock()
        self._end: threading.Event | None = None
        self._subject = ENGINE

    def update(self, subject: str | None) -> None:
        """Show or erase the line."""
        with self._lock:
            self._subject = subject or self._subject
            if subject is not None and self._end is None:
                # A new event for each thread: the old thread may not have seen yet that
                # it is to end.
                self._end = threading.Event()
                threading.Thread(
                    target=self._draw, args=(self._end,), daemon=True
                ).start()
            elif subject is None and self._end is not None:
                self._end.set()
                self._end = None
                self._write(_ERASE)

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Hide the line while another one is written."""
        with self._lock:
            if self._end is not None:
                self._write(_ERASE)
            yield

    def _draw(self, end: threading.Event) -> None:
        while not end.wait(_INTERVAL):
            with self._lock:
                # The line may have been erased while this thread waited for the lock.
                if not end.is_set():
                    self._write(f"{_ERASE}{self._text()}")

    def _text(self) -> str:
        seconds = time.monotonic() - self._began
        encoding = (self._stream.encoding or "").lower()
        # Other encodings cannot write Braille, and the thread would end with an
        # exception.
        frames = _FRAMES if encoding.startswith("utf") else _PLAIN_FRAMES
        frame = frames[int(seconds / _INTERVAL) % len(frames)]
        end = f" {seconds:.0f} s"
        # A line that wraps could not be erased: a carriage return goes back one row's
        # width only.
        width = shutil.get_terminal_size().columns - len(end) - 3
        short = f"compiling {self._subject}"
        texts = f"radarsim: {describe(self._subject)}", short, short[:width]
        return f"{frame} {next(each for each in texts if len(each) <= width)}{end}"

    def _write(self, text: str) -> None:
        if sys.stderr is self._stream:  # else another display shows something there
            self._stream.write(text)
            self._stream.flush()
