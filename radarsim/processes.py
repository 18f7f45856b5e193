"""Worker processes, a background thread, and the signals that end the program.

SIGINT, SIGTERM and SIGHUP end the program at once, or raise an exception. By default
they end it at once, even while modules are imported, since an exception in a callback
from C would be lost, print a traceback, or crash. They raise an exception only while
there is work to save or state to restore.

This module imports very little, so a program can install its handlers first.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import active_children, get_context, resource_tracker
from types import FrameType
from typing import Final, NoReturn, ParamSpec, TypeVar

HUNG_UP: Final = 129  # exit codes as shells report them
INTERRUPTED: Final = 130
BROKEN_PIPE: Final = 141  # the reader of the output, such as ``head``, has ended
TERMINATED: Final = 143

MOST_THREADS: Final = 1024  # limit of the engine
_LOOK_INTERVAL: Final = 1.0  # s between two checks whether the main process runs

_LEFT_TO_THE_MAIN_PROCESS = {signal.SIGINT}
_exit_codes = {int(signal.SIGINT): INTERRUPTED, int(signal.SIGTERM): TERMINATED}
if sys.platform != "win32":
    _exit_codes[int(signal.SIGHUP)] = HUNG_UP  # the terminal was closed
    _LEFT_TO_THE_MAIN_PROCESS.add(signal.SIGHUP)

# Paths of temporary files that `exit_immediately` removes.
unfinished_files: Final[set[str]] = set()

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def signal_handlers(
    handlers: Mapping[int, Callable[[int, FrameType | None], object]],
) -> Iterator[None]:
    """Install signal handlers, and restore the previous handlers at the end.

    A handler that other code has replaced meanwhile is not restored.

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
            if signal.getsignal(number) is handlers[number]:
                signal.signal(number, handler)


@contextmanager
def exit_immediately_on_signals() -> Iterator[None]:
    """Make exit signals such as Ctrl-C end the process at once, without an exception.

    The handlers are not installed outside of the main thread, since only that thread
    handles signals, or for signals that were ignored when the process was started.
    """
    with signal_handlers(dict.fromkeys(_heeded_signals(), _exit_immediately)):
        yield


@contextmanager
def raise_on_signals() -> Iterator[None]:
    """Make exit signals such as Ctrl-C raise SystemExit, so that work can be saved.

    Every signal raises SystemExit, even while work is being saved. The handlers are
    installed in the same cases as those of ``exit_immediately_on_signals``.
    """
    with signal_handlers(dict.fromkeys(_heeded_signals(), _raise_exit)):
        yield


def set_exit_code_of_sigterm(code: int) -> None:
    """Set the exit code for SIGTERM: 143 if work is unfinished, 0 if it is finished."""
    _exit_codes[signal.SIGTERM] = code


def exit_immediately(code: int) -> NoReturn:
    """End the process at once after flushing output, without waiting for threads.

    Threads that load the engine would crash during a regular shutdown of Python.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    _remove_unfinished_files()
    os._exit(code)


def ignore_signals() -> None:
    """Ignore exit signals such as Ctrl-C while the process ends by itself.

    Python restores the default handlers before the process has ended, so a second
    signal would kill the process. Ignored signals stay ignored.
    """
    for number in _exit_codes:
        signal.signal(number, signal.SIG_IGN)


def is_ignored(number: int) -> bool:
    """Return whether a signal is ignored, as by ``nohup``."""
    return signal.getsignal(number) is signal.SIG_IGN


def _heeded_signals() -> list[int]:
    if threading.current_thread() is not threading.main_thread():
        return []
    return [number for number in _exit_codes if not is_ignored(number)]


def _exit_immediately(number: int, _: FrameType | None) -> None:
    with suppress(OSError):  # the terminal is closed
        if os.isatty(2):  # a line may be half written there
            # ``print`` is not used, since the interrupted code may be writing to the
            # same stream.
            os.write(2, b"\n")
    _remove_unfinished_files()
    os._exit(_exit_codes[number])


def _remove_unfinished_files() -> None:
    for path in tuple(unfinished_files):
        with suppress(OSError):
            os.unlink(path)  # noqa: PTH108 - pathlib is imported later


def _raise_exit(number: int, _: FrameType | None) -> None:
    sys.exit(_exit_codes[number])


class BackgroundThread:
    """A thread that runs functions one after the other.

    The thread starts with the first function. It ends when this object is freed, or
    with the process. A fork of the process starts its own thread.
    """

    def __init__(self) -> None:
        """Create the object without starting the thread."""
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def submit(
        self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        """Run a function in the thread, after all functions that were submitted before.

        Returns:
            A future of the function's result.
        """
        if self._pool is None or self._process != os.getpid():
            self._process = os.getpid()
            self._pool = ThreadPoolExecutor(1, "radarsim-background")
        return self._pool.submit(function, *args, **kwargs)


def process_cpu_count() -> int:
    """Return the number of processors that this process may use, at least 1."""
    # Python 3.13 has `os.process_cpu_count` for this.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def thread_count() -> int:
    """Return the number of threads that the engine may use, at least 1.

    ``OMP_NUM_THREADS`` limits the number: joblib and dask set it in worker processes,
    so that all workers together have one thread per processor.
    """
    limit = os.environ.get("OMP_NUM_THREADS", "")
    count = process_cpu_count()
    count = max(min(count, int(limit)), 1) if limit.isdecimal() else count
    return min(count, MOST_THREADS)


@contextmanager
def starting_workers() -> Iterator[None]:
    """Start worker processes with Ctrl-C blocked, until ``start_worker`` ignores it.

    While Python starts, Ctrl-C would print a traceback. Signals to this process are
    delayed until the end of the block, since a worker that is only partly started would
    not be terminated.
    """
    came: list[int] = []
    handlers = dict.fromkeys(_heeded_signals(), lambda number, _: came.append(number))
    with signal_handlers(handlers), _block_for_children():
        yield
    for number in came:
        signal.raise_signal(number)


@contextmanager
def _block_for_children() -> Iterator[None]:
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # before blocking, since it unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _LEFT_TO_THE_MAIN_PROCESS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_worker(parent: int, prepare: Callable[[], object]) -> None:
    """Initialise a worker process: ignore Ctrl-C and SIGHUP, and call ``prepare``.

    The main process handles these signals and terminates its workers.

    Args:
        parent: Process id of the main process.
        prepare: Called once.
    """
    for number in _LEFT_TO_THE_MAIN_PROCESS:
        signal.signal(number, signal.SIG_IGN)
    # A killed main process cannot terminate its workers, so each worker checks whether
    # the main process still runs.
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    prepare()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_INTERVAL)
    os._exit(1)  # sys.exit would end this thread only


@contextmanager
def worker_process(prepare: Callable[[], object]) -> Iterator[ProcessPoolExecutor]:
    """Start a worker process; the end of the block terminates it with its tasks.

    Args:
        prepare: Called in the process before its first task. The process is a fresh
            interpreter, so it accepts only functions defined at module level.
    """
    # Workers of other pools are listed, since they must not be terminated here.
    others = {*active_children()}
    # Workers are spawned, not forked, since threads of this process would not survive a
    # fork.
    pool = ProcessPoolExecutor(
        1,
        mp_context=get_context("spawn"),
        initializer=start_worker,
        initargs=(os.getpid(), prepare),
    )
    try:
        with starting_workers():
            pool.submit(os.getpid)  # the process starts with its first task
        yield pool
    finally:
        for worker in {*active_children()} - others:
            worker.terminate()  # shutdown alone would wait for running tasks
        pool.shutdown(cancel_futures=True)
