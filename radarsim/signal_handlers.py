"""Signal handlers for the time that something runs, and the exit codes of signals."""

import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
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


def exit_143_on_sigterm() -> None:
    """Make SIGTERM exit with 143, because 0 would claim that the work is finished."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))


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
    with signal_handlers(
        dict.fromkeys(codes, lambda number, _: os._exit(codes[number]))
    ):
        yield
