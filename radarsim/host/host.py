"""One simulation and many clients, without sockets.

Theory of operation
===================
A shell hands over what a client sent (``receive``), lets time pass (``step``), and
sends what there is (``take``). Commands are carried out as they come; what they are
answered with waits for the tick's one write, as does everything that the tick itself
tells. A client without a robot has no ticks: its answers can be sent at once.

Rule 1: nothing that a client sends raises. What cannot be carried out is ignored, as
the original server ignores it, and told to the shell as a ``Diagnostic`` for its log.
Rule 2: the order in a write is status, answers, readings, echoes, scans. Clients rely
on it. Echoes are told to none but those that ask.
Rule 3: a client that does not read loses readings, not answers; one that goes on
asking without reading is to be disconnected (``must_close``).
Rule 4: a client gets so many commands a tick, and a robot so often; what it sends
beyond that waits for the next ticks (``is_busy``), so that a flood delays nobody else.
How the bytes were cut on their way changes nothing.
"""

import warnings

from radarsim.host.commands import CommandHandler
from radarsim.host.connection import Client, Diagnostic
from radarsim.protocol.encode import encode_report, to_bytes
from radarsim.protocol.reports import Greeting, Report
from radarsim.scene.scene import Scene
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation, TickOutput

COMMANDS_A_TICK = 20  # clients in the field send a few; answers cost most of a tick


class Host:
    """A server, but for its sockets.

    Attributes:
        simulation: The world that the clients share.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        config: SimulationConfig | None = None,
        seed: int = 0,
        conditions: SimulationConfig | None = None,
    ) -> None:
        """Create a simulation of a scene, without robots and clients.

        Args:
            scene: From ``load_map``.
            config: Dialect, drive unit and item settings; None for the defaults.
            seed: Seed of all random numbers.
            conditions: Deprecated name of ``config``.

        Raises:
            PresetError: If the configuration does not fit the robot classes.
        """
        if conditions is not None:
            warnings.warn(
                "Host(conditions=...) is deprecated, expected Host(config=...)",
                DeprecationWarning,
                stacklevel=2,
            )
        config = config or conditions or SimulationConfig()
        config.check()
        self._dialect = config.dialect
        self.simulation = Simulation(scene, config=config, seed=seed)
        self._orders = CommandHandler(self.simulation, config)
        self._clients: dict[int, Client] = {}
        self._connected = 0

    def connect(self) -> int:
        """Take a client in, and greet it.

        Returns:
            Its number, for all other calls.
        """
        self._connected += 1
        client = self._clients[self._connected] = Client(turns=COMMANDS_A_TICK)
        client.answers.append(Greeting(self.simulation.scene.level))
        self._answer(client)
        return self._connected

    def disconnect(self, number: int) -> None:
        """Forget a client; its robot vanishes, and the robot's name is free again."""
        self._orders.dismiss(self._clients.pop(number))

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        """Carry out what a client sent, as far as its turn goes.

        Returns:
            What had no effect.
        """
        client = self._clients[number]
        if client.lines.overflow is not None:
            return []
        client.pending.extend(client.lines.feed(data))
        notices = self._take_turns(client)
        if client.lines.overflow is not None:
            notices.append(Diagnostic("line", str(client.lines.overflow)))
        return notices

    def is_busy(self, number: int) -> bool:
        """Tell whether commands of a client wait, so that it should not send more."""
        return bool(self._clients[number].pending)

    def has_robot(self, number: int) -> bool:
        """Tell whether a client has a robot, and so a write in every tick."""
        return self._clients[number].vehicle is not None

    def must_close(self, number: int) -> bool:
        """Tell whether a client is past serving: an endless line, or unread answers."""
        client = self._clients[number]
        return client.lines.overflow is not None or client.outbox.overflowed

    def step(self) -> list[tuple[int, Diagnostic]]:
        """Let 10 ms pass; all that falls due waits in the clients' outboxes.

        Returns:
            What had no effect of the commands that had to wait, by client.
        """
        notices = []
        for number, client in self._clients.items():
            client.turns = COMMANDS_A_TICK
            notices += [(number, notice) for notice in self._take_turns(client)]
        self.simulation.step()
        told = self.simulation.collect_reports()
        for client in self._clients.values():
            if client.vehicle is not None:
                self._write_tick(client, told[client.vehicle.number])
        return notices

    def drain_and_finish(self, number: int) -> bytes:
        """Give what a client that will send no more is owed: all its answers."""
        client = self._clients[number]
        waiting = len(client.pending) + 1
        while len(client.pending) < waiting:  # an INIT that is too early ends it
            waiting = len(client.pending)
            client.turns = COMMANDS_A_TICK
            self._take_turns(client)
        self._answer(client)
        return client.outbox.take()

    def take(self, number: int) -> bytes:
        """Give what a client is to be sent: whole lines, in order."""
        return self._clients[number].outbox.take()

    def unsent_bytes(self, number: int) -> int:
        """Tell how many bytes a client is to be sent."""
        return len(self._clients[number].outbox)

    def dropped_readings(self, number: int) -> int:
        """Tell how many readings a client has lost by not reading."""
        return self._clients[number].outbox.dropped

    def _take_turns(self, client: Client) -> list[Diagnostic]:
        notices = []
        while client.pending and client.turns:
            line = client.pending.popleft()
            done, notice = self._orders.handle(client, line)
            if not done:
                client.pending.appendleft(line)
                break
            client.turns -= 1
            if notice is not None:
                notices.append(notice)
            if client.vehicle is None:
                self._answer(client)
        return notices

    def _answer(self, client: Client) -> None:
        self._put(client, client.answers, keep=True)
        client.answers.clear()

    def _write_tick(self, client: Client, told: TickOutput) -> None:
        if told.status is not None:
            self._put(client, [told.status], keep=False)
        self._answer(client)
        self._put(client, [*told.readings, *told.echoes, *told.scans], keep=False)

    def _put(self, client: Client, reports: list[Report], *, keep: bool) -> None:
        for report in reports:
            line = to_bytes([encode_report(report, self._dialect)])
            client.outbox.put(line, keep=keep)
