"""Two connections, and bytes that go from each to the other as they come.

Theory of operation
===================
An end sends on what it reads before anything else is done with it. What its partner's
peer does not take yet holds back the reading, so a slow reader slows only who talks to
it, and nothing is ever thrown away. An end whose peer says no more says so to the other
peer, which may go on talking: half-closed connections stay half-closed.

A connection that breaks is another matter: what it brought before it broke is sent on,
then the other peer is told that no more will come. It gets a moment to hang up itself;
to close at once, with words of its own unread, could take back what was sent last.
"""

import asyncio
import logging
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from typing import Any, TypeAlias

from radarsim.proxy.line_queue import Side
from radarsim.server.lifecycle import exit_code_of_signal, listen

SEND_BUFFER_BYTES = 131_072  # what waits in the kernel is stale when it arrives
READ_BYTES = 65_536
LAST_WORDS = 2.0  # s for a peer to hang up whose partner is gone


class End(asyncio.Protocol):
    """One connection of a pair; nothing of it is read before it is joined."""

    def __init__(
        self,
        hear: Callable[[bytes], None],
        connected: set["End"],
        greet: "Callable[[End], None] | None" = None,
    ) -> None:
        """Begin without a partner.

        Args:
            hear: Shown what has been sent on; does not raise, and returns at once.
            connected: This end is in it while there is a connection.
            greet: Called once there is one.
        """
        self._hear = hear
        self._connected = connected
        self._greet = greet
        self._transport: asyncio.Transport | None = None
        self._partner: End | None = None
        self._ended = False  # its peer says no more
        self._deaf = False  # its peer may talk, but nobody is there to be told

    @property
    def peer(self) -> str:
        """Address and port, for the log."""
        assert self._transport is not None
        name = self._transport.get_extra_info("peername")
        return f"{name[0]}:{name[1]}" if isinstance(name, tuple) else "?"

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for a partner."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        _tune(transport.get_extra_info("socket"))
        transport.set_write_buffer_limits(0)
        transport.pause_reading()
        self._connected.add(self)
        if self._greet is not None:
            self._greet(self)

    def join(self, partner: "End") -> None:
        """Begin to read, and to send to a partner; to be called for both of them."""
        assert self._transport is not None
        self._partner = partner
        self._transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        """Send it on, then show it."""
        if self._partner is not None and not self._deaf:
            self._partner.send(data)
            self._hear(data)

    def eof_received(self) -> bool:
        """Tell the other peer that no more will come, once all is sent."""
        self._ended = True
        partner = self._partner
        if partner is not None:
            partner.send_end()
            if self._deaf or partner.has_ended:
                self.close()
                partner.close()
        return True  # what the other one says is still to be sent

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002
        """Send on what came before, and let the other peer hang up."""
        self._connected.discard(self)
        partner, self._partner = self._partner, None
        if partner is None or self._transport is None:
            return
        if not (self._deaf or self._ended):
            rest = _unread(self._transport.get_extra_info("socket"))
            if rest:
                partner.send(rest)
                self._hear(rest)
        partner.finish()

    def pause_writing(self) -> None:
        """Hold the other peer back."""
        if self._partner is not None:
            self._partner.hold(True)

    def resume_writing(self) -> None:
        """Let the other peer talk on."""
        if self._partner is not None:
            self._partner.hold(False)

    @property
    def has_ended(self) -> bool:
        """Whether its peer says no more."""
        return self._ended

    def hold(self, back: bool) -> None:
        """Stop reading, or read on."""
        assert self._transport is not None
        if back and not self._deaf:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()

    def send(self, data: bytes) -> None:
        """Send as much as can be now, and the rest as soon as can be."""
        assert self._transport is not None
        if not self._transport.is_closing():
            self._transport.write(data)

    def send_end(self) -> None:
        """Say that no more will come, once all is sent."""
        assert self._transport is not None
        with suppress(OSError):  # a peer that is gone need not be told
            self._transport.write_eof()

    def finish(self) -> None:
        """Send what waits, and close when the peer does so, or soon."""
        assert self._transport is not None
        self._deaf = True
        self.send_end()
        self._transport.resume_reading()  # to see it hang up
        if self._ended:
            self.close()
        else:
            asyncio.get_running_loop().call_later(LAST_WORDS, self.close)

    def close(self) -> None:
        """Close as soon as all is sent."""
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Close at once, without a word to the partner."""
        self._partner = None
        if self._transport is not None:
            self._transport.abort()


def _tune(sock: Any) -> None:
    """Find out about peers that are gone, and let nothing wait for more to come."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _unread(sock: Any) -> bytes:
    """Read what a broken connection brought before it broke.

    A write may find that it is broken while words of the peer still wait to be read.
    """
    pieces = []
    with suppress(OSError), sock.dup() as again:
        while piece := again.recv(READ_BYTES):
            pieces.append(piece)
    return b"".join(pieces)


# Section from tap.tap.
# A port at which clients find the server behind it.

log = logging.getLogger("radarsim.proxy")

Hear: TypeAlias = Callable[[int, Side, bytes], None]

PATIENCE = 5.0  # s for the server to accept a connection


class TcpProxy:
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


# Section from tap.running.
# A tap in the foreground, until a signal ends it.


async def forward_until_signal(
    tap: TcpProxy,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
) -> int:
    """Forward until Ctrl-C, or until asked to terminate.

    Args:
        tap: To be started; stopped when this returns.
        address: To listen on.
        port: 0 for a free one.
        announce: Told the address as soon as clients can connect.

    Returns:
        The exit code of a program that does nothing else: 130 after an interrupt, 0
        after a request to terminate.

    Raises:
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as ended:
        try:
            await tap.start(address, port)
            announce(tap.address)
            return await ended
        finally:
            await tap.stop()
