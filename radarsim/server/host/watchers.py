"""Clients that watch robots: they get copies of what the robots' clients are sent.

A watcher has a queue of its own for the copies. If it reads too slowly it loses the
oldest, all lines of a robot in a tick together, and holds up nobody. It never loses
answers, nor the news of which robots there are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import Report, to_bytes
from radarsim.protocol.watch import (
    ClockTick,
    RobotJoined,
    RobotLeft,
    Watch,
    Watching,
    see_head,
)
from radarsim.server.host.connection import Client

if TYPE_CHECKING:
    from radarsim.protocol.dialect import Dialect
    from radarsim.simulation.vehicle import Vehicle

MAX_WATCHERS: Final = 32  # as all lines are copied for each


@dataclass(slots=True)
class Audience:
    """The watchers of one robot.

    Attributes:
        head: What precedes each line.
        plain: Watchers that get what the robot's client gets, by number of the client.
        with_echoes: Watchers for whom all scanners list their echoes.
    """

    head: bytes
    plain: dict[int, Client] = field(default_factory=dict)
    with_echoes: dict[int, Client] = field(default_factory=dict)


class Watchers:
    """All watchers, and which robots each of them watches."""

    def __init__(self, dialect: Dialect, unsent: set[int]) -> None:
        """Start without watchers.

        Args:
            dialect: The dialect of the lines about robots.
            unsent: Numbers of clients for whom bytes wait, to which watchers are added.
        """
        self._dialect = dialect
        self._unsent = unsent
        self._watches: dict[int, tuple[Client, Watch]] = {}
        self._robots: dict[int, Vehicle] = {}  # that have a client
        self._audiences: dict[int, Audience] = {}  # of robots that are watched

    def __contains__(self, vehicle: Vehicle) -> bool:
        return vehicle.number in self._audiences

    def takes(self, client: Client) -> bool:
        """Return whether a client watches already, or there are not too many others."""
        return client.number in self._watches or len(self._watches) < MAX_WATCHERS

    def watch(self, client: Client, watch: Watch) -> None:
        """Let a client watch robots instead of those that it has watched."""
        self.remove(client)
        self.tell(client, Watching(watch.robots, watch.echoes))
        # Nobody: such a command ends watching, and has been answered.
        if watch.robots.names == ():
            return
        self._watches[client.number] = client, watch
        for vehicle in self._robots.values():
            self._join(client, watch, vehicle)

    def remove(self, client: Client) -> None:
        """Let a client watch no robots."""
        if self._watches.pop(client.number, None) is None:
            return
        for number, audience in list(self._audiences.items()):
            audience.plain.pop(client.number, None)
            audience.with_echoes.pop(client.number, None)
            self._robots[number].shows_echoes = bool(audience.with_echoes)
            if not audience.plain and not audience.with_echoes:
                del self._audiences[number]

    def add_robot(self, vehicle: Vehicle) -> None:
        """Let those watch a new robot who asked for it."""
        self._robots[vehicle.number] = vehicle
        for client, watch in self._watches.values():
            self._join(client, watch, vehicle)

    def remove_robot(self, vehicle: Vehicle) -> None:
        """Tell those who watch all robots that one has left."""
        del self._robots[vehicle.number]
        self._audiences.pop(vehicle.number, None)
        for client, watch in self._watches.values():
            if watch.robots.names is None:
                self.tell(client, RobotLeft(vehicle.robot.name))

    def tell(self, client: Client, report: Report) -> None:
        """Queue a line that only watchers know; it is not dropped."""
        line = to_bytes([report.encode(self._dialect)])
        client.watch_queue.put(line, keep=True)
        self._unsent.add(client.number)

    def tell_time(self, time: float) -> None:
        """Tell the time to those who asked for it in every tick."""
        clocks = [client for client, watch in self._watches.values() if watch.clock]
        if clocks:
            line = to_bytes([ClockTick(time).encode(self._dialect)])
            for client in clocks:
                client.watch_queue.put(line, keep=False)
                self._unsent.add(client.number)

    def copy(
        self,
        vehicle: Vehicle,
        lines: bytes,
        with_echoes: bytes | None = None,
    ) -> None:
        """Queue copies of what the client of a robot is sent.

        Args:
            vehicle: A robot that is watched.
            lines: What its client is sent.
            with_echoes: The same with the echoes of all scanners; None where nothing
                differs.
        """
        audience = self._audiences[vehicle.number]
        self._put(audience.head, lines, audience.plain)
        self._put(audience.head, with_echoes or lines, audience.with_echoes)

    def _put(self, head: bytes, lines: bytes, clients: dict[int, Client]) -> None:
        if clients and lines:
            # The head stands in front of each line, as watchers may lose the lines
            # before it.
            copies = head + head.join(lines.splitlines(keepends=True))
            for client in clients.values():
                client.watch_queue.put(copies, keep=False)
            self._unsent.update(clients)

    def _join(self, client: Client, watch: Watch, vehicle: Vehicle) -> None:
        """Let a client watch a robot that is there, if it asked for it."""
        name = printable_name(vehicle.robot.name)
        if watch.robots.names is None:
            self.tell(client, RobotJoined(name, vehicle.model.name))
        elif not watch.robots.includes(name):
            return
        audience = self._audiences.setdefault(vehicle.number, Audience(see_head(name)))
        if watch.echoes.includes(name):
            audience.with_echoes[client.number] = client
            vehicle.shows_echoes = True
        else:
            audience.plain[client.number] = client
