"""Sends watchers copies of the lines that the clients of other robots receive.

Each watcher has a separate queue for the copies. A watcher that reads too slowly loses
the oldest copies, and delays no other client. All lines of one robot in one tick are
lost together. A watcher never loses answers, or lines about robots that join or leave.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from radarsim.protocol.commands import Watch
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import Report, to_bytes
from radarsim.protocol.watch import (
    ClockTick,
    RobotJoined,
    RobotLeft,
    Watching,
    see_head,
)
from radarsim.server.host.connection import Client, Diagnostic

if TYPE_CHECKING:
    from radarsim.protocol.dialect import Dialect
    from radarsim.simulation.vehicle import Vehicle

MAX_WATCHERS: Final = 32  # limited, because all lines are copied for each watcher


class Watchers:
    """The watchers of a host, and the robots that each of them watches."""

    def __init__(self, dialect: Dialect, unsent: set[int]) -> None:
        """Start without watchers.

        Args:
            dialect: The dialect of the lines about robots.
            unsent: Numbers of clients with bytes to send; numbers of watchers are added
                to it.
        """
        self._dialect = dialect
        self._unsent = unsent
        self._watches: dict[int, tuple[Client, Watch]] = {}
        self._robots: dict[int, Vehicle] = {}  # the robots that have a client
        # The watchers of each robot, and whether they also get echo lines.
        self._audiences: dict[int, dict[int, tuple[Client, bool]]] = {}

    def __contains__(self, vehicle: Vehicle) -> bool:
        return vehicle.number in self._audiences

    def watch(self, client: Client, watch: Watch) -> Diagnostic | None:
        """Set the robots that a client watches; return a diagnostic on refusal."""
        is_end = watch.robots.names == ()  # no robots: the client ends watching
        is_full = len(self._watches) >= MAX_WATCHERS
        if is_full and client.number not in self._watches and not is_end:
            text = f"WATCH of one watcher more, expected at most {MAX_WATCHERS}"
            return Diagnostic("watchers", text)
        self.remove(client)
        self.tell(client, Watching(watch.robots, watch.echoes))
        if not is_end:
            self._watches[client.number] = client, watch
            for vehicle in self._robots.values():
                self._join(client, watch, vehicle)
        return None

    def remove(self, client: Client) -> None:
        """Remove a client from the watchers."""
        if self._watches.pop(client.number, None) is None:
            return
        for number, audience in list(self._audiences.items()):
            audience.pop(client.number, None)
            shows_echoes = any(hears for _, hears in audience.values())
            self._robots[number].shows_echoes = shows_echoes
            if not audience:
                del self._audiences[number]

    def add_robot(self, vehicle: Vehicle) -> None:
        """Let the watchers that have chosen a new robot watch it."""
        self._robots[vehicle.number] = vehicle
        for client, watch in self._watches.values():
            self._join(client, watch, vehicle)

    def remove_robot(self, vehicle: Vehicle) -> None:
        """Remove a robot, and report that to the watchers of all robots."""
        del self._robots[vehicle.number]
        self._audiences.pop(vehicle.number, None)
        for client, watch in self._watches.values():
            if watch.robots.names is None:
                self.tell(client, RobotLeft(vehicle.robot.name))

    def tell(self, client: Client, report: Report) -> None:
        """Queue a report that is only sent to watchers; it is never dropped."""
        line = to_bytes([report.encode(self._dialect)])
        client.watch_queue.put(line, keep=True)
        self._unsent.add(client.number)

    def tell_time(self, time: float) -> None:
        """Send the simulated time, s, to the watchers that have requested it."""
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
        """Queue copies, for watchers, of the lines sent to the client of a robot.

        Args:
            vehicle: A watched robot.
            lines: The lines to its client.
            with_echoes: The same lines with the echo lines of all scanners; None if
                both are equal.
        """
        # Each line has its own prefix, because a watcher may lose the lines before it.
        head = see_head(vehicle.robot.name)
        copies = [
            head + head.join(each.splitlines(keepends=True)) if each else b""
            for each in (lines, with_echoes or lines)
        ]
        for client, hears_echoes in self._audiences[vehicle.number].values():
            if copies[hears_echoes]:
                client.watch_queue.put(copies[hears_echoes], keep=False)
                self._unsent.add(client.number)

    def _join(self, client: Client, watch: Watch, vehicle: Vehicle) -> None:
        """Let a client watch an existing robot if the client has chosen it."""
        name = printable_name(vehicle.robot.name)
        if watch.robots.names is None:
            self.tell(client, RobotJoined(name, vehicle.model.name))
        elif not watch.robots.includes(name):
            return
        hears_echoes = watch.echoes.includes(name)
        audience = self._audiences.setdefault(vehicle.number, {})
        audience[client.number] = client, hears_echoes
        vehicle.shows_echoes |= hears_echoes
