"""Loads the engine of a server; one that has to compile it listens already.

A thread loads it, after a process of its own has compiled what is not in the cache.
Where there is no cache, or the process has failed, the thread compiles.

A process of its own compiles what a server needs, and writes it into the cache.

It is a process and not a thread, because compiling holds Python's global lock most of
the time, and clients would wait for their greeting.

It writes a line ``compiling`` when it begins to compile, which it does not if all is in
the cache, and a line ``failed`` with the reason before it ends with an error.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from typing import TYPE_CHECKING, Final

from radarsim.errors import ServerError, describe_os_error
from radarsim.kernel_cache import cache_folder, compilation, is_complete, mark_complete
from radarsim.server.host import Host

if TYPE_CHECKING:
    from radarsim.simulation.simulation import Simulation

COMPILING: Final = "compiling"
FAILED: Final = "failed"
# The modules are found where this process has found them.
PROGRAM: Final = (
    "import sys; sys.path[:] = sys.argv[1:];"
    "from radarsim.server.engine_loader import main; main()"
)


class CompilerProcess:
    """Compiles in a process of its own."""

    def __init__(self) -> None:
        """Describe a process that is not started yet."""
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._stopped = False

    def run(self) -> None:
        """Compile what is not cached, and tell the observers of ``compilation``.

        Raises:
            ServerError: If the process has failed, was ended or cannot be started.
        """
        with self._lock:
            if self._stopped:
                raise ServerError("it was stopped")
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", PROGRAM, *sys.path],
                    stdin=subprocess.PIPE,  # closed when this process ends, in any way
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    text=True,
                    start_new_session=True,  # Ctrl-C in a terminal is not for it
                )
            except OSError as error:
                text = f"cannot start it: {describe_os_error(error)}"
                raise ServerError(text) from error
        with self._process as process, ExitStack() as until_end:
            reason = ""
            assert process.stdout is not None
            for line in process.stdout:
                word, _, text = line.strip().partition(" ")
                if word == COMPILING:
                    until_end.enter_context(compilation.running())
                elif word == FAILED:
                    reason = text
            code = process.wait()
        if code < 0 and not reason:
            reason = f"ended by signal {-code}"
            with suppress(ValueError):  # a signal without a name
                reason = f"ended by {signal.Signals(-code).name}"
        if code:
            raise ServerError(reason or f"exit code {code}")

    def stop(self) -> None:
        """End the process at once, from any thread."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()


def main() -> None:
    """Compile all that a server needs; the process ends when its parent does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compilation.observers.append(_tell)
    compilation.on_unsaved = _fail
    try:
        warm_up_scanners(warm_up())
    except (OSError, MemoryError) as error:
        _fail(error)
    mark_complete()


def warm_up() -> Simulation:
    """Compile all that a server needs, but what only some scanners do."""
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    # The smallest map will do.
    return Host(load_map("empty_room")).simulation


def warm_up_scanners(simulation: Simulation) -> None:
    """Load or compile what the scanners of all add-ons need."""
    for items in simulation.scanner_items.values():
        items.warm_up()


def _end_with_parent() -> None:
    # Nothing is written to it: this returns when the parent has ended, however it did.
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


def _tell(_: str | None) -> None:
    compilation.observers.remove(_tell)  # once is enough
    print(COMPILING, flush=True)  # noqa: T201


def _fail(error: OSError | MemoryError) -> None:
    """End the process at once, with a reason."""
    if isinstance(error, MemoryError):
        reason = "not enough memory"
    else:
        reason = describe_os_error(error)
    print(FAILED, reason, flush=True)  # noqa: T201
    os._exit(1)


log = logging.getLogger("radarsim.server")


class EngineLoader:
    """Makes the simulation of a host in a thread, once."""

    def __init__(self, host: Host, compiler: CompilerProcess | None = None) -> None:
        """Describe what is not started yet.

        Args:
            host: The host whose simulation is made.
            compiler: Compiles what is not cached; None for one that does.
        """
        self._host = host
        self._compiler = compiler or CompilerProcess()
        self._thread: threading.Thread | None = None
        self._stopped = False

    @property
    def is_running(self) -> bool:
        """Whether the thread runs, which nothing can end but the end of the process."""
        return self._thread is not None and self._thread.is_alive()

    async def load(self) -> Simulation:
        """Compile what is not cached, and return the simulation.

        Raises:
            EngineError: If Embree cannot be loaded.
        """
        loop = asyncio.get_running_loop()
        made: asyncio.Future[Simulation] = loop.create_future()
        self._thread = threading.Thread(
            target=self._run, args=(loop, made), name="engine", daemon=True
        )
        self._thread.start()
        return await made

    def stop(self) -> None:
        """End the process that compiles, at once; a thread that loads runs on."""
        self._stopped = True
        self._compiler.stop()

    def _run(
        self, loop: asyncio.AbstractEventLoop, made: asyncio.Future[Simulation]
    ) -> None:
        def settle() -> None:
            if not made.done():
                answer()

        answer: Callable[[], None]
        simulation = None
        try:
            if not is_complete() and cache_folder() is not None:
                self._compile()
            simulation = self._host.make_simulation()
            if not is_complete():  # it has to be compiled here
                warm_up_scanners(simulation)
            # What is there now stays. To look through it takes the garbage collector
            # some 90 ms, by which scans would be late.
            gc.collect()
            gc.freeze()
        except Exception as error:  # noqa: BLE001 - load() raises it
            answer = partial(made.set_exception, error)
        else:
            answer = partial(made.set_result, simulation)
        # A thread may only ask the loop to set the result: futures are not safe to
        # share.
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(settle)
        if simulation is not None:
            # From the cache this takes a moment, and few robots need it.
            warm_up_scanners(simulation)

    def _compile(self) -> None:
        """Let the process compile what is not cached.

        Raises:
            ServerError: If it was stopped.
        """
        try:
            self._compiler.run()
        except ServerError as error:
            if self._stopped:
                raise
            log.warning(
                "the process that compiles has failed, the server compiles: %s", error
            )
