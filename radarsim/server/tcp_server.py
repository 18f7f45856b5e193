"""A host on a TCP port, paced by the wall clock."""

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any

from radarsim.host import Diagnostic, Host
from radarsim.server.lifecycle import exit_code_of_signal, listen
from radarsim.simulation.config import TICK

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

    async def wait_failed(self) -> None:
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
            failure = asyncio.ensure_future(server.wait_failed())
            both: set[asyncio.Future[Any]] = {ended, failure}
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            if failure.done():
                failure.result()
            failure.cancel()
            return ended.result()
        finally:
            await server.stop()


# Section from server.connection.
# One TCP connection: bytes to the host and back, and a log that says things once.

READ_BYTES = 16_384  # at most this much of one client between two looks at the others
SEND_BUFFER_BYTES = 131_072  # what waits in the kernel is stale when it arrives
CLOSE_GRACE = 2.0  # s for a client that has closed its side to read what it asked for
MOST_SAID = 50  # kinds of notices logged of one client, whose verbs may be random


class Connection(asyncio.BufferedProtocol):
    """Hands bytes over, and sends what the host has for the client.

    Attributes:
        peer: Address and port, for the log.
    """

    def __init__(self, host: Host, connections: set["Connection"], most: int) -> None:
        self.peer = "?"
        self._host = host
        self._connections = connections
        self._most = most
        self._buffer = bytearray(READ_BYTES)
        self._transport: asyncio.Transport | None = None
        self._number = 0
        self._said: set[str] = set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet the client, or turn it away if there are too many."""
        assert isinstance(transport, asyncio.Transport)
        self.peer = _text(transport.get_extra_info("peername"))
        if len(self._connections) >= self._most:
            log.warning("%s: refused: there are %d clients", self.peer, self._most)
            transport.abort()
            return
        _tune(transport.get_extra_info("socket"))
        self._transport = transport
        self._number = self._host.connect()
        self._connections.add(self)
        log.info("%s: connected", self.peer)
        self.flush()

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - asyncio's name
        """Give the place where what comes is put."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Hand over what came."""
        if self._transport is None:
            return
        self.report(self._host.receive(self._number, bytes(self._buffer[:nbytes])))
        self.flush(only_answers=True)

    def eof_received(self) -> bool:
        """Send what the client has asked for, and take its robot off the floor."""
        transport = self._transport
        if transport is not None:
            transport.write(self._host.drain_and_finish(self._number))
            self._part("it closed its side")
            asyncio.get_running_loop().call_later(CLOSE_GRACE, transport.abort)
        return False  # the transport closes when all is sent

    def connection_lost(self, error: Exception | None) -> None:
        """Take the client's robot off the floor."""
        if self._transport is not None:
            self._part(str(error or "closed"))

    def report(self, notices: list[Diagnostic]) -> None:
        """Log what had no effect, once for each kind."""
        for notice in notices:
            if notice.kind not in self._said and len(self._said) < MOST_SAID:
                self._said.add(notice.kind)
                log.warning("%s: %s", self.peer, notice.text)

    @property
    def number(self) -> int:
        """The client's number at the host."""
        return self._number

    def flush(self, *, only_answers: bool = False) -> None:
        """Send what waits, unless earlier lines are still on their way.

        Args:
            only_answers: Leave it to the tick if the client has a robot, since a tick
                is one write.
        """
        transport = self._transport
        if transport is None:
            return
        if self._host.must_close(self._number):
            log.warning("%s: closed: endless line or unread answers", self.peer)
            self.close()
            return
        self._hold_back(transport)
        if only_answers and self._host.has_robot(self._number):
            return
        if transport.get_write_buffer_size() == 0:
            data = self._host.take(self._number)
            if data:
                transport.write(data)

    def close(self) -> None:
        """End the connection at once, whatever still waits."""
        transport = self._transport
        if transport is not None:
            self._leave()
            transport.abort()

    def _hold_back(self, transport: asyncio.Transport) -> None:
        """Read on only when all that came has been carried out."""
        if self._host.is_busy(self._number):
            transport.pause_reading()
        else:
            transport.resume_reading()

    def _part(self, reason: str) -> None:
        dropped = self._host.dropped_readings(self._number)
        self._leave()
        lost = f", {dropped} readings it did not read were dropped" if dropped else ""
        log.info("%s: disconnected: %s%s", self.peer, reason, lost)

    def _leave(self) -> None:
        self._transport = None
        self._connections.discard(self)
        self._host.disconnect(self._number)


def _tune(sock: Any) -> None:
    """Find out about peers that are gone, and keep what is on its way short."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)


def _text(peer: Any) -> str:
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) else "?"
