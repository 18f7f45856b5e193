"""Loads the engine of a server that listens already.

A thread loads it, after a process of its own has compiled what is not in the cache.
Where there is no cache, or the process has failed, the thread compiles.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from radarsim.errors import ServerError
from radarsim.host import Host
from radarsim.kernel_cache import cache_folder, is_complete
from radarsim.server.compiler_process import CompilerProcess

if TYPE_CHECKING:
    from radarsim.simulation.simulation import Simulation

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
        try:
            self._compile()
            simulation = self._host.make_simulation()
            # What is there now stays. To look through it takes the garbage collector
            # some 90 ms, by which scans would be late.
            gc.collect()
            gc.freeze()
        except Exception as error:  # noqa: BLE001 - load() raises it
            answer = partial(made.set_exception, error)
        else:
            answer = partial(made.set_result, simulation)
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(settle)

    def _compile(self) -> None:
        """Let the process compile what is not cached.

        Raises:
            ServerError: If it was stopped.
        """
        if is_complete() or cache_folder() is None:
            return
        try:
            self._compiler.run()
        except ServerError as error:
            if self._stopped:
                raise
            log.warning(
                "the process that compiles has failed, the server compiles: %s", error
            )
