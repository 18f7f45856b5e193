"""Processes that share the work of a study."""

import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes; whoever leaves early ends those that still run.

    Args:
        count: How many. Each is a fresh interpreter, so what it is given to do is a
            function of a module.
    """
    others = {*active_children()}
    # threads of this process would not survive a fork
    pool = ProcessPoolExecutor(
        count, mp_context=get_context("spawn"), initializer=_leave_interrupts
    )
    try:
        yield pool
    finally:
        for worker in {*active_children()} - others:
            worker.terminate()  # who wants no more does not want to wait either
        pool.shutdown(cancel_futures=True)


def _leave_interrupts() -> None:
    """Let only the process in charge hear of Ctrl-C; it ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
