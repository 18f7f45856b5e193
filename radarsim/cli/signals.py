"""What signals do to commands that do not end by them as a matter of course."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

INTERRUPTED: Final = 130
TERMINATED: Final = 143  # as shells call it


def end_unfinished() -> None:
    """Have a request to terminate end with 143, where 0 would say that all is done."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))


@contextmanager
def ending_at_once(terminated: int = TERMINATED) -> Iterator[None]:
    """Have signals end the process on the spot.

    For as long as things are made ready and nothing is begun. What is being compiled
    would lose the exception that Python raises otherwise, end with many words, or with
    none, by a fault of its memory.

    Args:
        terminated: The exit code after a request to terminate.
    """
    codes: dict[int, int] = {
        signal.SIGINT: INTERRUPTED,
        signal.SIGTERM: terminated,
    }
    before = {
        number: signal.signal(number, lambda number, _: os._exit(codes[number]))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
