"""The TCP server of the simulation, with simulated time paced by the wall clock."""

from __future__ import annotations

import asyncio
import gc
import logging
import math
import sys
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
MAX_LAG = 0.1  # s; larger delays are not made up for
LAG_LOG_INTERVAL = 10.0  # s between two log lines about delays
WATCHER_TICKS = 3  # ticks between two writes to a client that only watches
LOOK_TICKS = 10  # ticks between two checks of connections that are not read
MAX_LOGGED_KINDS = 50  # per client, as a client may send random verbs


class Pace:
    """Controls the speed of simulated time relative to the wall clock, and pauses.

    While paused, the server's ticks continue: it executes and answers commands, but
    simulated time stands still. Steps advance the time of a paused simulation.

    Attributes:
        speed: Simulated seconds per second of the wall clock.
        is_paused: Whether time passes only by steps.
        observers: Called when ``speed`` or ``is_paused`` changes.
    """

    def __init__(self, speed: float = 1.0) -> None:
        """Start unpaused at a speed."""
        self.speed = speed
        self.is_paused = False
        self.observers: list[Callable[[], None]] = []
        self._steps = 0  # remaining ticks of a step

    @property
    def interval(self) -> float:
        """Time between two ticks, s of the wall clock."""
        return TICK / self.speed if self._passes else TICK

    def change(
        self,
        *,
        speed: float | None = None,
        paused: bool | None = None,
        step: float | None = None,
    ) -> None:
        """Change the speed, pause or resume, or advance by a step.

        Args:
            speed: Simulated seconds per second of the wall clock.
            paused: Whether time passes only by steps; ends a step in progress.
            step: Duration to advance before the pause, s, rounded to whole ticks, at
                least one. It is added to a step in progress.

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
        """Begin a tick, and return whether simulated time passes in it."""
        passes = self._passes
        self._steps = max(0, self._steps - 1)
        return passes

    @property
    def _passes(self) -> bool:
        return not self.is_paused or self._steps > 0


class Server(PeerServer):
    """Serves a host to TCP clients.

    Attributes:
        pace: Speed and pause of simulated time; may be changed at any time.
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
            speed: Simulated seconds per second of the wall clock.
            max_clients: Maximum number of clients; further clients are refused.
            after_tick: Called after each tick and its writes to clients.
        """
        super().__init__(0, "clients")
        self.host = host
        self.pace = Pace(speed)
        self.max_clients = max_clients
        self.by_number: dict[int, Connection] = {}
        # Connections that are not read at present, or that are closing. A tick visits
        # only these connections, and connections with bytes to send.
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
            Exception: The error of the failed tick.
        """
        if self._working is not None:
            await asyncio.shield(self._working)

    async def _work(self) -> None:
        """Run ticks at the pace of the wall clock until cancelled."""
        loop = asyncio.get_running_loop()
        due = next_log = loop.time()
        lost = 0.0
        while True:
            # Due times are counted from the previous due time, so that delays of ticks
            # do not add up.
            due += self.pace.interval
            lag = loop.time() - due
            # Catching up with a large delay would send clients a burst of outdated
            # readings. Instead, simulated time falls behind, and the log reports the
            # delay.
            if lag > MAX_LAG:
                due += lag
                lost += lag
            if lost and due > next_log:
                log.warning("machine too slow: simulated time fell %.1f s behind", lost)
                next_log, lost = due + LAG_LOG_INTERVAL, 0.0
            await asyncio.sleep(max(0.0, -lag))
            try:
                self.tick()
            except Exception as error:
                time = self.host.simulation.time
                error.add_note(f"at {time:.2f} s of simulated time")
                raise

    def tick(self) -> None:
        """Advance simulated time by 10 ms unless paused, and send queued lines."""
        connections = self.by_number
        by_file = {connection.file_number: connection for connection in self.held}
        for number, is_gone in find_hung_up(by_file):
            by_file[number].hang_up(is_gone=is_gone)
        for number, diagnostic in self.host.step(passes=self.pace.take_tick()):
            if number in connections:  # the host may have clients without a connection
                connections[number].log_diagnostics([diagnostic])
        self.turns.advance()
        self._ticks += 1
        watchers_rest = self._ticks % WATCHER_TICKS
        for number in self.host.clients_to_send():
            # Clients that only watch are sent data in every third tick, as each write
            # takes time.
            if watchers_rest and self.host.only_watches(number):
                continue
            if number in connections:
                connections[number].flush()
        # Connections that are not read get no callbacks, so each tick checks them.
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
    READ_BYTES = 2048  # small, so that other connections are served in between

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
        # Replies to clients without a robot are sent at once: some of these clients
        # make a single read, and wait for at most one second.
        self.flush(only_replies=True)

    def eof_received(self) -> bool:
        """Keep the transport until all commands are executed and replies are sent."""
        if self._transport is None:
            return False
        self._sends_no_more = True
        self._server.held.add(self)
        self._end_in_time()
        self.flush(only_replies=True)
        return True  # the transport stays open for the replies

    def hang_up(self, *, is_gone: bool) -> None:
        """Close the connection of a peer that has closed its sending side.

        If the peer no longer reads, or waits for a robot that would be removed at once,
        the connection is closed immediately. Otherwise waiting commands are executed
        for up to ``CLOSE_GRACE``.

        Args:
            is_gone: Whether the peer has closed its reading side as well.
        """
        if is_gone or self._host.waits_to_spawn(self._number):
            self._finish()
        else:
            self._end_in_time()

    def _floods(self) -> bool:
        # A client with a robot is sent readings. If the client is gone, these writes
        # fail, so no check for floods is needed.
        return not self._host.has_robot(self._number) and super()._floods()

    def log_diagnostics(self, diagnostics: list[Diagnostic]) -> None:
        """Log commands without effect, one line for each kind."""
        for found in diagnostics:
            known = found.kind in self._logged_kinds
            if not known and len(self._logged_kinds) < MAX_LOGGED_KINDS:
                self._logged_kinds.add(found.kind)
                log.warning("%s: %s", self.peer, found.text)

    def flush(self, *, only_replies: bool = False) -> None:
        """Send waiting lines, unless the transport still holds earlier bytes.

        Args:
            only_replies: Whether to send nothing to a client with a robot, which gets
                its replies in the single write of the next tick.
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
            # Unread data waits in the socket, so that no queue of the server grows.
            transport.pause_reading()
            self._server.held.add(self)
        else:
            transport.resume_reading()
            self._server.held.discard(self)
        if only_replies and self._host.has_robot(self._number):
            return
        # Lines for a slow client stay in the host's queue, which can drop old readings;
        # the buffer of a transport cannot.
        if transport.get_write_buffer_size() == 0:
            data = self._host.take(self._number)
            if data:
                transport.write(data)

    def _finish(self) -> None:
        """Send the last replies to the peer, and close the connection."""
        transport = self._transport
        assert transport is not None
        transport.write(self._host.finish(self._number))
        self._end("closed by the client" if self._sends_no_more else "no robot")
        transport.close()  # closes after all bytes are sent

    def _end(self, reason: str) -> None:
        dropped = self._host.dropped_readings(self._number)
        lost = f", {dropped} unread readings were dropped" if dropped else ""
        super()._end(f"{reason}{lost}")

    def _forget(self) -> None:
        super()._forget()
        self._allowance.closed = True
        self._server.held.discard(self)
        del self._server.by_number[self._number]
        self._host.disconnect(self._number)


class Companion(Protocol):
    """A service that runs in the event loop of a server."""

    async def start(self, address: str) -> None:
        """Start, given the address on which the server listens."""
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
    """Serve until a signal such as SIGINT or SIGTERM.

    Args:
        server: A server that is not started yet; stopped when this returns.
        address: Address to listen on.
        port: Port to listen on; 0 for a free one.
        announce: Called with the address as soon as clients can connect.
        companions: Services to start and stop with the server.

    Returns:
        The exit code: 130 after SIGINT, 0 after SIGTERM, 129 after SIGHUP.

    Raises:
        ServerError: If the server cannot listen.
    """

    async def run() -> None:
        log_refused_accepts(log)
        # Existing objects are excluded from garbage collection, because collecting them
        # would take some 90 ms and delay scans.
        gc.collect()
        gc.freeze()
        # Computing an FMCW radar in a thread would otherwise delay ticks by up to 5 ms.
        sys.setswitchinterval(0.001)
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
