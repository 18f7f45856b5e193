"""Worker processes, a background thread, and the signals that end the program.

SIGINT, SIGTERM and SIGHUP end it at once, or by an exception. At once is the default,
also while modules are imported: an exception gets lost in callbacks from C, or ends in
a traceback or a crash there. Only where something is to be saved or restored the
signals raise an exception.

Imports next to nothing, so that a program can install its handlers first of all.
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
BROKEN_PIPE: Final = 141  # the reader of the output has gone, such as ``head``
TERMINATED: Final = 143

MOST_THREADS: Final = 1024  # of the engine
_LOOK_INTERVAL: Final = 1.0  # s between two looks of a worker at its main process

_LEFT_TO_THE_MAIN_PROCESS = {signal.SIGINT}
_exit_codes = {int(signal.SIGINT): INTERRUPTED, int(signal.SIGTERM): TERMINATED}
if sys.platform != "win32":
    _exit_codes[int(signal.SIGHUP)] = HUNG_UP  # the terminal was closed
    _LEFT_TO_THE_MAIN_PROCESS.add(signal.SIGHUP)

# Temporary files, which are removed if the process ends at once.
unfinished_files: Final[set[str]] = set()

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def signal_handlers(
    handlers: Mapping[int, Callable[[int, FrameType | None], object]],
) -> Iterator[None]:
    """Install signal handlers, and put the previous ones back at the end.

    A handler that has been replaced meanwhile by still another one stays replaced.

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
    """Make these signals end the process at once, without raising an exception.

    Does nothing outside of the main thread, which alone gets signals, nor for signals
    that the parent process has set to be ignored.
    """
    with signal_handlers(dict.fromkeys(_heeded_signals(), _exit_immediately)):
        yield


@contextmanager
def raise_on_signals() -> Iterator[None]:
    """Make these signals raise SystemExit, so that work can be saved.

    Every signal does, also those that come while work is saved. Does nothing where
    ``exit_immediately_on_signals`` does nothing.
    """
    with signal_handlers(dict.fromkeys(_heeded_signals(), _raise_exit)):
        yield


def set_exit_code_of_sigterm(code: int) -> None:
    """Set what SIGTERM makes of the process: 143 if work is left, 0 if it is done."""
    _exit_codes[signal.SIGTERM] = code


def exit_immediately(code: int) -> NoReturn:
    """End the process at once, though other threads still run, with all output written.

    Threads that load the engine would crash while Python shuts down.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    _remove_unfinished_files()
    os._exit(code)


def ignore_signals() -> None:
    """Ignore these signals, as the process ends by itself.

    Python restores the default handlers before the process has ended; a second signal
    would then kill it. Signals that are ignored stay ignored.
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
            # Not by print: the code that was interrupted may be writing to the same
            # stream.
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
    """Runs functions one after the other, in parallel to the thread that asks for them.

    The thread is there from the first function on. It ends when nobody needs it any
    more, or with the process. A fork of the process gets a thread of its own.
    """

    def __init__(self) -> None:
        """Start nothing yet."""
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def submit(
        self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        """Run a function after those that were given before.

        Returns:
            Waits for what the function returns, or raises.
        """
        if self._pool is None or self._process != os.getpid():
            self._process = os.getpid()
            self._pool = ThreadPoolExecutor(1, "radarsim-background")
        return self._pool.submit(function, *args, **kwargs)


def process_cpu_count() -> int:
    """Return the number of processors that this process may use, at least 1."""
    # `os.process_cpu_count` of Python 3.13 does the same.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def thread_count() -> int:
    """Return on how many threads the engine may work, at least 1.

    ``OMP_NUM_THREADS`` limits them: joblib and dask set it in worker processes, so that
    all of these together have as many threads as processors.
    """
    limit = os.environ.get("OMP_NUM_THREADS", "")
    count = process_cpu_count()
    count = max(min(count, int(limit)), 1) if limit.isdecimal() else count
    return min(count, MOST_THREADS)


@contextmanager
def starting_workers() -> Iterator[None]:
    """Start worker processes with Ctrl-C blocked, until ``start_worker`` ignores it.

    Python needs a moment to start, in which Ctrl-C would end in a traceback. Signals to
    this process wait meanwhile: one that is half started would not be ended.
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
    resource_tracker.ensure_running()  # which would unblock the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _LEFT_TO_THE_MAIN_PROCESS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_worker(parent: int, prepare: Callable[[], object]) -> None:
    """Leave Ctrl-C to the main process, which ends its workers, then prepare this one.

    The same holds for a terminal that is closed.

    Args:
        parent: The main process.
        prepare: Called once.
    """
    for number in _LEFT_TO_THE_MAIN_PROCESS:
        signal.signal(number, signal.SIG_IGN)
    # A main process that is killed ends nobody; its workers would run on.
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    prepare()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_INTERVAL)
    os._exit(1)  # sys.exit would end this thread only


@contextmanager
def worker_process(prepare: Callable[[], object]) -> Iterator[ProcessPoolExecutor]:
    """Start a process; leaving it early terminates what still runs there.

    Args:
        prepare: Called in the process before its first task. The process is a fresh
            interpreter, so it can only be given functions of modules.
    """
    # Other pools of this process keep their workers.
    others = {*active_children()}
    # Spawned, because threads of this process would not survive a fork.
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
            worker.terminate()  # shutdown alone would wait for the runs to end
        pool.shutdown(cancel_futures=True)
