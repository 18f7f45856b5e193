"""One simulation and many clients, without sockets.

Theory of operation
===================
A server passes on what a client sent (``receive``), advances time (``step``), and sends
the bytes that are due (``take``). Commands are executed as they come. Their replies
wait for the one write of the next tick, together with the readings of the tick. A
client without a robot gets nothing in a tick: its replies can be sent at once.

Rule 1: nothing that a client sends raises. What cannot be executed is ignored, as the
original server does, and returned as a ``Diagnostic`` for the log. An error that only a
bug can cause ends the robot of one client, which gets a message and is to be
disconnected; the others go on.
Rule 2: a write consists of status, replies, readings, echoes and scans, in this order,
on which clients rely. Only clients that ask for echoes get them.
Rule 3: a client that does not read loses readings, but no replies; one that keeps on
asking without reading is to be disconnected (``close_reason``).
Rule 4: commands per tick and robots per time are limited for each client, and the work
of a tick for all clients together; what exceeds a limit waits for the next ticks
(``is_busy``). A command that arrives while none of its client waits is executed at
once, except INIT while those of others wait, which go first. Commands that wait are
executed in turns, one of each client, and cannot use up the work that is reserved for
those that arrive. The searches for a free place have a limit of their own: one goes on
after the other, over several ticks, while the later commands of its client wait. Nor
can several clients that send much use up the reserve for the first command of each
client in a tick, unless these first commands do. How the bytes of a client are split
into packets changes nothing.
Rule 5: a client that watches robots gets copies of what their clients are sent, in a
queue of its own, which comes last in a write. It changes no byte that others get.
Rule 6: in a tick in which no time passes commands are executed and answered as in any
other; only readings wait, and a second robot of a client, which comes some time later.
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

COMMANDS_PER_TICK = 20  # of a client; real ones send a few
# Units of work of all clients together in a tick: for commands on arrival, for the
# first command of each client once that is used up, and for those that have waited. A
# unit is about 20 us.
ARRIVAL_WORK = 80
FIRST_WORK = 50
WAITING_WORK = 40


class HostObserver:
    """Gets the calls of a host: to record it, or to follow it.

    A method must not raise, nor do anything to the host. Each does nothing unless a
    subclass overrides it.
    """

    def begin(self, simulation: Simulation) -> None:
        """It follows a host, whose simulation this is, from now on."""

    def connect(self, client: int) -> None:
        """A client has been added."""

    def disconnect(self, client: int) -> None:
        """A client and its robot have been removed."""

    def receive(self, client: int, data: bytes) -> None:
        """A client has sent bytes, none of whose commands has been executed yet."""

    def execute(self, client: int, vehicle: Vehicle | None) -> None:
        """Commands of a client may have been executed; it has this robot now."""

    def step(self, *, passes: bool) -> None:
        """A tick comes next, in which simulated time passes or not."""

    def take(self, client: int, data: bytes) -> None:
        """A client is sent bytes."""

    def finish(self, client: int, data: bytes) -> None:
        """A client that sends no more is sent its last bytes, or none."""


class Host:
    """A server without its sockets.

    Attributes:
        simulation: The simulation that commands act on.
        spawner: Spawns the robots of clients.
        watchers: The clients that watch robots.
        known_replies: Lines of replies by what they depend on, which are kept.
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
            scene: From ``load_map``.
            config: Dialect, drive unit and item settings; None for the defaults.
            seed: Seed of all random numbers.
            observers: Get the calls of the host, one after the other.

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
        # Clients of whom there is something to do; in a tick no others are looked at.
        self._waiting: set[int] = set()  # have commands that wait
        self._spent: set[int] = set()  # have used up some of their commands
        self._replying: set[int] = set()  # have replies that wait for the next tick
        self._unsent: set[int] = set()  # have bytes that are to be sent
        self.watchers: Watchers = Watchers(config.dialect, self._unsent)
        self.spawner = Spawner(self.simulation, self.watchers)
        self.known_replies: dict[tuple[str | None, ...], bytes] = {}
        self._arrival_work, self._first_work = ARRIVAL_WORK, FIRST_WORK
        self._echo_writer = EchoWriter(lambda: self.simulation.body_names)
        self._last_served = 0  # number of the client whose waiting command was last
        for observer in observers:
            self.add_observer(observer)

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
        return self.simulation.scene

    @property
    def config(self) -> SimulationConfig:
        """Configuration of all robots."""
        return self.simulation.config

    def add_observer(self, observer: HostObserver) -> None:
        """Call one more from now on."""
        self._observers.append(observer)
        observer.begin(self.simulation)

    def connect(self, address: str = "") -> int:
        """Add a client, and greet it.

        Args:
            address: Address of its machine, by which viewers find its robot.

        Returns:
            The number of the client, for all other calls.
        """
        # Numbers are not used again, as observers and watchers know clients by them.
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
        """Execute what a client sent, as far as its budget for this tick allows.

        Returns:
            Diagnostics of commands without effect.
        """
        client = self._clients[number]
        for observer in self._observers:
            observer.receive(number, data)
        if client.lines.overflow is not None or client.fault is not None:
            return []
        # Lines that wait go first, whatever comes with the next packet: a client relies
        # on the order of its commands.
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
        """Return whether commands of a client wait; it should not send more then."""
        return bool(self._clients[number].pending)

    def waits_to_spawn(self, number: int) -> bool:
        """Return whether a robot is among what a client waits for."""
        pending = self._clients[number].pending
        return any(line.lstrip().upper().startswith(Init.verb) for line in pending)

    def has_robot(self, number: int) -> bool:
        """Return whether a client has a robot, and so gets a write in every tick."""
        return self._clients[number].vehicle is not None

    def only_watches(self, number: int) -> bool:
        """Return whether all that waits for a client are lines of others' robots."""
        client = self._clients[number]
        return client.vehicle is None and not client.send_queue

    def close_reason(self, number: int) -> str:
        """Return why a client is to be disconnected; empty if it is not.

        It sent an endless line or an HTTP request, it reads too few replies, or its
        robot has ended by an error; of the last it is to be sent what waits.
        """
        return self._clients[number].close_reason()

    def fault(self, number: int) -> Exception | None:
        """Return the error that has ended the robot of a client, if there is one."""
        return self._clients[number].fault

    def raise_fault(self) -> None:
        """Raise the error that has ended the robot of a client, if there is one."""
        for client in self._clients.values():
            if client.fault is not None:
                raise client.fault

    def step(self, *, passes: bool = True) -> list[tuple[int, Diagnostic]]:
        """Advance by 10 ms, and queue everything that is due for the clients.

        Args:
            passes: Whether time passes; while it does not, commands are executed and
                answered nevertheless.

        Returns:
            Numbers of clients with diagnostics of commands that had waited.
        """
        for observer in self._observers:
            observer.step(passes=passes)
        # Only their commands are executed in a tick.
        waiting = sorted(self._waiting)
        for number in self._spent:
            self._clients[number].command_budget = COMMANDS_PER_TICK
        self._spent.clear()
        self._arrival_work, self._first_work = ARRIVAL_WORK, FIRST_WORK
        self.spawner.begin_tick()
        diagnostics = self._handle_waiting()
        # Motion first: a client reads the pose at the end of the tick, with what it
        # commanded before it.
        if passes:
            self.simulation.step()
            self.watchers.tell_time(self.simulation.time)
            self._queue_outputs(self.simulation.collect_reports())
            self._remove_failed()
        # Robots that reported have got theirs already, within the write of their tick.
        for number in sorted(self._replying):
            self._queue_replies(self._clients[number])
        # After all that the tick does, as in recordings that there are already: a new
        # robot comes after the turns of others' radars in its tick.
        for observer in self._observers:
            for number in waiting:
                observer.execute(number, self._clients[number].vehicle)
        return diagnostics

    def clients_to_send(self) -> list[int]:
        """Return the numbers of the clients for whom bytes wait, in ascending order."""
        return sorted(self._unsent)

    def take(self, number: int) -> bytes:
        """Return and remove the bytes to send to a client: whole lines, in order."""
        data = self._take(number)
        if data:
            for observer in self._observers:
                observer.take(number, data)
        return data

    def finish(self, number: int) -> bytes:
        """Return the replies that are due to a client that sends no more."""
        self._queue_replies(self._clients[number])
        data = self._take(number)
        for observer in self._observers:
            observer.finish(number, data)
        return data

    def _take(self, number: int) -> bytes:
        self._unsent.discard(number)
        return self._clients[number].take()

    def unsent_bytes(self, number: int) -> int:
        """Return the number of bytes that are to be sent to a client."""
        client = self._clients[number]
        return len(client.send_queue) + len(client.watch_queue)

    def dropped_readings(self, number: int) -> int:
        """Return how many readings a client has lost because it did not read.

        Lines of robots that it watches count as well.
        """
        client = self._clients[number]
        return client.send_queue.dropped + client.watch_queue.dropped

    def _handle_arrived(self, client: Client) -> list[Diagnostic]:
        """Execute commands of a client that had none waiting."""
        diagnostics = []
        while client.pending and client.command_budget:
            # The reserve of first commands keeps bursts of some clients from delaying
            # the only command of another one by a tick.
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
        """Execute commands that have waited, in turns, one of each client."""
        # Of those that wait to spawn, only the first can have their turn.
        to_spawn = self.spawner.queue
        waiting = sorted(self._waiting - to_spawn.keys())
        # Begin after the client that was served last. Otherwise clients with low
        # numbers would use up the work of each tick.
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
            # A client without a robot has no tick of its own to wait for.
            if client.vehicle is None:
                self._queue_replies(client)
            elif client.replies:
                self._replying.add(client.number)
        return handled

    def _remove_failed(self) -> None:
        """Remove the robots in which something has failed in this tick."""
        errors = self.simulation.faults.errors
        while errors:
            number, error = errors.popitem()
            if number not in self.spawner.clients_by_robot:
                raise error  # whoever has spawned this robot is no client
            self._fail(self.spawner.clients_by_robot[number], error)

    def _fail(self, client: Client, error: Exception) -> None:
        """Remove the robot of a client, which gets the reason."""
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
        """Queue replies for a client alone, and return them."""
        self._replying.discard(client.number)
        replies, client.replies = client.replies, []
        for line in replies:
            client.send_queue.put(line, keep=True)
            self._unsent.add(client.number)
        return replies

    def _queue_outputs(self, outputs: Mapping[int, TickOutput]) -> None:
        """Queue what robots report in a tick; all lines are encoded together."""
        if not outputs:  # as in nine of ten ticks of a lone robot
            return
        robots = self.spawner.clients_by_robot  # others may have been spawned
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
        except Exception:  # noqa: BLE001 - the robot that failed is found below
            encoded = [
                call(client.robot, encode_blocks, [block])
                for (client, _), block in zip(heard, blocks, strict=True)
            ]
        for (client, output), lines in zip(heard, encoded, strict=True):
            if lines is not None:
                call(client.robot, self._queue_output, client, output, lines[0])

    def _queue_output(self, client: Client, output: TickOutput, lines: bytes) -> None:
        """Queue what one robot reports; ``lines`` are those of its reports."""
        requested = shown = b""  # what its client asked for, and all that watchers get
        for scan in output.echoes:
            its_lines = self._lines_of(scan, output.group.dialect)
            shown += its_lines
            if scan.is_requested:
                requested += its_lines
        put, vehicle = client.send_queue.put_readings, client.robot
        is_watched = vehicle in self.watchers
        if client.replies or shown:
            # Lines are cut apart only where something comes between them (rule 2).
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
        """Return the lines of the echoes of a scan, or of what else belongs to it."""
        if isinstance(scan, ScanEchoes):
            time = self.simulation.time
            return self._echo_writer.write(time, scan.scanner, scan.echoes, dialect)
        return encode_blocks([(scan.reports, dialect, None, ())])[0]
