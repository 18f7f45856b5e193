"""Signal handlers for the time that something runs, and the exit codes of signals."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Final

INTERRUPTED: Final = 130  # exit codes as shells report them
TERMINATED: Final = 143


@contextmanager
def signal_handlers(
    handlers: Mapping[int, Callable[[int, FrameType | None], object]],
) -> Iterator[None]:
    """Install signal handlers, and put the previous ones back at the end.

    Args:
        handlers: Handler by signal number.
    """
    previous = {
        number: signal.signal(number, handler) for number, handler in handlers.items()
    }
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@dataclass(frozen=True, slots=True)
class ExitOnSignal:
    """A signal handler that exits by an exception.

    Attributes:
        code: The exit code.
    """

    code: int

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Raise SystemExit."""
        sys.exit(self.code)


def exit_143_on_sigterm() -> None:
    """Make SIGTERM exit with 143, because 0 would claim that the work is finished."""
    signal.signal(signal.SIGTERM, ExitOnSignal(TERMINATED))


@contextmanager
def exit_immediately_on_signals(terminated: int = TERMINATED) -> Iterator[None]:
    """Make SIGINT and SIGTERM end the process at once, without raising an exception.

    For loading and compiling, before there is anything to save. The exception that
    Python raises for a signal gets lost in callbacks from the compiler, or ends in a
    traceback or a segmentation fault there.

    Args:
        terminated: Exit code after SIGTERM.
    """
    codes = {int(signal.SIGINT): INTERRUPTED, int(signal.SIGTERM): terminated}
    with _immediate_exits(codes):
        yield


@contextmanager
def immediate_exits() -> Iterator[None]:
    """Make signals that would exit by an exception end the process at once instead.

    Other handlers, and the exit codes, stay. Does nothing outside of the main thread,
    which alone gets signals.
    """
    codes = {}
    if threading.current_thread() is threading.main_thread():
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            codes[int(signal.SIGINT)] = INTERRUPTED
        on_sigterm = signal.getsignal(signal.SIGTERM)
        if isinstance(on_sigterm, ExitOnSignal):
            codes[int(signal.SIGTERM)] = on_sigterm.code
    with _immediate_exits(codes):
        yield


@contextmanager
def _immediate_exits(codes: Mapping[int, int]) -> Iterator[None]:
    def end(number: int, _: FrameType | None) -> None:
        if sys.stderr.isatty():  # a line may be half written there
            os.write(sys.stderr.fileno(), b"\n")
        os._exit(codes[number])

    with signal_handlers(dict.fromkeys(codes, end)):
        yield
