"""A port at which clients find the server behind it."""

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import TypeAlias

from radarsim.foreground import listen
from radarsim.tap.forwarding import End
from radarsim.tap.lines import Side

log = logging.getLogger("radarsim.tap")

Hear: TypeAlias = Callable[[int, Side, bytes], None]

PATIENCE = 5.0  # s for the server to accept a connection


class Tap:
    """Forwards between clients and a server, which notice nothing of it.

    Attributes:
        address: Host and port that it listens on, once started.
    """

    def __init__(self, server: tuple[str, int], hear: Hear) -> None:
        """Make a tap that does not listen yet.

        Args:
            server: Host and port; each client gets a connection of its own to it.
            hear: Shown every piece that has been sent on, with the number of its
                connection, from 1; does not raise, and returns at once.
        """
        self.address = ("", 0)
        self._server = server
        self._hear = hear
        self._numbers = count(1)
        self._connected: set[End] = set()
        self._joining: set[asyncio.Task[None]] = set()
        self._listener: asyncio.Server | None = None

    async def start(self, address: str = "127.0.0.1", port: int = 0) -> None:
        """Listen.

        Args:
            address: To listen on.
            port: 0 for a free one.

        Raises:
            ServerError: If the port is taken, or the address is none of ours.
        """
        self._listener, self.address = await listen(self._expect, address, port)

    async def stop(self) -> None:
        """Close the port and all connections, at once."""
        if self._listener is not None:
            self._listener.close()
        joining = list(self._joining)
        for task in joining:
            task.cancel()
        await asyncio.gather(*joining, return_exceptions=True)
        for end in list(self._connected):
            end.abort()
        await asyncio.sleep(0)  # sockets are closed in the loop's next round

    @property
    def connections(self) -> int:
        """How many there are; a client and the server behind it have one each."""
        return len(self._connected)

    def _expect(self) -> End:
        """Make the end for the next client."""
        number = next(self._numbers)

        def greet(client: End) -> None:
            task = asyncio.create_task(self._join(client, number))
            self._joining.add(task)
            task.add_done_callback(self._joining.discard)

        return End(partial(self._hear, number, "client"), self._connected, greet)

    async def _join(self, client: End, number: int) -> None:
        """Connect a client to the server, or close it if that is not there."""
        log.info("%s: connected as number %d", client.peer, number)
        hear = partial(self._hear, number, "server")
        loop = asyncio.get_running_loop()
        host, port = self._server
        try:
            async with asyncio.timeout(PATIENCE):
                _, server = await loop.create_connection(
                    lambda: End(hear, self._connected), host, port
                )
        except OSError as error:
            why = str(error) or "timed out"
            log.warning("%s: no server at %s:%d: %s", client.peer, host, port, why)
            client.abort()
            return
        client.join(server)
        server.join(client)
