"""A TCP server: one connection a client, and simulated time paced by the wall clock."""

from __future__ import annotations

import asyncio
import gc
import logging
import math
from collections.abc import Callable, Sequence
from typing import Protocol

from radarsim.listening import (
    exit_code_of_signal,
    find_hung_up,
    first_of,
    log_refused_accepts,
)
from radarsim.server.host import Diagnostic, Host
from radarsim.server.peer_connections import (
    PeerConnection,
    PeerServer,
    ReadAllowance,
    ReadTurns,
)
from radarsim.simulation.clock import TICK, ticks_of

log = logging.getLogger("radarsim.server")

MAX_CLIENTS = 1024
MAX_LAG = 0.1  # s; a server that is later than this drops the lost time
LAG_LOG_INTERVAL = 10.0  # s between two log lines about lost time
WATCHER_TICKS = 3  # between two writes to a client that only watches: each costs time
LOOK_TICKS = 10  # between two looks
MAX_LOGGED_KINDS = 50  # per client, as a client may send random verbs


class Pace:
    """Says whether simulated time passes in the next tick of a server, and how soon.

    While it is paused a server goes on with its ticks, in which it executes commands
    and answers them, but no time passes in them. Steps let some time pass meanwhile.

    Attributes:
        speed: Simulated seconds in one second of the wall clock.
        is_paused: Whether time passes only by steps.
        observers: Called when it is paused or not any more, and when the speed changes.
    """

    def __init__(self, speed: float = 1.0) -> None:
        """Let time pass at a speed."""
        self.speed = speed
        self.is_paused = False
        self.observers: list[Callable[[], None]] = []
        self._steps = 0  # ticks in which time still passes while it is paused

    @property
    def interval(self) -> float:
        """Time from one tick to the next, s of the wall clock."""
        return TICK / self.speed if self._passes else TICK

    def change(
        self,
        *,
        speed: float | None = None,
        paused: bool | None = None,
        step: float | None = None,
    ) -> None:
        """Change the speed, pause or go on, or let a duration pass.

        Args:
            speed: Simulated seconds in one second of the wall clock.
            paused: Whether time passes only by steps; those that are not over end.
            step: Duration that passes, s, rounded to ticks and one of them at least,
                until it is paused. It follows a step that is not over.

        Raises:
            ValueError: If the speed is not above 0, or not finite.
        """
        before = self.speed, self.is_paused
        if speed is not None:
            if not (speed > 0 and math.isfinite(speed)):
                raise ValueError(f"speed {speed}, expected a finite number above 0")
            self.speed = speed
        if step is not None:
            self.is_paused = True
            self._steps += ticks_of(step)
        elif paused is not None:
            self.is_paused, self._steps = paused, 0
        if before != (self.speed, self.is_paused):
            for observer in self.observers:
                observer()

    def take_tick(self) -> bool:
        """Count a tick, and return whether time passes in it."""
        passes = self._passes
        self._steps = max(0, self._steps - 1)
        return passes

    @property
    def _passes(self) -> bool:
        return not self.is_paused or self._steps > 0


