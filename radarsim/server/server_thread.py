"""Runs a server in a separate thread."""

import asyncio
import concurrent.futures
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final, TypeVar

from radarsim.server.host import Host
from radarsim.server.tcp_server import Server

Value = TypeVar("Value")

STOP_TIMEOUT: Final = 30.0  # s; a stop usually takes some milliseconds
POLL: Final = 0.5  # s between two checks whether the thread is still alive


class ServerThread(threading.Thread):
    """A thread that runs a server in its own event loop and collects its errors."""

    def __init__(
        self,
        host: Host,
        *,
        speed: float,
        after_tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Prepare a server.

        Args:
            host: The host to serve; from now on only this thread may use it.
            speed: Simulated seconds per second of the wall clock.
            after_tick: Called in the thread after each tick.
        """
        super().__init__(name="usarsim_server", daemon=True)
        self._server = Server(host, speed=speed, after_tick=after_tick)
        self._listens_on = ("127.0.0.1", 0)
        self._address = ("", 0)
        self._errors: list[Exception] = []
        self._up = threading.Event()
        self._end: Callable[[], object] = lambda: None
        self._call_soon: Callable[[Callable[[], None]], object]

    def begin(self, address: str = "127.0.0.1", port: int = 0) -> tuple[str, int]:
        """Start, and wait until clients can connect.

        Args:
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.

        Returns:
            Host and port on which the server listens.

        Raises:
            ExceptionGroup: If the server cannot start.
        """
        self._listens_on = address, port
        self.start()
        self._up.wait()
        if self._errors:
            self.finish()
        return self._address

    def finish(self) -> None:
        """Close the port and all connections, and stop the thread.

        Raises:
            ExceptionGroup: All errors since the start, if there were any.
        """
        with suppress(RuntimeError):  # the loop is closed if the server has failed
            self._end()
        self.join(STOP_TIMEOUT)
        if self.is_alive():
            late = f"the server thread has not ended within {STOP_TIMEOUT:g} s"
            self._errors.append(TimeoutError(late))
        if self._errors:
            raise ExceptionGroup("usarsim_server failed", self._errors)

    def call(self, function: Callable[[], Value]) -> Value:
        """Call a function in the server's thread between two ticks; return its value.

        Raises:
            ExceptionGroup: If the server has failed.
        """
        called: concurrent.futures.Future[Value] = concurrent.futures.Future()

        def run() -> None:
            try:
                called.set_result(function())
            except BaseException as error:  # noqa: BLE001 - the caller gets it
                called.set_exception(error)

        with suppress(RuntimeError):  # the loop is closed if the server has failed
            self._call_soon(run)
        while not concurrent.futures.wait([called], timeout=POLL).done:
            if not self.is_alive():
                self.finish()
        return called.result()

    def run(self) -> None:
        """Serve until ``finish`` is called or an error occurs."""
        try:
            with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
                runner.run(self._serve())
        except Exception as error:  # noqa: BLE001 - finish() raises it
            self._errors.append(error)
        finally:
            self._up.set()

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        # By default, asyncio only logs errors of callbacks; finish() must raise them.
        loop.set_exception_handler(self._add_error)
        task = asyncio.current_task()
        assert task is not None
        self._call_soon = loop.call_soon_threadsafe
        self._end = partial(self._call_soon, task.cancel)
        server = self._server
        try:
            await server.start(*self._listens_on)
            self._address = server.address
            self._up.set()
            await server.wait_failed()
        except asyncio.CancelledError:
            pass  # finish() was called
        finally:
            await server.stop()

    def _add_error(self, _: object, context: dict[str, Any]) -> None:
        """Collect an error of a callback and stop, so that clients do not wait."""
        error = context.get("exception")
        if not isinstance(error, Exception):
            error = RuntimeError(context["message"])
        self._errors.append(error)
        self._end()
