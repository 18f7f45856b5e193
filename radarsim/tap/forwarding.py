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
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

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
