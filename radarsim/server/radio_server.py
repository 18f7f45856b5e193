"""A wireless server (WSS), through which robots talk that hear each other.

Theory of operation
===================
A robot registers with its name and the ports on which its program listens. Another one
asks for a port at which it reaches the first, and connects to that: its bytes are
passed on, in both directions, as long as the signal between the two is strong enough.
When it is not, which is looked at in each ``LOOK_INTERVAL``, all that they have to each
other is closed, and the port is open again when it is.

Rule 1: a program is only connected to at the address from which it registered.
Rule 2: a robot whose battery is empty, or that has left, is closed; one that is not
there yet only hears nobody.
Rule 3: a robot that reads slowly does not fill the memory: what comes for it waits at
its sender.
Rule 4: few requests are answered in a ``REST``, of the robots in turns, and relay ports
are looked at one after the other, so that ticks are on time whatever is asked.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from radarsim.errors import ServerError
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.message import LineBuffer, is_http_request
from radarsim.protocol.radio import (
    CUTOFF,
    RadioRequest,
    signal_strength,
    strength_text,
)
from radarsim.server.peer_connections import PeerConnection, PeerServer, RefusalLog
from radarsim.server.questions import count_obstacles
from radarsim.server.radio_links import REST, Place, RelayPort

if TYPE_CHECKING:
    from collections.abc import Callable

    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle

log = logging.getLogger("radarsim.server")

MAX_ROBOTS: Final = 32
MAX_RELAYS: Final = 128  # ports of all pairs
MAX_LINKS: Final = 64  # connections through all of them
MAX_REQUESTS: Final = 1000  # of a robot that wait; one that sends more is closed
LOOK_INTERVAL: Final = 1.0  # s, as the original
LONGEST_REQUEST: Final = 1024  # characters
MOST_ANSWERS: Final = 8  # in a ``REST``; each may trace rays through many objects
UNHURRIED_LINKS: Final = 8  # that rest for as short as one alone


class RadioServer(PeerServer):
    """Listens to robots; ``begin`` tells it where they are."""

    def __init__(self, *, port: int) -> None:
        """Create a server that does not listen yet; port 0 is a free one."""
        super().__init__(port)
        self.robots: dict[str, RadioClient] = {}
        self._clients: set[RadioClient] = set()
        self._refusals = RefusalLog("robots that talk")
        self._relays: dict[tuple[str, str, int], RelayPort] = {}
        self._simulation: Simulation | None = None
        self._seen: set[str] = set()  # names of robots that were there
        self._looking: asyncio.TimerHandle | None = None
        self._turns: deque[RadioClient] = deque()
        self._answering: asyncio.TimerHandle | None = None

    def _accept(self) -> RadioClient:
        return RadioClient(self._clients, self._refusals, self)

    async def begin(self, simulation: Simulation) -> None:
        """Look where the robots of a simulation are from now on."""
        self._simulation = simulation
        self._look()

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        for timer in filter(None, (self._looking, self._answering)):
            timer.cancel()
        self._close(self._clients)
        await asyncio.sleep(0)  # sockets are closed in the next round of the loop

    def add_turn(self, client: RadioClient) -> None:
        """Let a robot have its next request answered when it is its turn."""
        self._turns.append(client)
        if self._answering is None:
            self._answer_some()

    def _answer_some(self) -> None:
        count = min(len(self._turns), MOST_ANSWERS)
        loop = asyncio.get_running_loop()
        # Before the answers: robots that have further requests take their next turns.
        self._answering = loop.call_later(REST, self._answer_some) if count else None
        for _ in range(count):
            self._turns.popleft().answer_next()

    def strength(self, one: str, other: str) -> float | None:
        """Return the strength of the signal, dBm; None if a robot is not there."""
        present = self._present()
        if self._simulation is None or not {one, other} <= present.keys():
            return None
        places = [present[each].robot.body.numbers()[:3] for each in (one, other)]
        start, end = sorted(places)
        count = count_obstacles(self._simulation.scene, start, end)
        return signal_strength(math.dist(start, end), count)

    def hears(self, one: str, other: str) -> bool:
        """Return whether two robots hear each other."""
        strength = self.strength(one, other)
        return strength is not None and strength >= CUTOFF

    def relay_port(self, source: str, target: str, port: int) -> int | None:
        """Return the port at which one robot reaches a port of another, if any."""
        key = source, target, port
        if key not in self._relays:
            if len(self._relays) >= MAX_RELAYS:
                return None
            with suppress(ServerError):
                self._relays[key] = RelayPort(
                    self.addresses, self._connect_to(target, port), self._rest
                )
        if key not in self._relays:
            return None
        if self.hears(source, target):
            self._relays[key].open()
        return self._relays[key].number

    def caller(self, target: str, port: int) -> str | None:
        """Return who reaches a robot from a port of this server."""
        for (source, to, _), relay in self._relays.items():
            if to == target and port in relay.outgoing_ports:
                return source
        return None

    def _connect_to(self, target: str, port: int) -> Callable[[], Place | None]:
        """Return a function that returns where to connect to; None if it may not."""

        def place() -> Place | None:
            robot = self.robots.get(target)
            has_room = self._count_links() < MAX_LINKS
            return (robot.address, port) if robot and has_room else None

        return place

    def _count_links(self) -> int:
        return sum(len(relay.links) for relay in self._relays.values())

    def _rest(self) -> float:
        """Return how long a link rests after each piece, s."""
        return REST * max(1.0, self._count_links() / UNHURRIED_LINKS)

    def forget(self, name: str) -> None:
        """Close all relay ports of a robot that has gone."""
        self.robots.pop(name, None)
        for key in [each for each in self._relays if name in each[:2]]:
            self._relays.pop(key).close()

    def _present(self) -> dict[str, Vehicle]:
        """Return the robots whose batteries are not empty, by their names."""
        vehicles = () if self._simulation is None else self._simulation.vehicles
        return {v.robot.name: v for v in vehicles if v.alive}

    def _look(self) -> None:
        """Open or close a relay port by what is heard now, and look at the next later.

        Robots that have gone are closed.
        """
        present = self._present()
        self._seen |= present.keys() & self.robots.keys()
        for name in self._seen - present.keys():
            self._seen.discard(name)
            if name in self.robots:
                client = self.robots[name]
                log.info("%s: %s has gone", client.peer, printable_name(name))
                client.close()
        for key in list(self._relays)[:1]:
            relay = self._relays[key] = self._relays.pop(key)  # as the last one
            if self.hears(*key[:2]):
                relay.open()
            else:
                relay.close()
        loop = asyncio.get_running_loop()
        interval = LOOK_INTERVAL / max(1, len(self._relays))
        self._looking = loop.call_later(interval, self._look)


class RadioClient(PeerConnection):
    """The connection on which a robot registers and asks."""

    KIND = "robot that talks"
    MOST = MAX_ROBOTS

    def __init__(
        self, clients: set[RadioClient], refusals: RefusalLog, server: RadioServer
    ) -> None:
        """Create the protocol of a connection; arguments as of ``PeerConnection``."""
        super().__init__(clients, refusals)
        self._server = server
        self._lines = LineBuffer(LONGEST_REQUEST)
        self._requests: deque[str] = deque()
        self._has_room = True
        self._has_turn = False
        self.name, self.address = "", ""
        self.ports: tuple[int, ...] = ()

    def _begin(self, transport: asyncio.Transport) -> None:
        transport.set_write_buffer_limits(high=0)
        self.address = transport.get_extra_info("peername")[0]

    def buffer_updated(self, nbytes: int) -> None:
        """Let requests wait for their turns, and read no more for a while."""
        lines = self._lines.feed(bytes(self._buffer[:nbytes]))
        self._requests += lines
        fault = str(self._lines.overflow or "")
        if len(self._requests) > MAX_REQUESTS:
            fault = "a flood"
        # Any page can make a browser on the machine of robots send requests here.
        if any(map(is_http_request, lines)):
            fault = "an HTTP request"
        if fault:
            log.warning("%s: closed: %s", self.peer, fault)
            self.close()
        if self._transport is not None:
            self._transport.pause_reading()
            asyncio.get_running_loop().call_later(REST, self._read_on)
            self._ask_for_turn()

    def _read_on(self) -> None:
        if self._transport is not None:
            self._transport.resume_reading()

    def pause_writing(self) -> None:
        """Note that answers are still to be read."""
        self._has_room = False

    def resume_writing(self) -> None:
        """Go on when all answers are read."""
        self._has_room = True
        self._ask_for_turn()

    def _ask_for_turn(self) -> None:
        if self._requests and self._has_room and not self._has_turn:
            self._has_turn = True
            self._server.add_turn(self)

    def answer_next(self) -> None:
        """Answer a request, and let the next one wait for its turn."""
        self._has_turn = False
        if self._transport is None:
            return
        reply = self._answer(RadioRequest.decode(self._requests.popleft()))
        self._transport.write(f"{reply}\r\n".encode("ascii", "replace"))
        self._ask_for_turn()

    def _answer(self, request: RadioRequest) -> str:
        if not self.name:
            return self._register(request)
        fault = _fault_of(request)
        if fault:
            return f"ERROR {{Reason {fault}}}"
        answers = {
            "GETSS": self._tell_strength,
            "DNS": self._reach,
            "REVERSEDNS": self._tell_caller,
        }
        return answers[request.verb](request)

    def _tell_strength(self, request: RadioRequest) -> str:
        robot = f"SS {{Robot {printable_name(request.robot)}}}"
        if request.robot == self.name:
            return f"{robot} {{Strength INF}} {{Error SS.To.Self}}"
        if request.robot not in self._server.robots:
            return f"{robot} {{Strength NaN}} {{Error Robot.Does.Not.Exist}}"
        strength = self._server.strength(self.name, request.robot)
        return f"{robot} {strength_text(strength)}"

    def _tell_caller(self, request: RadioRequest) -> str:
        port = (request.ports or (0,))[0]
        name = self._server.caller(self.name, port)
        who = "Error UnknownOrIllegalPort"
        if name is not None:
            who = f"Robot {printable_name(name)}"
        return f"REVERSEDNSREPLY {{Port {port}}} {{{who}}}"

    def _register(self, request: RadioRequest) -> str:
        if request.verb != "INIT":
            return "ERROR {Reason Must.Use.INIT.Method.First}"
        if request.ports is None:
            return "ERROR {Reason Ports.List.Must.Be.Integer}"
        if not request.robot:
            return "ERROR {Reason Robot.Name.Must.Not.Be.Empty}"
        if request.robot in self._server.robots:
            return "ERROR {Reason Robot.Alread.Exists}"  # as the original spells it
        self.name, self.ports = request.robot, request.ports
        self._server.robots[self.name] = self
        log.info("%s: is %s", self.peer, printable_name(self.name))
        return "INITREPLY {Status OK}"

    def _reach(self, request: RadioRequest) -> str:
        """Answer how another robot is reached."""
        other = self._server.robots.get(request.robot)
        robot, ports = printable_name(request.robot), request.ports or ()
        if other is None or other is self:
            error = "NoSuchRobot"
        elif not (ports or other.ports) or (ports and ports[0] not in other.ports):
            error = "RobotDoesNotListenOnThisPort"
        else:
            wanted = (ports or other.ports)[0]
            number = self._server.relay_port(self.name, request.robot, wanted)
            if number is None:
                return "ERROR {Reason Could.Not.Allocate.Port}"
            return f"DNSREPLY {{Robot {robot}}} {{Port {number}}}"
        return f"DNSREPLY {{Robot {robot}}} {{Port -1}} {{Error {error}}}"

    def _forget(self) -> None:
        super()._forget()
        if self.name:
            self._server.forget(self.name)


def _fault_of(request: RadioRequest) -> str:
    """Return what is wrong with a request of a registered robot, in one word."""
    if request.verb not in ("GETSS", "DNS", "REVERSEDNS"):
        return "Method.Unknown.Or.Can.INIT.only.once"
    if request.verb != "GETSS" and request.ports is None:
        return "Port.Must.Be.Integer"
    if request.verb != "REVERSEDNS" and not request.robot:
        return "Robot.Name.Must.Not.Be.Empty"
    return ""
