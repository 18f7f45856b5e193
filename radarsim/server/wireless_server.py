"""A wireless server (WSS), which relays connections between robots within radio range.

Theory of operation
===================
A robot's program registers with the robot's name and the ports on which it listens.
Another robot requests a relay port for one of these ports and connects to the relay
port. The server forwards bytes in both directions while the signal between the two
robots is strong enough. It checks the signal every ``LOOK_INTERVAL``: if the signal is
too weak, it closes the relay port and its connections, and opens the port again later.

Rule 1: the server connects to a program only at the address from which the program
registered.
Rule 2: a robot that has left or has an empty battery is disconnected. A registered
robot that has not spawned yet has no signal.
Rule 3: a robot that reads slowly does not fill the memory: the sender has to wait, and
the connection is closed if the robot reads nothing for ``STALL_TIMEOUT``.
Rule 4: ticks must stay on time under any load. So requests are answered like queries in
``question_server``, relay ports are checked one after the other, and a connection
pauses after each forwarded chunk; this pause grows with the number of connections.
"""

from __future__ import annotations

import asyncio
import logging
import math
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from radarsim.errors import ServerError
from radarsim.listening import (
    ACCEPTED_AT_ONCE,
    MAX_WAITING,
    bind,
    configure_socket,
    first_of,
)
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.questions import (
    CUTOFF,
    read_request,
    signal_strength,
    strength_text,
)
from radarsim.server.question_server import (
    REST,
    QuestionClient,
    QuestionServer,
    count_obstacles,
)

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Sequence

    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

log = logging.getLogger("radarsim.server")

MAX_ROBOTS: Final = 32
MAX_RELAYS: Final = 128  # relay ports of all pairs of robots
MAX_LINKS: Final = 64  # connections through all relay ports
LOOK_INTERVAL: Final = 1.0  # s, as in the original server
UNHURRIED_LINKS: Final = 8  # number of links above which pauses become longer
CONNECT_TIMEOUT: Final = 5.0  # s
READ_BYTES: Final = 32_768  # largest forwarded chunk
STALL_TIMEOUT: Final = 60.0  # s; otherwise a lost peer would hold a link forever
CLOSE_GRACE: Final = 2.0  # s for a peer to read the last bytes before a link is closed
Place: TypeAlias = tuple[str, int]  # address and port
Ports: TypeAlias = tuple[int, ...] | None  # None for ports that are not readable


class WirelessServer(QuestionServer):
    """Registers robots, and relays connections between them."""

    def __init__(self, simulation: Simulation, *, port: int) -> None:
        """Create a server that does not listen yet.

        Args:
            simulation: Simulation with the robots.
            port: Port to listen on; 0 for a free one.
        """
        super().__init__(lambda _: b"", port=port, kind="wireless clients")
        self.robots: dict[str, WirelessClient] = {}
        self._simulation = simulation
        self._relays: dict[tuple[str, str, int], RelayPort] = {}
        self._seen: set[str] = set()  # names of registered robots that have spawned

    def _accept(self) -> WirelessClient:
        return WirelessClient(self)

    async def _work(self) -> None:
        """Check robots and relay ports periodically until cancelled."""
        while True:
            self._look()
            await asyncio.sleep(LOOK_INTERVAL / max(1, len(self._relays)))

    def strength(self, one: str, other: str) -> float | None:
        """Return the signal strength between two robots, dBm; None if one is absent."""
        present = self._present()
        if not {one, other} <= present.keys():
            return None
        places = [present[each].robot.body.numbers()[:3] for each in (one, other)]
        start, end = sorted(places)
        count = count_obstacles(self._simulation.scene, start, end)
        return signal_strength(math.dist(start, end), count)

    def hears(self, one: str, other: str) -> bool:
        """Return whether two robots receive each other's signals."""
        strength = self.strength(one, other)
        return strength is not None and strength >= CUTOFF

    def relay_port(self, source: str, target: str, port: int) -> int | None:
        """Return the relay port from one robot to a port of another robot.

        Returns:
            The number of the relay port; None if no further port is available.
        """

        def place() -> Place | None:
            robot = self.robots.get(target)
            has_room = self._count_links() < MAX_LINKS
            return (robot.address, port) if robot and has_room else None

        key = source, target, port
        if key not in self._relays:
            if len(self._relays) >= MAX_RELAYS:
                return None
            try:
                relay = RelayPort(self.addresses, place, self._rest)
            except ServerError:
                return None
            self._relays[key] = relay
        if self.hears(source, target):
            self._relays[key].open()
        return self._relays[key].number

    def caller(self, target: str, port: int) -> str | None:
        """Return the robot that is connected to ``target`` through a relay port.

        Args:
            target: Name of the robot that accepted the connection.
            port: Local port of this server on the connection to ``target``.
        """
        for (source, to, _), relay in self._relays.items():
            if to == target and port in relay.links.values():
                return source
        return None

    def _count_links(self) -> int:
        return sum(len(relay.links) for relay in self._relays.values())

    def _rest(self) -> float:
        """Return the pause of a connection after each forwarded chunk, s."""
        return REST * max(1.0, self._count_links() / UNHURRIED_LINKS)

    def forget(self, name: str) -> None:
        """Close all relay ports of a robot that has disconnected."""
        self.robots.pop(name, None)
        for key in [each for each in self._relays if name in each[:2]]:
            self._relays.pop(key).close()

    def _present(self) -> dict[str, Vehicle]:
        """Return the robots whose batteries are not empty, by name."""
        return {v.robot.name: v for v in self._simulation.vehicles if v.alive}

    def _look(self) -> None:
        """Disconnect robots that have left; open or close one relay port per call.

        Each call checks the signal of one relay port, in round-robin order.
        """
        present = self._present()
        self._seen |= present.keys() & self.robots.keys()
        for name in self._seen - present.keys():
            self._seen.discard(name)
            if name in self.robots:
                client = self.robots[name]
                log.info("%s: robot %s was removed", client.peer, printable_name(name))
                client.close()
        for key in list(self._relays)[:1]:
            relay = self._relays[key] = self._relays.pop(key)  # move it to the end
            if self.hears(*key[:2]):
                relay.open()
            else:
                relay.close()


