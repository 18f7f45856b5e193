"""TCP proxy: pairs of connections whose bytes go from each to the other unchanged.

Theory of operation
===================
An endpoint forwards what it reads before anything else is done with it. While its
partner's peer accepts no more it stops reading, so a slow peer slows only the one that
sends to it, and nothing is dropped. When a peer closes its sending side, the other peer
gets the same end of stream and may go on sending: half-closed connections stay
half-closed.

When a connection breaks, what it received before is forwarded, then the end of stream.
The other peer has a moment to close by itself: closing at once, with its data unread,
would reset the connection and could take back what was sent last.
"""

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from typing import Any, TypeAlias

from radarsim.autonomy.proxy.line_queue import Side
from radarsim.errors import describe_os_error
from radarsim.listening import (
    configure_socket,
    exit_code_of_signal,
    listen,
    peer_name,
)

log = logging.getLogger("radarsim.autonomy.proxy")

READ_BYTES = 65_536
CLOSE_GRACE = 2.0  # s for a peer to close after its partner is gone
CONNECT_TIMEOUT = 5.0  # s for the server to accept a connection

DataCallback: TypeAlias = Callable[[int, Side, bytes], None]


class Endpoint(asyncio.Protocol):
    """One connection of a pair; it reads nothing before it is joined with the other."""

    def __init__(
        self,
        on_data: Callable[[bytes], None],
        connected: set["Endpoint"],
        on_connected: "Callable[[Endpoint], None] | None" = None,
    ) -> None:
        """Create an endpoint without a partner.

        Args:
            on_data: Called with what has been forwarded; must not raise or block.
            connected: Set that this endpoint is in while it is connected.
            on_connected: Called once it is connected.
        """
        self._on_data = on_data
        self._connected = connected
        self._on_connected = on_connected
        self._transport: asyncio.Transport | None = None
        self._partner: Endpoint | None = None
        self._has_ended = False  # its peer sends no more
        self._is_draining = False  # its partner is gone: what its peer sends is dropped

    @property
    def peer(self) -> str:
        """Address and port of the peer, for the log."""
        assert self._transport is not None
        return peer_name(self._transport)

    @property
    def has_ended(self) -> bool:
        """Whether its peer sends no more."""
        return self._has_ended

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for a partner."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        configure_socket(transport)
        # With anything that waits to be written the partner stops reading, so that a
        # slow peer slows the one that sends, and memory does not grow.
        transport.set_write_buffer_limits(0)
        transport.pause_reading()
        self._connected.add(self)
        if self._on_connected is not None:
            self._on_connected(self)

    def join(self, partner: "Endpoint") -> None:
        """Start to read, and to forward to a partner; to be called for both of them."""
        assert self._transport is not None
        self._partner = partner
        self._transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        """Forward the data, then pass it to the callback."""
        if self._partner is not None and not self._is_draining:
            self._partner.send(data)
            self._on_data(data)

    def eof_received(self) -> bool:
        """Forward the end of stream, after all data."""
        self._has_ended = True
        partner = self._partner
        if partner is not None:
            partner.send_end()
            # Both directions have ended, and nothing can come any more.
            if self._is_draining or partner.has_ended:
                self.close()
                partner.close()
        return True  # the transport stays open for what the partner still receives

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002
        """Forward what came before, and let the other peer close."""
        self._connected.discard(self)
        partner, self._partner = self._partner, None
        if partner is None or self._transport is None:
            return
        if not (self._is_draining or self._has_ended):
            rest = _read_unread(self._transport.get_extra_info("socket"))
            if rest:
                partner.send(rest)
                self._on_data(rest)
        partner.drain()

    def pause_writing(self) -> None:
        """Stop the partner from reading."""
        if self._partner is not None:
            self._partner.set_reading(on=False)

    def resume_writing(self) -> None:
        """Let the partner read on."""
        if self._partner is not None:
            self._partner.set_reading(on=True)

    def set_reading(self, *, on: bool) -> None:
        """Stop reading, or read on; an endpoint that drains always reads."""
        assert self._transport is not None
        if on or self._is_draining:
            self._transport.resume_reading()
        else:
            self._transport.pause_reading()

    def send(self, data: bytes) -> None:
        """Send data as soon as the peer accepts it."""
        assert self._transport is not None
        if not self._transport.is_closing():
            self._transport.write(data)

    def send_end(self) -> None:
        """Send the end of stream after all data."""
        assert self._transport is not None
        with suppress(OSError):  # the peer may be gone
            self._transport.write_eof()

    def drain(self) -> None:
        """Send what waits, and close when the peer does so, or soon."""
        assert self._transport is not None
        self._is_draining = True
        self.send_end()
        self._transport.resume_reading()  # to notice that the peer closes
        if self._has_ended:
            self.close()
        else:
            asyncio.get_running_loop().call_later(CLOSE_GRACE, self.close)

    def close(self) -> None:
        """Close as soon as all data is sent."""
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Close at once, without notice to the partner."""
        # So that ``connection_lost`` forwards nothing, and does not drain.
        self._partner = None
        if self._transport is not None:
            self._transport.abort()


def _read_unread(sock: Any) -> bytes:
    """Read what a broken connection received before it broke.

    A write may fail on it while data of the peer still waits to be read.
    """
    chunks = []
    # By a duplicate, since asyncio lets nobody receive from its own socket.
    with suppress(OSError), sock.dup() as duplicate:
        while chunk := duplicate.recv(READ_BYTES):
            chunks.append(chunk)
    return b"".join(chunks)


class TcpProxy:
    """Forwards between clients and a server; neither notices it.

    Attributes:
        address: Host and port that it listens on, once started.
    """

    def __init__(self, server: tuple[str, int], on_data: DataCallback) -> None:
        """Create a proxy that does not listen yet.

        Args:
            server: Host and port; each client gets its own connection to it.
            on_data: Called with everything that has been forwarded, and the number of
                its connection, from 1; must not raise or block.
        """
        self.address = ("", 0)
        self._server = server
        self._on_data = on_data
        self._numbers = count(1)
        self._connected: set[Endpoint] = set()
        self._joining: set[asyncio.Task[None]] = set()
        self._listener: asyncio.Server | None = None

    async def start(self, address: str = "127.0.0.1", port: int = 0) -> None:
        """Listen.

        Args:
            address: Address to listen on.
            port: 0 for a free one.

        Raises:
            ServerError: If the port is taken, or the address is not of this machine.
        """
        self._listener, self.address = await listen(self._endpoint, address, port)

    async def stop(self) -> None:
        """Close the port and all connections, at once."""
        if self._listener is not None:
            self._listener.close()
        # A client that waits for its server must not be joined after this.
        joining = list(self._joining)
        for task in joining:
            task.cancel()
        await asyncio.gather(*joining, return_exceptions=True)
        for endpoint in list(self._connected):
            endpoint.abort()
        await asyncio.sleep(0)  # sockets are closed in the next iteration of the loop

    @property
    def connections(self) -> int:
        """Number of connections; a client and the server behind it have one each."""
        return len(self._connected)

    def _endpoint(self) -> Endpoint:
        number = next(self._numbers)

        def connect_server(client: Endpoint) -> None:
            task = asyncio.create_task(self._join(client, number))
            self._joining.add(task)
            task.add_done_callback(self._joining.discard)

        on_data = partial(self._on_data, number, "client")
        return Endpoint(on_data, self._connected, connect_server)

    async def _join(self, client: Endpoint, number: int) -> None:
        """Connect a client to the server, or close it if the server is not there."""
        log.info("%s: connected as number %d", client.peer, number)
        on_data = partial(self._on_data, number, "server")
        loop = asyncio.get_running_loop()
        host, port = self._server
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                _, server = await loop.create_connection(
                    lambda: Endpoint(on_data, self._connected), host, port
                )
        except (OSError, UnicodeError) as error:
            reason = describe_os_error(error)
            log.warning("%s: no server at %s:%d: %s", client.peer, host, port, reason)
            client.abort()
            return
        client.join(server)
        server.join(client)


async def forward_until_signal(
    proxy: TcpProxy,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
) -> int:
    """Forward until Ctrl-C or a request to terminate.

    Args:
        proxy: Proxy to start; it is stopped when this returns.
        address: Address to listen on.
        port: 0 for a free one.
        announce: Called with the address as soon as clients can connect.

    Returns:
        Exit code of a program that does nothing else: 130 after an interrupt, 0 after a
        request to terminate.

    Raises:
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as exit_code:
        try:
            await proxy.start(address, port)
            announce(proxy.address)
            return await exit_code
        finally:
            await proxy.stop()
