"""Base classes of the TCP servers: connections, a refusal log, and read limits.

A connection has an allowance of bytes that grows with every tick. While the allowance
lasts, data is read as soon as it arrives. A connection that has used up its allowance
waits for a turn, in which the server reads from it once, and each tick has only a few
turns. This limits the data that all clients together can send beyond their allowances,
and a client that sends little never waits.
"""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections import deque
from typing import Any, Final

from radarsim.listening import (
    configure_socket,
    find_hung_up,
    listen,
    peer_name,
    raise_file_limit,
    waiting_bytes,
)

log = logging.getLogger("radarsim.server")

# s between two log lines, as thousands of connections may be refused per second
LOG_INTERVAL: Final = 10.0
CLOSE_GRACE = 0.8  # s from the peer's end of stream until the connection is closed
READ_PAUSE: Final = 0.01  # s without reading after invalid data
# A peer is flooding the server if its socket holds this many unread bytes in this many
# successive checks. An end of stream would be behind these bytes, so the server cannot
# find out whether the peer is still connected.
FLOOD_BYTES: Final = 32_768
FLOOD_LOOKS: Final = 8


class RefusalLog:
    """Logs refused connections, at most one line per ``LOG_INTERVAL`` with a count."""

    def __init__(self, kind: str) -> None:
        """Start with no refused connections.

        Args:
            kind: Plural name of the peers, such as "clients".
        """
        self._kind = kind
        self._unlogged = 0
        self._next_line = 0.0

    def add(self, peer: str, limit: int) -> None:
        """Log or count a connection that is refused because the limit is reached.

        Args:
            peer: Address and port of the peer.
            limit: Maximum number of connections.
        """
        now = asyncio.get_running_loop().time()
        if now < self._next_line:
            self._unlogged += 1
            return
        others = f", like {self._unlogged} others before" if self._unlogged else ""
        reason = f"the limit is {limit} {self._kind}"
        log.warning("%s: refused%s: %s", peer, others, reason)
        self._unlogged, self._next_line = 0, now + LOG_INTERVAL


# One peer is permitted for each 16 files that the system lets the server open. If the
# system permits few open files, the others are left for clients with robots.
FILES_EACH: Final = 16


class PeerServer(ABC):
    """Base class of servers: listens on a port and keeps the connections of its peers.

    Attributes:
        address: Host and port on which the server listens, once started.
        peers: The connections.
        refusals: The log of refused peers.
    """

    def __init__(self, port: int, kind: str) -> None:
        """Create a server that does not listen yet.

        Args:
            port: Port to listen on; 0 for a free one.
            kind: Plural name of the peers for the log.
        """
        self.address = ("", 0)
        self.peers: set[Any] = set()
        self.refusals = RefusalLog(kind)
        self._port = port
        self._listener: asyncio.Server | None = None
        self._working: asyncio.Task[None] | None = None

    async def start(self, address: str = "127.0.0.1") -> None:
        """Listen for peers, and start the server's periodic work.

        Args:
            address: Address to listen on.

        Raises:
            ServerError: If the port is taken, or the address is not one of this
                machine.
        """
        self._listener, self.address = await listen(self._accept, address, self._port)
        self._working = asyncio.create_task(self._work())

    @property
    def addresses(self) -> list[str]:
        """All addresses on which the server listens."""
        sockets = () if self._listener is None else self._listener.sockets
        return [each.getsockname()[0] for each in sockets]

    @abstractmethod
    def _accept(self) -> PeerConnection:
        """Return the protocol of a new connection."""

    async def _work(self) -> None:  # noqa: B027 - not all servers do more
        """Do the server's periodic work until cancelled; the base class has none."""

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        self._close()
        await asyncio.sleep(0)  # sockets are closed in the next round of the loop
        if self._working is not None:
            self._working.cancel()
            await asyncio.wait({self._working})

    def _close(self) -> None:
        if self._listener is not None:
            self._listener.close()
        for peer in list(self.peers):
            peer.close()


