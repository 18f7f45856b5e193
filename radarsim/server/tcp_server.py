"""A TCP server: one connection a client, and simulated time paced by the wall clock."""

from __future__ import annotations

import asyncio
import gc
import logging
import select
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from radarsim.listening import (
    configure_socket,
    exit_code_of_signal,
    has_hung_up,
    listen,
    log_refused_accepts,
    peer_name,
    waiting_bytes,
)
from radarsim.server.host import Diagnostic, Host
from radarsim.server.pace import Pace
from radarsim.server.peer_connections import ReadAllowance, ReadTurns, RefusalLog

log = logging.getLogger("radarsim.server")

MAX_CLIENTS = 1024
MAX_LAG = 0.1  # s; a server that is later than this drops the lost time
LAG_LOG_INTERVAL = 10.0  # s between two log lines about lost time
READ_BYTES = 2048  # read from one client before others are served
WATCHER_TICKS = 3  # between two writes to a client that only watches: each costs time
CLOSE_GRACE = 0.8  # s from when a client has closed its side until it is closed
# A client without a robot whose socket holds so much for so long sends more than is
# executed. The end of its connection comes after all that: nothing shows whether it is
# still there. A robot's client gets readings, which one that has gone rejects.
FLOOD_BYTES = 32_768
FLOOD_LOOKS = 8
LOOK_TICKS = 10  # between two looks
MAX_LOGGED_KINDS = 50  # per client, as a client may send random verbs


