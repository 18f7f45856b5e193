"""One simulation and many clients, without sockets.

Theory of operation
===================
A server passes received bytes to the host (``receive``), advances time (``step``), and
sends the queued lines (``take``). Commands are executed on arrival. Their replies wait
for the write of the next tick, which also contains the readings of the tick. A client
without a robot has no readings, so its replies can be sent at once.

Rule 1: bytes from a client never raise an error. A command that cannot be executed is
ignored, as by the original server, and returned as a ``Diagnostic`` for the log. An
error that only a bug can cause ends the robot of one client. This client gets an error
line and has to be disconnected; all other clients continue.
Rule 2: a write consists of status, replies, readings, echoes and scans, in this order,
on which clients rely. Only clients that have requested echoes get them.
Rule 3: a client that does not read loses readings, but no replies. A client that keeps
sending requests without reading has to be disconnected (``close_reason``).
Rule 4: the number of commands per tick and of robots per time is limited for each
client, and the work of a tick for all clients together. Commands beyond a limit wait
for later ticks (``is_busy``). A command is executed on arrival if no earlier command of
its client waits, but an INIT also waits for earlier INITs of other clients. Waiting
commands are executed in round-robin order, one of each client. They have a separate
limit of work, and so have searches for a free position: searches run one after the
other, each over several ticks, while later commands of the same client wait. Some work
in each tick is reserved for the first command of each client, and only first commands
can use it up. The result does not depend on the split of bytes into packets.
Rule 5: a client that watches robots gets copies of the lines to their clients, in a
separate queue, whose lines come last in a write. Watching changes no byte that other
clients get.
Rule 6: in a tick in which no time passes, commands are executed and answered as in any
other tick. Only readings wait, and so does the next spawn of a client that has just
spawned a robot.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import TYPE_CHECKING

from radarsim.protocol.commands import Init
from radarsim.protocol.line_template import encode_blocks
from radarsim.protocol.reports import Greeting
from radarsim.protocol.watch import CommandError
from radarsim.scene.scene import Scene
from radarsim.server.host.commands import LIGHT_WORK, Handled, handle
from radarsim.server.host.connection import Client, Diagnostic
from radarsim.server.host.echo_lines import EchoWriter
from radarsim.server.host.spawning import SPAWNS_PER_TICK, Spawner
from radarsim.server.host.watchers import Watchers
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation
from radarsim.simulation.tick_output import ScanEchoes

if TYPE_CHECKING:
    from radarsim.protocol.dialect import Dialect
    from radarsim.simulation.tick_output import DueScan, TickOutput
    from radarsim.simulation.vehicle import Vehicle

COMMANDS_PER_TICK = 20  # per client; real clients send a few
# Limits of work per tick for all clients together, in units of about 20 us. The first
# limit is for commands on arrival, the second for the first command of each client once
# the first limit is reached, and the third for waiting commands.
ARRIVAL_WORK = 80
FIRST_WORK = 50
WAITING_WORK = 40


class HostObserver:
    """Base class of observers of a host, such as a recorder.

    The host calls these methods at its events. They do nothing by default, and must not
    raise or change the host.
    """

    def begin(self, simulation: Simulation) -> None:
        """The observer has been added to the host of this simulation."""

    def connect(self, client: int) -> None:
        """A client has been added."""

    def disconnect(self, client: int) -> None:
        """A client and its robot have been removed."""

    def receive(self, client: int, data: bytes) -> None:
        """A client has sent bytes, whose commands have not been executed yet."""

    def execute(self, client: int, vehicle: Vehicle | None) -> None:
        """Commands of a client may have been executed; its robot is now ``vehicle``."""

    def step(self, *, passes: bool) -> None:
        """A tick begins; ``passes`` says whether simulated time passes in this tick."""

    def take(self, client: int, data: bytes) -> None:
        """The server has taken bytes to send to a client."""

    def finish(self, client: int, data: bytes) -> None:
        """The server has taken the last bytes, if any, for a client that closes."""


class Host:
    """A server without sockets, which executes commands and advances time in ticks.

    Attributes:
        simulation: The simulation that commands act on.
        spawner: Spawns the robots of clients.
        watchers: The clients that watch robots.
        known_replies: Cache of the lines of replies.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        config: SimulationConfig | None = None,
        seed: int = 0,
        observers: Iterable[HostObserver] = (),
    ) -> None:
        """Create a simulation of a scene, without robots and clients.

        Args:
            scene: Scene, as returned by ``load_map``.
            config: Dialect, drive unit and item settings; None for the defaults.
            seed: Seed of all random numbers.
            observers: Observers of the host, called in this order.

        Raises:
            EngineError: If Embree cannot be used.
            PresetError: If the configuration does not fit the robot classes.
            TypeError: If an argument is of another type.
        """
        if config is None:
            config = SimulationConfig()
        if not isinstance(config, SimulationConfig):
            raise TypeError(f"config {config!r:.80}, expected a SimulationConfig")
        config.check()
        self.simulation: Simulation = Simulation(scene, config=config, seed=seed)
        self._clients: dict[int, Client] = {}
        self._last_number = 0
        self._observers: list[HostObserver] = []
        # Numbers of clients with work to do; a tick visits no other clients.
        self._waiting: set[int] = set()  # clients with waiting commands
        self._spent: set[int] = set()  # clients that have used some of their budget
        self._replying: set[int] = set()  # clients with replies for the next tick
        self._unsent: set[int] = set()  # clients with bytes to send
        self.watchers: Watchers = Watchers(config.dialect, self._unsent)
        self.spawner = Spawner(self.simulation, self.watchers)
        self.known_replies: dict[tuple[str | None, ...], bytes] = {}
        self._arrival_work, self._first_work = ARRIVAL_WORK, FIRST_WORK
        self._echo_writer = EchoWriter(lambda: self.simulation.body_names)
        self._last_served = 0  # client whose waiting command was executed last
        for observer in observers:
            self.add_observer(observer)

    @property
    def scene(self) -> Scene:
        """The simulated scene."""
        return self.simulation.scene

    @property
    def config(self) -> SimulationConfig:
        """Configuration of all robots."""
        return self.simulation.config

    def add_observer(self, observer: HostObserver) -> None:
        """Add an observer, which is called from now on."""
        self._observers.append(observer)
        observer.begin(self.simulation)

    def connect(self, address: str = "") -> int:
        """Add a client, and queue its greeting.

        Args:
            address: IP address of the client's machine; image viewers on this machine
                see the client's robot.

        Returns:
            The number of the client, for all other calls.
        """
        # Numbers are never reused, because observers and watchers store them.
        self._last_number += 1
        client = Client(self._last_number, address, command_budget=COMMANDS_PER_TICK)
        self._clients[client.number] = client
        client.reply(Greeting(self.scene.level), self.config.dialect)
        self._queue_replies(client)
        for observer in self._observers:
            observer.connect(client.number)
        return client.number

    def disconnect(self, number: int) -> None:
        """Remove a client and its robot."""
        client = self._clients.pop(number)
        self.watchers.remove(client)
        self.spawner.remove(client)
        for numbers in (self._waiting, self._spent, self._replying, self._unsent):
            numbers.discard(number)
        for observer in self._observers:
            observer.disconnect(number)

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        """Execute received commands, as far as the limits for this tick allow.

        Returns:
            Diagnostics of commands without effect.
        """
        client = self._clients[number]
        for observer in self._observers:
            observer.receive(number, data)
        if client.lines.overflow is not None or client.fault is not None:
            return []
        # If earlier lines wait, new lines wait as well, because clients rely on the
        # order of their commands.
        waits = bool(client.pending)
        client.feed(data)
        diagnostics = [] if waits else self._handle_arrived(client)
        if client.pending:
            self._waiting.add(number)
        if client.lines.overflow is not None:
            diagnostics.append(Diagnostic("line", str(client.lines.overflow)))
        for observer in self._observers:
            observer.execute(number, client.vehicle)
        return diagnostics

    def is_busy(self, number: int) -> bool:
        """Return whether a client has waiting commands, so it must not be read now."""
        return bool(self._clients[number].pending)

    def waits_to_spawn(self, number: int) -> bool:
        """Return whether an INIT is among the waiting commands of a client."""
        pending = self._clients[number].pending
        return any(line.lstrip().upper().startswith(Init.verb) for line in pending)

    def has_robot(self, number: int) -> bool:
        """Return whether a client has a robot, and so gets a write in every tick."""
        return self._clients[number].vehicle is not None

    def only_watches(self, number: int) -> bool:
        """Return whether a client has no robot and only copied lines to send."""
        client = self._clients[number]
        return client.vehicle is None and not client.send_queue

    def close_reason(self, number: int) -> str:
        """Return why a client has to be disconnected; empty to keep it.

        Reasons are an endless line, an HTTP request, too many unread replies, or an
        error that has ended the robot. After such an error, the waiting lines still
        have to be sent.
        """
        return self._clients[number].close_reason()

    def fault(self, number: int) -> Exception | None:
        """Return the error that removed a client's robot; None without an error."""
        return self._clients[number].fault

    def raise_fault(self) -> None:
        """Raise the error that removed the robot of any client, if there is one."""
        for client in self._clients.values():
            if client.fault is not None:
                raise client.fault

    def step(self, *, passes: bool = True) -> list[tuple[int, Diagnostic]]:
        """Advance simulated time by one tick of 10 ms, and queue lines for clients.

        Args:
            passes: Whether simulated time passes. If not, waiting commands are executed
                and answered nevertheless.

        Returns:
            Pairs of client number and diagnostic, from commands that had waited.
        """
        for observer in self._observers:
            observer.step(passes=passes)
        # A tick executes only commands of waiting clients.
        waiting = sorted(self._waiting)
        for number in self._spent:
            self._clients[number].command_budget = COMMANDS_PER_TICK
        self._spent.clear()
        self._arrival_work, self._first_work = ARRIVAL_WORK, FIRST_WORK
        self.spawner.begin_tick()
        diagnostics = self._handle_waiting()
        # Commands precede motion, so that the readings of this tick show their effect.
        if passes:
            self.simulation.step()
            self.watchers.tell_time(self.simulation.time)
            self._queue_outputs(self.simulation.collect_reports())
            self._remove_failed()
        # If a robot reports in this tick, the replies are already among its readings.
        for number in sorted(self._replying):
            self._queue_replies(self._clients[number])
        # Observers are called at the end of the tick, so that recordings keep their
        # order: a new robot is recorded after the radar revolutions of other robots.
        for observer in self._observers:
            for number in waiting:
                observer.execute(number, self._clients[number].vehicle)
        return diagnostics

    def clients_to_send(self) -> list[int]:
        """Return the numbers of the clients with bytes to send, in ascending order."""
        return sorted(self._unsent)

    def take(self, number: int) -> bytes:
        """Remove and return the bytes to send to a client: whole lines, in order."""
        data = self._take(number)
        if data:
            for observer in self._observers:
                observer.take(number, data)
        return data

    def finish(self, number: int) -> bytes:
        """Return the last lines for a client that has closed its sending side."""
        self._queue_replies(self._clients[number])
        data = self._take(number)
        for observer in self._observers:
            observer.finish(number, data)
        return data

    def _take(self, number: int) -> bytes:
        self._unsent.discard(number)
        return self._clients[number].take()

    def unsent_bytes(self, number: int) -> int:
        """Return the number of queued bytes for a client."""
        client = self._clients[number]
        return len(client.send_queue) + len(client.watch_queue)

    def dropped_readings(self, number: int) -> int:
        """Return the number of readings that were dropped because a client is slow.

        Copied lines of watched robots count as well.
        """
        client = self._clients[number]
        return client.send_queue.dropped + client.watch_queue.dropped

    def _handle_arrived(self, client: Client) -> list[Diagnostic]:
        """Execute newly received commands of a client that has no waiting commands."""
        diagnostics = []
        while client.pending and client.command_budget:
            # Work is reserved for first commands, so that bursts of some clients do not
            # delay the only command of another client by a tick.
            is_first = client.command_budget == COMMANDS_PER_TICK
            if self._arrival_work <= 0 and not (is_first and self._first_work > 0):
                break
            is_done, diagnostic, work = self._handle_next(client)
            if self._arrival_work > 0:
                self._arrival_work -= work
            else:
                self._first_work -= work
            if diagnostic is not None:
                diagnostics.append(diagnostic)
            if not is_done:
                break
        return diagnostics

    def _handle_waiting(self) -> list[tuple[int, Diagnostic]]:
        """Execute waiting commands in round-robin order, one of each client."""
        # Of the clients that wait to spawn, only the first few can spawn in this tick.
        to_spawn = self.spawner.queue
        waiting = sorted(self._waiting - to_spawn.keys())
        # The order begins after the client that was served last. Otherwise clients with
        # low numbers would use up the work of each tick.
        first = bisect_right(waiting, self._last_served)
        turns = deque(islice(to_spawn, SPAWNS_PER_TICK))
        turns += waiting[first:] + waiting[:first]
        left, diagnostics = WAITING_WORK, []
        while turns and left > 0:
            number = turns.popleft()
            client = self._clients[number]
            is_done, diagnostic, work = self._handle_next(client)
            left -= work
            self._last_served = number
            if diagnostic is not None:
                diagnostics.append((number, diagnostic))
            if not client.pending:
                self._waiting.discard(number)
            elif is_done and client.command_budget:
                turns.append(number)
        return diagnostics

    def _handle_next(self, client: Client) -> Handled:
        try:
            handled = handle(self, client, client.pending[0])
        except Exception as error:  # noqa: BLE001 - see rule 1
            self._fail(client, error)
            return True, None, LIGHT_WORK
        if handled[0]:
            client.pending.popleft()
            client.command_budget -= 1
            self._spent.add(client.number)
            # Without a robot there are no readings, so replies do not wait for a tick.
            if client.vehicle is None:
                self._queue_replies(client)
            elif client.replies:
                self._replying.add(client.number)
        return handled

    def _remove_failed(self) -> None:
        """Remove the robots in which an error occurred in this tick."""
        errors = self.simulation.faults.errors
        while errors:
            number, error = errors.popitem()
            if number not in self.spawner.clients_by_robot:
                raise error  # the robot does not belong to a client
            self._fail(self.spawner.clients_by_robot[number], error)

    def _fail(self, client: Client, error: Exception) -> None:
        """Remove the robot of a client, and send the client the error."""
        name = client.vehicle.robot.name if client.vehicle else "none"
        text = "an error in the server, which is a bug, has ended the robot"
        error.add_note(f"of client {client.number}, robot {name!r}")
        client.fault = error
        client.pending.clear()
        self.spawner.remove(client)
        client.reply(CommandError(f"{text}: {error!r:.200}"), self.config.dialect)
        self._put_replies(client)

    def _queue_replies(self, client: Client) -> None:
        replies = self._put_replies(client)
        if client.vehicle is not None and client.vehicle in self.watchers:
            self.watchers.copy(client.vehicle, b"".join(replies))

    def _put_replies(self, client: Client) -> list[bytes]:
        """Queue the replies of a client, without copies to watchers; return them."""
        self._replying.discard(client.number)
        replies, client.replies = client.replies, []
        for line in replies:
            client.send_queue.put(line, keep=True)
            self._unsent.add(client.number)
        return replies

    def _queue_outputs(self, outputs: Mapping[int, TickOutput]) -> None:
        """Encode the reports of all robots in a tick by one call, and queue them."""
        if not outputs:  # the case in nine of ten ticks with a single robot
            return
        robots = self.spawner.clients_by_robot  # without robots that have no client
        heard = [(robots[n], output) for n, output in outputs.items() if n in robots]
        blocks = [
            (
                [*output.cast, *output.scans],
                output.group.dialect,
                output.group,
                output.numbers,
            )
            for _, output in heard
        ]
        call = self.simulation.faults.call
        encoded: list[list[bytes] | None]
        try:
            encoded = [[lines] for lines in encode_blocks(blocks)]
        except Exception:  # noqa: BLE001 - the calls below find the failed robot
            encoded = [
                call(client.robot, encode_blocks, [block])
                for (client, _), block in zip(heard, blocks, strict=True)
            ]
        for (client, output), lines in zip(heard, encoded, strict=True):
            if lines is not None:
                call(client.robot, self._queue_output, client, output, lines[0])

    def _queue_output(self, client: Client, output: TickOutput, lines: bytes) -> None:
        """Queue the encoded reports of one robot, with its replies and echo lines."""
        requested = shown = b""  # echo lines for the client, and for its watchers
        for scan in output.echoes:
            its_lines = self._lines_of(scan, output.group.dialect)
            shown += its_lines
            if scan.is_requested:
                requested += its_lines
        put, vehicle = client.send_queue.put_readings, client.robot
        is_watched = vehicle in self.watchers
        if client.replies or shown:
            # Lines are split only if other lines have to come between them (rule 2).
            each = lines.splitlines(keepends=True)
            first, last = int(output.has_status), len(each) - len(output.scans)
            parts = each[:first], each[first:last], each[last:]
            status, readings, scans = (b"".join(part) for part in parts)
            put(status)
            replies = b"".join(self._put_replies(client))
            put(readings + requested + scans)
            if is_watched:
                before = status + replies + readings
                own, others = (before + x + scans for x in (requested, shown))
                self.watchers.copy(vehicle, own, others)
        else:
            put(lines)
            if is_watched:
                self.watchers.copy(vehicle, lines)
        if client.send_queue:
            self._unsent.add(client.number)

    def _lines_of(self, scan: ScanEchoes | DueScan, dialect: Dialect) -> bytes:
        """Return the echo lines of a scan, or the lines of its other reports."""
        if isinstance(scan, ScanEchoes):
            time = self.simulation.time
            return self._echo_writer.write(time, scan.scanner, scan.echoes, dialect)
        return encode_blocks([(scan.reports, dialect, None, ())])[0]
