"""What servers share: ports with a few peers, a log of refusals, and turns for reading.

A connection has an allowance of bytes that grows with every tick. While it lasts, the
connection is read whenever something has come. One that has used up its allowance has
to wait for its turn, in which it is read once, and a tick has only a few turns: what
all clients together can send beyond their allowances is limited, and a client that
sends little never waits.
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

LOG_INTERVAL: Final = 10.0  # s between two lines, as thousands may come in a second
CLOSE_GRACE = 0.8  # s from when a peer has closed its side until it is closed
READ_PAUSE: Final = 0.01  # s
# A peer whose socket holds so much for so long sends more than is read. The end of its
# connection comes after all that: nothing shows whether it is still there.
FLOOD_BYTES: Final = 32_768
FLOOD_LOOKS: Final = 8  # in succession


class RefusalLog:
    """Logs the first connection that is refused, and how many were refused since."""

    def __init__(self, kind: str) -> None:
        """Start with nothing refused.

        Args:
            kind: What the peers are, in plural.
        """
        self._kind = kind
        self._unlogged = 0
        self._next_line = 0.0

    def add(self, peer: str, limit: int) -> None:
        """Count a connection that is refused because there are as many as may be.

        Args:
            peer: Address and port of the peer.
            limit: How many there may be.
        """
        now = asyncio.get_running_loop().time()
        if now < self._next_line:
            self._unlogged += 1
            return
        others = f", and {self._unlogged} others before" if self._unlogged else ""
        reason = f"there are {limit} {self._kind}"
        log.warning("%s: refused%s: %s", peer, others, reason)
        self._unlogged, self._next_line = 0, now + LOG_INTERVAL


# Of which a peer is one: where the system permits few, clients with robots need them.
FILES_EACH: Final = 16


class PeerServer(ABC):
    """Listens on a port, and holds the connections of its peers.

    Attributes:
        address: Host and port that it listens on, once started.
        peers: The connections.
        refusals: The log of peers that are refused.
    """

    def __init__(self, port: int, kind: str) -> None:
        """Create a server that does not listen yet.

        Args:
            port: Port to listen on; 0 for a free one.
            kind: What the peers are, in plural, for the log.
        """
        self.address = ("", 0)
        self.peers: set[Any] = set()
        self.refusals = RefusalLog(kind)
        self._port = port
        self._listener: asyncio.Server | None = None
        self._working: asyncio.Task[None] | None = None

    async def start(self, address: str = "127.0.0.1") -> None:
        """Listen for peers, and do what the server does besides.

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
        """All hosts that it listens on."""
        sockets = () if self._listener is None else self._listener.sockets
        return [each.getsockname()[0] for each in sockets]

    @abstractmethod
    def _accept(self) -> PeerConnection:
        """Return the protocol of a new connection."""

    async def _work(self) -> None:  # noqa: B027 - not all servers do more
        """Do what the server does besides, until it is cancelled."""

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
    """One connection of a peer.

    Attributes:
        peer: Address and port of the peer, for the log.
        KIND: What the peer is, for the log.
        SENT: What it sends, for the log.
        MOST: How many such peers may be connected at a time.
        READ_BYTES: How many bytes are read at a time.
    """

    KIND = "peer"
    SENT = "requests"
    MOST = 1
    READ_BYTES = 4096

    def __init__(self, server: PeerServer) -> None:
        """Create the protocol of a connection, which adds itself to the server."""
        self.peer = "?"
        self._peers, self._refusals = server.peers, server.refusals
        self._buffer = bytearray(self.READ_BYTES)
        self._transport: asyncio.Transport | None = None
        self._grace: asyncio.TimerHandle | None = None  # aborts after eof
        self._looks = 0  # in succession that found a flood

    @property
    def file_number(self) -> int:
        """Number of the open file that is its socket."""
        assert self._transport is not None
        number: int = self._transport.get_extra_info("socket").fileno()
        return number

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin, or refuse the peer if there are too many."""
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
        """Forget the peer."""
        if self._grace is not None:
            self._grace.cancel()  # a transport that is lost fails to abort
        if self._transport is not None:
            self._end(str(error or "closed"))

    def _end(self, reason: str) -> None:
        """Forget the peer, and log why."""
        self._forget()
        log.info("%s: %s disconnected: %s", self.peer, self.KIND, reason)

    def close(self) -> None:
        """Close the connection at once."""
        transport = self._transport
        if transport is not None:
            self._forget()
            transport.abort()

    def look(self) -> None:
        """End the connection of a peer that is not read, and has gone or floods."""
        if self._transport is None:
            return
        if find_hung_up([self.file_number]):
            self._end_in_time()
        self._looks = self._looks + 1 if self._floods() else 0
        if self._looks >= FLOOD_LOOKS:
            log.warning("%s: closed: a flood of %s", self.peer, self.SENT)
            self.close()

    def _floods(self) -> bool:
        """Return whether more waits to be read than an honest peer sends."""
        assert self._transport is not None  # ``look`` needs one
        return waiting_bytes(self._transport) >= FLOOD_BYTES

    def _end_in_time(self) -> None:
        """Abort after ``CLOSE_GRACE``, whatever waits then."""
        if self._grace is None and self._transport is not None:
            loop = asyncio.get_running_loop()
            self._grace = loop.call_later(CLOSE_GRACE, self._transport.abort)

    def _rest(self) -> None:
        """Read nothing for a while: the system's buffers hold back who sends more."""
        if self._transport is not None:
            self._transport.pause_reading()
            asyncio.get_running_loop().call_later(READ_PAUSE, self._read_on)

    def _read_on(self) -> None:
        if self._transport is not None:
            self._transport.resume_reading()

    def _most(self) -> int:
        """Return how many such peers the system permits."""
        return raise_file_limit(FILES_EACH * self.MOST) // FILES_EACH

    @abstractmethod
    def _begin(self, transport: asyncio.Transport) -> None:
        """Do what a new connection needs."""

    def _forget(self) -> None:
        """Forget the peer; afterwards there is no transport."""
        self._transport = None
        self._peers.discard(self)


REFILL = 512  # bytes a tick; 50 kB/s is ten times what a robot's driver sends
BURST = 2048  # bytes at once
READ_COST = 128  # bytes that a read counts besides its own; each costs some 30 us
TURNS = 8  # in a tick, of all connections together


class ReadAllowance:
    """What may be read from one connection.

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
        # A read costs time even if it brings one byte: else packets of one byte would
        # be free.
        self._left = min(BURST, self._left + grown) - size - READ_COST
        if self._left < 0 and not self.exhausted:
            self.exhausted = True
            self._turns.append(self)

    def grant(self) -> None:
        """Permit one more read, however large."""
        # The allowance begins again at zero: who sends without end gets one read in a
        # turn.
        self.exhausted = False
        self._left = 0
        self._tick = self._turns.ticks


class ReadTurns:
    """The connections that wait for their turns, the first come first.

    Attributes:
        ticks: Number of ticks so far.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self._waiting: deque[ReadAllowance] = deque()

    def append(self, allowance: ReadAllowance) -> None:
        """Let a connection wait for its turn."""
        self._waiting.append(allowance)

    def advance(self) -> None:
        """Start a tick, and grant its turns."""
        self.ticks += 1
        turns = TURNS
        while self._waiting and turns:
            allowance = self._waiting.popleft()
            if not allowance.closed:
                allowance.grant()
                turns -= 1
