"""Pools of worker processes."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from typing import Any


@contextmanager
def worker_pool(
    count: int, prepare: Callable[..., None] | None = None, *settings: Any
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes; leaving it early terminates those that still run.

    Args:
        count: Number of processes. Each is a fresh interpreter, so it can only be given
            functions of modules.
        prepare: Called in each process before its first task.
        settings: Its arguments.
    """
    others = {*active_children()}
    # spawned, because threads of this process would not survive a fork
    pool = ProcessPoolExecutor(
        count,
        mp_context=get_context("spawn"),
        initializer=_start_worker,
        initargs=(prepare, settings),
    )
    try:
        yield pool
    finally:
        for worker in {*active_children()} - others:
            worker.terminate()  # shutdown alone would wait for the runs to end
        pool.shutdown(cancel_futures=True)


def _start_worker(
    prepare: Callable[..., None] | None, settings: tuple[Any, ...]
) -> None:
    """Leave Ctrl-C to the main process, which terminates its workers, or is killed.

    The same holds for a terminal that is closed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare(*settings)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
