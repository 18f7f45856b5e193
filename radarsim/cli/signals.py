"""Signal handling of commands that report an interruption by their exit code."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from radarsim.signal_handlers import INTERRUPTED, TERMINATED, signal_handlers


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
