"""Worker processes, a background thread, and the signals that end the program.

SIGINT, SIGTERM and SIGHUP end it at once, or by an exception. At once is the default,
also while modules are imported and kernels are compiled: an exception gets lost in
callbacks from C, or ends in a traceback or a crash there. Only where something is to be
saved or restored the signals raise an exception.

Imports next to nothing, so that a program can install its handlers first of all.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import active_children, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import FrameType
from typing import Any, Final, NoReturn, ParamSpec, TypeVar

HUNG_UP: Final = 129  # exit codes as shells report them
INTERRUPTED: Final = 130
BROKEN_PIPE: Final = 141  # who reads what is printed has gone, such as ``head``
TERMINATED: Final = 143

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
    that the parent process has told to be ignored.
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

    Threads that compile would crash while Python shuts down.
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
    """Return whether a signal is ignored, as ``nohup`` tells the process to."""
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
    """Runs functions one after the other, beside the thread that asks for them.

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
    # Other pools of this process keep their workers.
    others = {*active_children()}
    pool = ProcessPoolExecutor(
        count,
        mp_context=_WorkerContext(),
        initializer=_start_worker,
        initargs=(prepare, settings),
    )
    try:
        yield pool
    finally:
        for worker in {*active_children()} - others:
            worker.terminate()  # shutdown alone would wait for the runs to end
        pool.shutdown(cancel_futures=True)


class _Worker(SpawnProcess):
    """A process that begins with Ctrl-C blocked: Python needs a moment to start."""

    def start(self) -> None:
        """Start it."""
        if not hasattr(signal, "pthread_sigmask"):  # Windows
            super().start()
            return
        resource_tracker.ensure_running()  # which would unblock them
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _LEFT_TO_THE_MAIN_PROCESS)
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _WorkerContext(SpawnContext):
    # Spawned, because threads of this process would not survive a fork.
    Process = _Worker


def _start_worker(
    prepare: Callable[..., None] | None, settings: tuple[Any, ...]
) -> None:
    """Leave Ctrl-C to the main process, which terminates its workers, or is killed.

    The same holds for a terminal that is closed.
    """
    for number in _LEFT_TO_THE_MAIN_PROCESS:
        signal.signal(number, signal.SIG_IGN)
    # A main process that is killed terminates nobody; its workers would run on.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare(*settings)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        # sys.exit would end this thread only.
        os._exit(1)