class PeerConnection(asyncio.BufferedProtocol, ABC):
    """Base class of the connection of one peer.

    Attributes:
        peer: Address and port of the peer, for the log.
        KIND: Name of the kind of peer, for the log.
        SENT: Name of the data that the peer sends, for the log.
        MOST: Maximum number of connected peers.
        READ_BYTES: Maximum number of bytes per read.
    """

    KIND = "peer"
    SENT = "requests"
    MOST = 1
    READ_BYTES = 4096

    def __init__(self, server: PeerServer) -> None:
        """Create the protocol of a connection, which is listed once it is connected."""
        self.peer = "?"
        self._peers, self._refusals = server.peers, server.refusals
        self._buffer = bytearray(self.READ_BYTES)
        self._transport: asyncio.Transport | None = None
        self._grace: asyncio.TimerHandle | None = None  # timer that aborts after EOF
        self._looks = 0  # number of successive checks that found a flood

    @property
    def file_number(self) -> int:
        """File descriptor of the socket."""
        assert self._transport is not None
        number: int = self._transport.get_extra_info("socket").fileno()
        return number

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Accept the peer, or refuse it if there are too many."""
        assert isinstance(transport, asyncio.Transport)
        self.peer = peer_name(transport)
        most = self._most()
        if len(self._peers) >= most:
            self._refusals.add(self.peer, most)
            transport.abort()
            return
        configure_socket(transport)
        self._transport = transport
        self._peers.add(self)
        log.info("%s: %s connected", self.peer, self.KIND)
        self._begin(transport)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - asyncio's name
        """Return the buffer that received bytes are written to."""
        return self._buffer

    def connection_lost(self, error: Exception | None) -> None:
        """Remove the peer from the server."""
        if self._grace is not None:
            self._grace.cancel()  # abort() would fail on a lost transport
        if self._transport is not None:
            self._end(str(error or "closed"))

    def _end(self, reason: str) -> None:
        """Remove the peer from the server, and log the reason."""
        self._forget()
        log.info("%s: %s disconnected: %s", self.peer, self.KIND, reason)

    def close(self) -> None:
        """Close the connection at once."""
        transport = self._transport
        if transport is not None:
            self._forget()
            transport.abort()

    def look(self) -> None:
        """Close the connection if the peer has disconnected or floods the server.

        Call this periodically while reading is paused.
        """
        if self._transport is None:
            return
        if find_hung_up([self.file_number]):
            self._end_in_time()
        self._looks = self._looks + 1 if self._floods() else 0
        if self._looks >= FLOOD_LOOKS:
            log.warning("%s: closed: too many %s", self.peer, self.SENT)
            self.close()

    def _floods(self) -> bool:
        """Return whether more bytes wait in the socket than normal peers send."""
        assert self._transport is not None  # checked by ``look``
        return waiting_bytes(self._transport) >= FLOOD_BYTES

    def _end_in_time(self) -> None:
        """Abort the connection after ``CLOSE_GRACE``, even if data is still unsent."""
        if self._grace is None and self._transport is not None:
            loop = asyncio.get_running_loop()
            self._grace = loop.call_later(CLOSE_GRACE, self._transport.abort)

    def _rest(self) -> None:
        """Pause reading for ``READ_PAUSE``; TCP flow control then slows the peer."""
        if self._transport is not None:
            self._transport.pause_reading()
            asyncio.get_running_loop().call_later(READ_PAUSE, self._read_on)

    def _read_on(self) -> None:
        if self._transport is not None:
            self._transport.resume_reading()

    def _most(self) -> int:
        """Return the maximum number of peers; a low limit of open files reduces it."""
        return raise_file_limit(FILES_EACH * self.MOST) // FILES_EACH

    @abstractmethod
    def _begin(self, transport: asyncio.Transport) -> None:
        """Initialize an accepted connection."""

    def _forget(self) -> None:
        """Remove the peer from the server and drop the transport."""
        self._transport = None
        self._peers.discard(self)


REFILL = 512  # bytes per tick; 50 kB/s is ten times the data rate of a robot's driver
BURST = 2048  # largest allowance, bytes
READ_COST = 128  # bytes added to the size of each read, which takes some 30 us
TURNS = 8  # per tick, for all connections together


class ReadAllowance:
    """The number of bytes that may be read from one connection.

    Attributes:
        exhausted: Whether the connection has to wait for its turn.
        closed: Whether the connection is closed, and needs no turn.
    """

    def __init__(self, turns: ReadTurns) -> None:
        self.exhausted = False
        self.closed = False
        self._turns = turns
        self._left = BURST
        self._tick = turns.ticks

    def spend(self, size: int) -> None:
        """Count a read of ``size`` bytes."""
        grown = (self._turns.ticks - self._tick) * REFILL
        self._tick = self._turns.ticks
        # Each read takes time, so even a packet of one byte must have a cost.
        self._left = min(BURST, self._left + grown) - size - READ_COST
        if self._left < 0 and not self.exhausted:
            self.exhausted = True
            self._turns.append(self)

    def grant(self) -> None:
        """Permit one more read of any size."""
        # The allowance restarts at zero, so a connection that floods gets only one read
        # per turn.
        self.exhausted = False
        self._left = 0
        self._tick = self._turns.ticks


class ReadTurns:
    """A queue of connections that wait to be read, first in, first out.

    Attributes:
        ticks: Number of ticks so far.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self._waiting: deque[ReadAllowance] = deque()

    def append(self, allowance: ReadAllowance) -> None:
        """Queue a connection for its turn."""
        self._waiting.append(allowance)

    def advance(self) -> None:
        """Start a tick, in which the first connections in the queue are read once."""
        self.ticks += 1
        turns = TURNS
        while self._waiting and turns:
            allowance = self._waiting.popleft()
            if not allowance.closed:
                allowance.grant()
                turns -= 1
