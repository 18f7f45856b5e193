"""A pool of worker processes for runs that are independent of each other."""

import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes; leaving it early terminates those that still run.

    Args:
        count: Number of processes. Each is a fresh interpreter, so it can only be given
            functions of modules.
    """
    others = {*active_children()}
    # spawned, because threads of this process would not survive a fork
    pool = ProcessPoolExecutor(
        count, mp_context=get_context("spawn"), initializer=_ignore_interrupts
    )
    try:
        yield pool
    finally:
        for worker in {*active_children()} - others:
            worker.terminate()  # shutdown alone would wait for the runs to end
        pool.shutdown(cancel_futures=True)


def _ignore_interrupts() -> None:
    """Leave Ctrl-C to the main process; it terminates the workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
