"""A server that answers queries about a simulation, one line for each query.

Rule 1: at most ``MOST_ANSWERS`` queries of all clients are answered per ``REST``, one
client after the other. The server reads from a client again when all its queries are
answered and the client has read the answers. Further data waits in the socket, so that
endless queries take little time from the simulation.
Rule 2: every line is answered. A line that is too long closes the connection, and so
does an HTTP request.

Obstacles between two positions are solid objects on the straight line between them.
Each entered volume counts as one obstacle. For opaque objects, the surfaces on the line
are counted; two surfaces of one object count as one obstacle. As in the original
server, robots do not count.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from radarsim.geometry import Pose3
from radarsim.protocol.message import LineBuffer, Triple, is_http_request
from radarsim.protocol.questions import VICTIM, answer_truth, answer_wireless
from radarsim.raycast.rays import EventKind, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.server.peer_connections import PeerConnection, PeerServer

if TYPE_CHECKING:
    from collections.abc import Callable

    from radarsim.scene.scene import Scene
    from radarsim.simulation.simulation import Simulation

log = logging.getLogger("radarsim.server")

MAX_CLIENTS: Final = 16
REST: Final = 0.01  # s; pause between two rounds of answers
MOST_ANSWERS: Final = 8  # per round; each may trace rays through many objects
LONGEST_QUESTION: Final = 1024  # characters
MOST_SURFACES: Final = 64  # limit of surfaces per query, so that each query ends
STEP: Final = 1e-3  # m behind a surface at which the ray continues
FARTHEST: Final = 1e4  # m; limit of coordinates, beyond any object of a scene


class QuestionServer(PeerServer):
    """Answers queries of all clients in round-robin order."""

    def __init__(
        self,
        answer: Callable[[str], bytes],
        *,
        port: int,
        kind: str = "query clients",
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            answer: Returns the answer to a query.
            port: Port to listen on; 0 for a free one.
            kind: Plural name of the clients for the log.
        """
        super().__init__(port, kind)
        self._answer = answer
        self._turns: deque[QuestionClient] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def _accept(self) -> QuestionClient:
        return QuestionClient(self, self._answer, keeps_blank=True)

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        if self._timer is not None:
            self._timer.cancel()
        await super().stop()

    def add_turn(self, client: QuestionClient) -> None:
        """Queue a client for its next answer."""
        if client not in self._turns:
            self._turns.append(client)
        if self._timer is None:
            self._take_turns()

    def _take_turns(self) -> None:
        count = min(len(self._turns), MOST_ANSWERS)
        loop = asyncio.get_running_loop()
        # The timer is set first, because clients with further queries queue again, and
        # add_turn must then find a timer.
        self._timer = loop.call_later(REST, self._take_turns) if count else None
        for _ in range(count):
            self._turns.popleft().take_turn()


class QuestionClient(PeerConnection):
    """The connection of one client that sends queries."""

    KIND = "query client"
    MOST = MAX_CLIENTS

    def __init__(
        self,
        server: QuestionServer,
        answer: Callable[[str], bytes],
        *,
        keeps_blank: bool,
    ) -> None:
        """Create the protocol of a connection.

        Args:
            server: The server.
            answer: Returns the answer to a query.
            keeps_blank: Whether blank lines are queries, too.
        """
        super().__init__(server)
        self._server, self._answer = server, answer
        self._lines = LineBuffer(LONGEST_QUESTION, keeps_blank=keeps_blank)
        self._questions: deque[str] = deque()
        self._has_room = True

    def _begin(self, transport: asyncio.Transport) -> None:
        transport.set_write_buffer_limits(high=0)  # writing pauses at any unsent byte

    def buffer_updated(self, nbytes: int) -> None:
        """Queue the received queries, and pause reading until they are answered."""
        if self._transport is None:
            return
        lines = self._lines.feed(bytes(self._buffer[:nbytes]))
        self._questions += lines
        fault = str(self._lines.overflow or "")
        # Any web page can make a browser on this machine send requests to this port.
        if any(map(is_http_request, lines)):
            fault = "an HTTP request, expected questions"
        if fault:
            log.warning("%s: closed: %s", self.peer, fault)
            self.close()
        else:
            self._transport.pause_reading()
            self._server.add_turn(self)

    def pause_writing(self) -> None:
        """Stop answering until the client has read its answers."""
        self._has_room = False

    def resume_writing(self) -> None:
        """Continue to answer, as the client has read all answers."""
        self._has_room = True
        self._server.add_turn(self)

    def take_turn(self) -> None:
        """Answer the next query, or resume reading if there is none."""
        if self._transport is None or not self._has_room:
            return
        if not self._questions:
            self._transport.resume_reading()
            return
        self._transport.write(self._answer(self._questions.popleft()))
        if self._has_room:
            self._server.add_turn(self)


def truth_answer(simulation: Simulation, line: str) -> bytes:
    """Return the answer of USARTruth: the poses of robots and victims."""
    actors = [(v.robot.name, v.model.name, v.robot.body) for v in simulation.vehicles]
    actors += [
        (v.name, VICTIM, Pose3(*v.position, yaw=v.yaw))
        for v in simulation.scene.victims
    ]
    return answer_truth(line, actors, simulation.time, simulation.config.dialect)


def wireless_answer(simulation: Simulation, line: str) -> bytes:
    """Return the answer to a query of a wireless server."""
    robots = [
        (v.robot.name, v.robot.body.numbers()[:3], not v.alive)
        for v in simulation.vehicles
    ]
    count = partial(count_obstacles, simulation.scene)
    return answer_wireless(line, robots, count, simulation.config.dialect)


def count_obstacles(scene: Scene, start: Triple, end: Triple) -> int:
    """Return the number of solid objects on the straight line between two positions.

    Args:
        scene: The scene.
        start: x, y, z of one end, m, map frame.
        end: x, y, z of the other end, m, map frame.
    """
    tracer, place = tracer_of(scene), np.clip(start, -FARTHEST, FARTHEST)
    offset = np.clip(end, -FARTHEST, FARTHEST) - place
    left = float(np.linalg.norm(offset))
    direction = offset / max(left, STEP)
    volumes, surfaces = 0, Counter[int]()
    while left > STEP and surfaces.total() < MOST_SURFACES:
        rays = Rays.uniform(place[None], direction[None], max_range=left)
        (events,) = tracer.explain(rays)
        solid = [each for each in events if scene.parts[each.part].material.solid]
        volumes += sum(each.kind == EventKind.ENTER for each in solid)
        last = events[-1]
        if last.kind != EventKind.HIT:
            break
        surfaces[last.part] += 1
        step = last.t + STEP
        place, left = place + step * direction, left - step
    return volumes + sum(-(-count // 2) for count in surfaces.values())