class WirelessClient(QuestionClient):
    """The connection of a robot that registers and requests relay ports."""

    KIND = "wireless client"
    MOST = MAX_ROBOTS

    def __init__(self, server: WirelessServer) -> None:
        """Create the protocol of a connection to a server."""
        super().__init__(server, self._reply, keeps_blank=False)
        self._wireless = server
        self.name, self.address = "", ""
        self.ports: tuple[int, ...] = ()

    def _begin(self, transport: asyncio.Transport) -> None:
        super()._begin(transport)
        self.address = transport.get_extra_info("peername")[0]

    def _reply(self, line: str) -> bytes:
        reply = self._answer_request(*read_request(line))
        return f"{reply}\r\n".encode("ascii", "replace")

    def _answer_request(self, verb: str, robot: str, ports: Ports) -> str:
        if not self.name:
            return self._register(verb, robot, ports)
        fault = _fault_of(verb, robot, ports)
        if fault:
            return f"ERROR {{Reason {fault}}}"
        if verb == "GETSS":
            return self._tell_strength(robot)
        if verb == "DNS":
            return self._reach(robot, ports or ())
        port = (ports or (0,))[0]
        name = self._wireless.caller(self.name, port)
        who = "Error UnknownOrIllegalPort"
        if name is not None:
            who = f"Robot {printable_name(name)}"
        return f"REVERSEDNSREPLY {{Port {port}}} {{{who}}}"

    def _register(self, verb: str, robot: str, ports: Ports) -> str:
        if verb != "INIT":
            return "ERROR {Reason Must.Use.INIT.Method.First}"
        if ports is None:
            return "ERROR {Reason Ports.List.Must.Be.Integer}"
        if not robot:
            return "ERROR {Reason Robot.Name.Must.Not.Be.Empty}"
        if robot in self._wireless.robots:
            # The original server has the same misspelling.
            return "ERROR {Reason Robot.Alread.Exists}"
        self.name, self.ports = robot, ports
        self._wireless.robots[robot] = self
        log.info("%s: registered as %s", self.peer, printable_name(robot))
        return "INITREPLY {Status OK}"

    def _tell_strength(self, name: str) -> str:
        robot = f"SS {{Robot {printable_name(name)}}}"
        if name == self.name:
            return f"{robot} {{Strength INF}} {{Error SS.To.Self}}"
        if name not in self._wireless.robots:
            return f"{robot} {{Strength NaN}} {{Error Robot.Does.Not.Exist}}"
        return f"{robot} {strength_text(self._wireless.strength(self.name, name))}"

    def _reach(self, name: str, ports: tuple[int, ...]) -> str:
        """Answer a DNS request with the relay port to another robot."""
        other = self._wireless.robots.get(name)
        reply = f"DNSREPLY {{Robot {printable_name(name)}}}"
        if other is None or other is self:
            return f"{reply} {{Port -1}} {{Error NoSuchRobot}}"
        wanted = ports or other.ports
        if not wanted or wanted[0] not in other.ports:
            return f"{reply} {{Port -1}} {{Error RobotDoesNotListenOnThisPort}}"
        number = self._wireless.relay_port(self.name, name, wanted[0])
        if number is None:
            return "ERROR {Reason Could.Not.Allocate.Port}"
        return f"{reply} {{Port {number}}}"

    def _forget(self) -> None:
        super()._forget()
        if self.name:
            self._wireless.forget(self.name)


