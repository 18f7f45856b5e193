"""Signal handlers for the time that something runs, and the exit codes of signals."""

import signal
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