class Server:
    """Serves a host to TCP clients.

    Attributes:
        address: Host and port that it listens on, once started.
        pace: How simulated time follows the wall clock; may be changed at any time.
    """

    def __init__(
        self,
        host: Host,
        *,
        speed: float = 1.0,
        max_clients: int = MAX_CLIENTS,
        after_tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            host: The simulation and its clients.
            speed: Simulated seconds in one second of the wall clock.
            max_clients: Number of clients beyond which others are refused.
            after_tick: Called after each tick, when its clients are sent what is due.
        """
        self.address = ("", 0)
        self._host = host
        self.pace = Pace(speed)
        self._max_clients = max_clients
        self._after_tick = after_tick
        self._connections = ConnectionTable()
        self._turns = ReadTurns()
        self._listener: asyncio.Server | None = None
        self._ticking: asyncio.Task[None] | None = None
        self._ticks = 0

    async def start(self, address: str = "127.0.0.1", port: int = 3000) -> None:
        """Listen, and start simulated time.

        Args:
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.

        Raises:
            ServerError: If the port is taken, or the address is not one of this
                machine.
        """
        args = self._host, self._connections, self._max_clients, self._turns
        self._listener, self.address = await listen(
            lambda: Connection(*args), address, port
        )
        self._ticking = asyncio.create_task(self._tick_forever())

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        if self._listener is not None:
            self._listener.close()
        for connection in list(self._connections.by_number.values()):
            connection.close()
        if self._ticking is not None:
            self._ticking.cancel()
            await asyncio.wait({self._ticking})
        await asyncio.sleep(0)  # sockets are closed in the next round of the loop

    async def wait_failed(self) -> None:
        """Wait until a tick fails, which only a bug can cause.

        Raises:
            Exception: The error that stopped simulated time.
        """
        if self._ticking is not None:
            await asyncio.shield(self._ticking)

    async def _tick_forever(self) -> None:
        loop = asyncio.get_running_loop()
        due = next_log = loop.time()
        lost = 0.0
        while True:
            # From the last due time, not from now: delays of single ticks do not add
            # up.
            due += self.pace.interval
            lag = loop.time() - due
            # Catching up would mean to send a burst of old readings, for which clients
            # have no use; simulated time waits instead, and the log tells.
            if lag > MAX_LAG:
                due += lag
                lost += lag
            if lost and due > next_log:
                log.warning("too slow: simulated time waited for %.1f s", lost)
                next_log, lost = due + LAG_LOG_INTERVAL, 0.0
            await asyncio.sleep(max(0.0, -lag))
            try:
                self.tick()
            except Exception as error:
                time = self._host.simulation.time
                error.add_note(f"at {time:.2f} s of simulated time")
                raise

    def tick(self) -> None:
        """Advance simulated time by 10 ms, if it passes, and send what is due."""
        connections = self._connections.by_number
        for connection, is_gone in self._connections.hung_up():
            connection.hang_up(is_gone=is_gone)
        for number, diagnostic in self._host.step(passes=self.pace.take_tick()):
            if number in connections:  # the host can have other clients
                connections[number].log_diagnostics([diagnostic])
        self._turns.advance()
        self._ticks += 1
        watchers_rest = self._ticks % WATCHER_TICKS
        for number in self._host.clients_to_send():
            # A third of the writes is enough to watch with, and each one
            # costs time.
            if watchers_rest and self._host.only_watches(number):
                continue
            if number in connections:
                connections[number].flush()
        # Those that are not read get no callback: they are looked at in each tick.
        for connection in list(self._connections.held):
            connection.flush()
        if self._ticks % LOOK_TICKS == 0:
            for connection in list(self._connections.held):
                connection.look()
        self._after_tick()


@dataclass(slots=True)
class ConnectionTable:
    """The open connections of a server.

    Attributes:
        by_number: All of them, by number of the client.
        held: Those that are not read at present, or that end. In a tick only these are
            looked at, and those for which bytes wait.
        refusals: The log of those that are refused.
    """

    by_number: dict[int, Connection] = field(default_factory=dict)
    held: set[Connection] = field(default_factory=set)
    refusals: RefusalLog = field(default_factory=lambda: RefusalLog("clients"))

    def hung_up(self) -> list[tuple[Connection, bool]]:
        """Return those of ``held`` whose peers send no more, and whether they are gone.

        A transport that is not read does not tell. Empty where the system cannot say.
        """
        if sys.platform != "linux" or not self.held:
            return []
        poller = select.poll()
        by_file = {connection.file_number: connection for connection in self.held}
        for number in by_file:
            poller.register(number, select.POLLRDHUP)
        gone = select.POLLHUP | select.POLLERR  # which poll reports without being asked
        return [
            (by_file[number], bool(event & gone)) for number, event in poller.poll(0)
        ]


class Connection(asyncio.BufferedProtocol):
    """One TCP connection: passes bytes between a client and the host.

    Attributes:
        peer: Address and port of the client, for the log.
    """

    def __init__(
        self,
        host: Host,
        connections: ConnectionTable,
        max_clients: int,
        turns: ReadTurns,
    ) -> None:
        self.peer = "?"
        self._host = host
        self._connections = connections
        self._max_clients = max_clients
        self._buffer = bytearray(READ_BYTES)
        self._allowance = ReadAllowance(turns)
        self._transport: asyncio.Transport | None = None
        self._number = 0
        self._sends_no_more = False
        self._grace: asyncio.TimerHandle | None = None  # aborts after eof
        self._looks = 0  # in succession that found a flood
        self._logged_kinds: set[str] = set()

    @property
    def file_number(self) -> int:
        """Number of the open file that is its socket."""
        assert self._transport is not None
        number: int = self._transport.get_extra_info("socket").fileno()
        return number

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet the client, or refuse it if there are too many."""
        assert isinstance(transport, asyncio.Transport)
        self.peer = peer_name(transport)
        if len(self._connections.by_number) >= self._max_clients:
            self._connections.refusals.add(self.peer, self._max_clients)
            transport.abort()
            return
        configure_socket(transport)
        self._transport = transport
        self._number = self._host.connect(self.peer.rpartition(":")[0])
        self._connections.by_number[self._number] = self
        log.info("%s: connected", self.peer)
        self.flush()

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - asyncio's name
        """Return the buffer that received bytes are written to."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass received bytes to the host."""
        if self._transport is None:
            return
        self._allowance.spend(nbytes)
        data = bytes(self._buffer[:nbytes])
        self.log_diagnostics(self._host.receive(self._number, data))
        # Clients without a robot read their answer within one second, some with a
        # single read.
        self.flush(only_replies=True)

    def eof_received(self) -> bool:
        """Close when all commands are executed and all replies are sent."""
        if self._transport is None:
            return False
        self._sends_no_more = True
        self._connections.held.add(self)
        self._end_in_time()
        self.flush(only_replies=True)
        return True  # the transport stays open for the replies

    def _end_in_time(self) -> None:
        """Abort after ``CLOSE_GRACE``, whatever waits then."""
        if self._grace is None and self._transport is not None:
            loop = asyncio.get_running_loop()
            self._grace = loop.call_later(CLOSE_GRACE, self._transport.abort)

    def hang_up(self, *, is_gone: bool) -> None:
        """Close if nothing that waits is of use to a peer that has closed its side.

        A robot would be removed as soon as it is there. What else it has sent may be
        much more than can be executed until its time is over.

        Args:
            is_gone: Whether the peer reads no more either.
        """
        if is_gone or self._host.waits_to_spawn(self._number):
            self._finish()
        else:
            self._end_in_time()

    def look(self) -> None:
        """End the connection of a client that has gone, or floods without a robot."""
        assert self._transport is not None
        if has_hung_up(self._transport):
            self._end_in_time()
        has_robot = self._host.has_robot(self._number)
        floods = not has_robot and waiting_bytes(self._transport) >= FLOOD_BYTES
        self._looks = self._looks + 1 if floods else 0
        if self._looks >= FLOOD_LOOKS:
            log.warning("%s: closed: a flood of commands", self.peer)
            self.close()

    def connection_lost(self, error: Exception | None) -> None:
        """Despawn the client's robot."""
        if self._grace is not None:
            self._grace.cancel()  # a transport that is lost fails to abort
        if self._transport is not None:
            self._disconnect(str(error or "closed"))

    def log_diagnostics(self, diagnostics: list[Diagnostic]) -> None:
        """Log commands without effect, once for each kind."""
        for found in diagnostics:
            known = found.kind in self._logged_kinds
            if not known and len(self._logged_kinds) < MAX_LOGGED_KINDS:
                self._logged_kinds.add(found.kind)
                log.warning("%s: %s", self.peer, found.text)

    def flush(self, *, only_replies: bool = False) -> None:
        """Send what waits, unless earlier bytes still wait in the transport.

        Args:
            only_replies: Send nothing if the client has a robot: its replies go out
                with the next tick, since a tick is one write.
        """
        transport = self._transport
        if transport is None:
            return
        if reason := self._host.close_reason(self._number):
            fault = self._host.fault(self._number)
            log.warning("%s: closed: %s", self.peer, reason, exc_info=fault)
            if fault is not None:
                self._end_in_time()
                self._finish()
            else:
                self.close()
            return
        if self._sends_no_more:
            if not self._host.is_busy(self._number):
                self._finish()
                return
        elif self._host.is_busy(self._number) or self._allowance.exhausted:
            # What is not read waits in the client's socket: no queue here grows.
            transport.pause_reading()
            self._connections.held.add(self)
        else:
            transport.resume_reading()
            self._connections.held.discard(self)
        if only_replies and self._host.has_robot(self._number):
            return
        # What a slow client has not taken stays in the host's queue, which can drop old
        # readings; the buffer of a transport cannot.
        if transport.get_write_buffer_size() == 0:
            data = self._host.take(self._number)
            if data:
                transport.write(data)

    def _finish(self) -> None:
        """Send the last replies to a peer, and close."""
        transport = self._transport
        assert transport is not None
        transport.write(self._host.finish(self._number))
        self._disconnect("it closed its side" if self._sends_no_more else "no robot")
        transport.close()  # when everything is sent

    def close(self) -> None:
        """Close the connection at once, and drop what still waits."""
        transport = self._transport
        if transport is not None:
            self._forget()
            transport.abort()

    def _disconnect(self, reason: str) -> None:
        dropped = self._host.dropped_readings(self._number)
        self._forget()
        lost = f", {dropped} readings it did not read were dropped" if dropped else ""
        log.info("%s: disconnected: %s%s", self.peer, reason, lost)

    def _forget(self) -> None:
        self._transport = None
        self._allowance.closed = True
        self._connections.held.discard(self)
        del self._connections.by_number[self._number]
        self._host.disconnect(self._number)


class Companion(Protocol):
    """Something that runs beside a server, in the same event loop."""

    async def start(self, address: str) -> None:
        """Start; the server listens on this address."""
        ...

    async def stop(self) -> None:
        """Stop; never raises."""
        ...


async def serve(
    server: Server,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
    companions: Sequence[Companion] = (),
) -> int:
    """Serve until a signal comes.

    Args:
        server: A server that is not started yet; stopped when this returns.
        address: Address to listen on.
        port: Port to listen on; 0 for a free one.
        announce: Called with the address as soon as clients can connect.
        companions: Started and stopped with the server.

    Returns:
        The exit code: 130 after an interrupt, 0 after a request to terminate.

    Raises:
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as exit_code:
        running = asyncio.ensure_future(
            _run(server, address, port, announce, companions)
        )
        pending: set[asyncio.Future[Any]] = {exit_code, running}
        try:
            await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
            if running.done():
                running.result()  # raises the error that ended it
            return await exit_code
        finally:
            running.cancel()
            for companion in companions:
                await companion.stop()
            await server.stop()


async def _run(
    server: Server,
    address: str,
    port: int,
    announce: Callable[[tuple[str, int]], None],
    companions: Sequence[Companion],
) -> None:
    """Start a server, and wait until it fails; arguments and errors as above."""
    log_refused_accepts(log)
    # What is there now stays. To look through it takes the garbage collector some
    # 90 ms, by which scans would be late.
    gc.collect()
    gc.freeze()
    await server.start(address, port)
    for companion in companions:
        await companion.start(address)
    announce(server.address)
    await server.wait_failed()
