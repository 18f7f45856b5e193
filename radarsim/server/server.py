"""A host on a TCP port, paced by the wall clock."""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from radarsim.foreground import exit_code_of_signal, listen
from radarsim.host import Host
from radarsim.server.connection import Connection
from radarsim.simulation.clock import TICK

log = logging.getLogger("radarsim.server")

MOST_CLIENTS = 256
MOST_LAG = 0.1  # s; a clock that is later gives up catching up
COMPLAINT_INTERVAL = 10.0  # s between two lines in the log about that


class Server:
    """Serves a host.

    Attributes:
        address: Host and port that it listens on, once started.
    """

    def __init__(self, host: Host, *, speed: float = 1.0) -> None:
        """Make a server that does not listen yet.

        Args:
            host: The simulation and its clients.
            speed: Simulated seconds in one second of the wall clock.
        """
        self.address = ("", 0)
        self._host = host
        self._period = TICK / speed
        self._connections: set[Connection] = set()
        self._listener: asyncio.Server | None = None
        self._ticking: asyncio.Task[None] | None = None

    async def start(self, address: str = "127.0.0.1", port: int = 3000) -> None:
        """Listen, and let time pass from here on.

        Args:
            address: To listen on.
            port: 0 for a free one.

        Raises:
            ServerError: If the port is taken, or the address is none of ours.
        """
        self._listener, self.address = await listen(
            lambda: Connection(self._host, self._connections, MOST_CLIENTS),
            address,
            port,
        )
        self._ticking = asyncio.create_task(self._tick_for_ever())

    async def stop(self) -> None:
        """Close the port and all connections, at once; whatever has failed before."""
        if self._listener is not None:
            self._listener.close()
        for connection in list(self._connections):
            connection.close()
        if self._ticking is not None:
            self._ticking.cancel()
            await asyncio.wait({self._ticking})
        await asyncio.sleep(0)  # sockets are closed in the loop's next round

    async def failed(self) -> None:
        """Wait until time stops passing, which only a bug can bring about.

        Raises:
            Exception: What stopped it.
        """
        if self._ticking is not None:
            await asyncio.shield(self._ticking)

    async def _tick_for_ever(self) -> None:
        loop = asyncio.get_running_loop()
        due = quiet_until = loop.time()
        lost = 0.0
        while True:
            due += self._period
            lag = loop.time() - due
            if lag > MOST_LAG:
                due += lag
                lost += lag
            if lost and due > quiet_until:
                log.warning("too slow: simulated time waited for %.1f s", lost)
                quiet_until, lost = due + COMPLAINT_INTERVAL, 0.0
            await asyncio.sleep(max(0.0, -lag))
            self.tick()

    def tick(self) -> None:
        """Let 10 ms of simulated time pass, and send what is due."""
        notices = self._host.step()
        for connection in list(self._connections):
            connection.report(
                [n for number, n in notices if number == connection.number]
            )
            connection.flush()


async def serve(
    server: Server,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
) -> int:
    """Serve until a signal comes.

    Args:
        server: To be started.
        address: To listen on.
        port: 0 for a free one.
        announce: Told the address as soon as clients can connect.

    Returns:
        The exit code: 130 after an interrupt, 0 after a request to terminate.

    Raises:
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as ended:
        try:
            await server.start(address, port)
            announce(server.address)
            failed = asyncio.ensure_future(server.failed())
            both: set[asyncio.Future[Any]] = {ended, failed}
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            if failed.done():
                failed.result()
            failed.cancel()
            return ended.result()
        finally:
            await server.stop()