def _fault_of(verb: str, robot: str, ports: Ports) -> str:
    """Return the fault in a request of a registered robot; empty if there is none."""
    if verb not in ("GETSS", "DNS", "REVERSEDNS"):
        return "Method.Unknown.Or.Can.INIT.only.once"
    if verb != "GETSS" and ports is None:
        return "Port.Must.Be.Integer"
    if verb != "REVERSEDNS" and not robot:
        return "Robot.Name.Must.Not.Be.Empty"
    return ""


class RelayPort:
    """A port of this server that forwards one robot's connections to another robot.

    Attributes:
        number: The port.
        links: Incoming connections, each with the local port of the outgoing connection
            that forwards its data to the other robot; 0 before that connection exists.
    """

    def __init__(
        self,
        addresses: Sequence[str],
        target: Callable[[], Place | None],
        rest: Callable[[], float],
    ) -> None:
        """Choose a port, but do not listen on it yet.

        Args:
            addresses: Addresses to listen on.
            target: Returns address and port of the robot to connect to; None to refuse
                the connection.
            rest: Returns the pause of a connection after each forwarded chunk, s.

        Raises:
            ServerError: If there is no free port.
        """
        self._addresses, self._target, self._rest = addresses, target, rest
        self._listeners: list[asyncio.Server] = []
        self._starting: asyncio.Task[None] | None = None
        self._is_open = False
        self.links: dict[asyncio.Task[Any], int] = {}
        with bind(addresses[0], 0) as sock:
            self.number: int = sock.getsockname()[1]

    def open(self) -> None:
        """Listen on the port; if another program uses it, a later call tries again."""
        if self._is_open:
            return
        with suppress(ServerError, OSError), ExitStack() as unless_all:
            sockets = []
            for address in self._addresses:
                sock = bind(address, self.number, only_ipv6=True)
                sockets.append(unless_all.enter_context(sock))
                # Listening must start at once, as the robot connects as soon as it has
                # the answer.
                sock.listen(MAX_WAITING)
            unless_all.pop_all()
            self._is_open = True
            self._starting = asyncio.ensure_future(self._serve(sockets))

    async def _serve(self, sockets: list[socket.socket]) -> None:
        for sock in sockets:
            listener = await asyncio.start_server(
                self._link, sock=sock, backlog=ACCEPTED_AT_ONCE
            )
            self._listeners.append(listener)
            sock.listen(MAX_WAITING)  # for the same reason as in ``listening.listen``
        if not self._is_open:  # closed in the meantime
            self.close()

    def close(self) -> None:
        """Stop listening, and close all connections through the port."""
        self._is_open = False
        while self._listeners:
            self._listeners.pop().close()
        for link in self.links:
            link.cancel()

    async def _link(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Forward data in both directions until the caller or the robot closes."""
        place = self._target() if self._is_open else None
        if place is None:
            writer.close()
            return
        configure_socket(writer.transport)
        link, writers = asyncio.current_task(), [writer]
        assert link is not None
        self.links[link] = 0
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                his_reader, his_writer = await asyncio.open_connection(*place)
            writers.append(his_writer)
            configure_socket(his_writer.transport)
            self.links[link] = his_writer.get_extra_info("sockname")[1]
            await first_of(
                self._pass_on(reader, his_writer), self._pass_on(his_reader, writer)
            )
        except OSError as error:
            log.info("no connection to %s port %d: %s", *place, error)
        finally:
            await _close_soon(writers)
            del self.links[link]

    async def _pass_on(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Forward data in one direction, with pauses, until one side closes."""
        with suppress(OSError):
            while data := await reader.read(READ_BYTES):
                writer.write(data)
                async with asyncio.timeout(STALL_TIMEOUT):
                    await writer.drain()
                await asyncio.sleep(self._rest())


async def _close_soon(writers: Sequence[asyncio.StreamWriter]) -> None:
    """Close connections after their data is sent, or after ``CLOSE_GRACE``."""
    for writer in writers:
        writer.close()
    closing = [writer.wait_closed() for writer in writers]
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_GRACE):
                await asyncio.gather(*closing, return_exceptions=True)
    finally:
        for writer in writers:
            writer.transport.abort()