class Server(PeerServer):
    """Serves a host to TCP clients.

    Attributes:
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
            after_tick: Called after each tick, when its bytes have been sent.
        """
        super().__init__(0, "clients")
        self.host = host
        self.pace = Pace(speed)
        self.max_clients = max_clients
        self.by_number: dict[int, Connection] = {}
        # Those that are not read at present, or that end. In a tick only these are
        # looked at, and those for which bytes wait.
        self.held: set[Connection] = set()
        self.turns = ReadTurns()
        self._after_tick = after_tick
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
        self._port = port
        await super().start(address)

    def _accept(self) -> Connection:
        return Connection(self)

    async def wait_failed(self) -> None:
        """Wait until a tick fails, which only a bug can cause.

        Raises:
            Exception: The error that stopped simulated time.
        """
        if self._working is not None:
            await asyncio.shield(self._working)

    async def _work(self) -> None:
        """Let simulated time pass, tick by tick."""
        loop = asyncio.get_running_loop()
        due = next_log = loop.time()
        lost = 0.0
        while True:
            # From the last due time, not from now: delays of single ticks do not add
            # up.
            due += self.pace.interval
            lag = loop.time() - due
            # Catching up would mean to send a burst of old readings, for which clients
            # have no use; simulated time waits instead, and is logged.
            if lag > MAX_LAG:
                due += lag
                lost += lag
            if lost and due > next_log:
                log.warning("machine too slow: simulated time waited %.1f s", lost)
                next_log, lost = due + LAG_LOG_INTERVAL, 0.0
            await asyncio.sleep(max(0.0, -lag))
            try:
                self.tick()
            except Exception as error:
                time = self.host.simulation.time
                error.add_note(f"at {time:.2f} s of simulated time")
                raise

    def tick(self) -> None:
        """Advance simulated time by 10 ms, if it passes, and send all lines."""
        connections = self.by_number
        by_file = {connection.file_number: connection for connection in self.held}
        for number, is_gone in find_hung_up(by_file):
            by_file[number].hang_up(is_gone=is_gone)
        for number, diagnostic in self.host.step(passes=self.pace.take_tick()):
            if number in connections:  # the host can have other clients
                connections[number].log_diagnostics([diagnostic])
        self.turns.advance()
        self._ticks += 1
        watchers_rest = self._ticks % WATCHER_TICKS
        for number in self.host.clients_to_send():
            # A third of the writes is enough to watch with, and each one
            # costs time.
            if watchers_rest and self.host.only_watches(number):
                continue
            if number in connections:
                connections[number].flush()
        # Those that are not read get no callback: they are looked at in each tick.
        for connection in list(self.held):
            connection.flush()
        if self._ticks % LOOK_TICKS == 0:
            for connection in list(self.held):
                connection.look()
        self._after_tick()


class Connection(PeerConnection):
    """One TCP connection: passes bytes between a client and the host."""

    KIND = "client"
    SENT = "commands"
    READ_BYTES = 2048  # before others are served

    def __init__(self, server: Server) -> None:
        super().__init__(server)
        self._server, self._host = server, server.host
        self._allowance = ReadAllowance(server.turns)
        self._number = 0
        self._sends_no_more = False
        self._logged_kinds: set[str] = set()

    def _most(self) -> int:
        return self._server.max_clients

    def _begin(self, transport: asyncio.Transport) -> None:  # noqa: ARG002 - not needed
        self._number = self._host.connect(self.peer.rpartition(":")[0])
        self._server.by_number[self._number] = self
        self.flush()

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
        self._server.held.add(self)
        self._end_in_time()
        self.flush(only_replies=True)
        return True  # the transport stays open for the replies

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

    def _floods(self) -> bool:
        # A robot's client gets readings, which one that has gone rejects.
        return not self._host.has_robot(self._number) and super()._floods()

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
            # Unread bytes wait in the client's socket: no queue here grows.
            transport.pause_reading()
            self._server.held.add(self)
        else:
            transport.resume_reading()
            self._server.held.discard(self)
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
        self._end("it closed its side" if self._sends_no_more else "no robot")
        transport.close()  # when everything is sent

    def _end(self, reason: str) -> None:
        dropped = self._host.dropped_readings(self._number)
        lost = f", {dropped} readings it did not read were dropped" if dropped else ""
        super()._end(f"{reason}{lost}")

    def _forget(self) -> None:
        super()._forget()
        self._allowance.closed = True
        self._server.held.discard(self)
        del self._server.by_number[self._number]
        self._host.disconnect(self._number)


class Companion(Protocol):
    """Something that runs with a server, in the same event loop."""

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

    async def run() -> None:
        log_refused_accepts(log)
        # The objects so far stay. To look through them takes the garbage collector some
        # 90 ms, by which scans would be late.
        gc.collect()
        gc.freeze()
        await server.start(address, port)
        for companion in companions:
            await companion.start(address)
        announce(server.address)
        await server.wait_failed()

    with exit_code_of_signal() as exit_code:
        try:
            code: int = await first_of(run(), exit_code)
            return code
        finally:
            for companion in companions:
                await companion.stop()
            await server.stop()
