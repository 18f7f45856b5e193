"""A server for programs that ask about a simulation, one line for each question.

Rule 1: few questions of all clients together are answered in a ``REST``, of the clients
in turns. A client is read again when its questions are answered, and when it has read
the answers. What it sends meanwhile waits in its socket, so that questions without end
take little time from the ticks.
Rule 2: every line is answered, and one that is too long closes the connection, as an
HTTP request does.

Obstacles between two places are counted as bodies that stop robots: a ray from one to
the other enters volumes, and meets opaque surfaces; two of the same body are one
obstacle. Robots do not count, as in the original.
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
REST: Final = 0.01  # s
MOST_ANSWERS: Final = 8  # in a ``REST``; each may trace rays through many objects
LONGEST_QUESTION: Final = 1024  # characters
MOST_SURFACES: Final = 64  # that a ray goes through, so that a question ends
STEP: Final = 1e-3  # m behind a surface where a ray goes on
FARTHEST: Final = 1e4  # m; nothing of a scene is that far away


class QuestionServer(PeerServer):
    """Answers questions, those of all clients in turns."""

    def __init__(
        self,
        answer: Callable[[str], bytes],
        *,
        port: int,
        kind: str = "clients that ask questions",
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            answer: Returns the answer to a question.
            port: Port to listen on; 0 for a free one.
            kind: What the clients are, for the log.
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
        """Let a client go on when it is its turn."""
        if client not in self._turns:
            self._turns.append(client)
        if self._timer is None:
            self._take_turns()

    def _take_turns(self) -> None:
        count = min(len(self._turns), MOST_ANSWERS)
        loop = asyncio.get_running_loop()
        # Before the turns: clients that have further questions take their next ones.
        self._timer = loop.call_later(REST, self._take_turns) if count else None
        for _ in range(count):
            self._turns.popleft().take_turn()


class QuestionClient(PeerConnection):
    """One connection of a client."""

    KIND = "client that asks questions"
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
            answer: Returns the answer to a question.
            keeps_blank: Whether blank lines are questions, too.
        """
        super().__init__(server)
        self._server, self._answer = server, answer
        self._lines = LineBuffer(LONGEST_QUESTION, keeps_blank=keeps_blank)
        self._questions: deque[str] = deque()
        self._has_room = True

    def _begin(self, transport: asyncio.Transport) -> None:
        transport.set_write_buffer_limits(high=0)  # any unread byte pauses writing

    def buffer_updated(self, nbytes: int) -> None:
        """Answer received questions, and read no more until that is done."""
        if self._transport is None:
            return
        lines = self._lines.feed(bytes(self._buffer[:nbytes]))
        self._questions += lines
        fault = str(self._lines.overflow or "")
        # Any page can make a browser on this machine send requests here.
        if any(map(is_http_request, lines)):
            fault = "an HTTP request, expected questions"
        if fault:
            log.warning("%s: closed: %s", self.peer, fault)
            self.close()
        else:
            self._transport.pause_reading()
            self._server.add_turn(self)

    def pause_writing(self) -> None:
        """Note that answers are still to be read."""
        self._has_room = False

    def resume_writing(self) -> None:
        """Go on when all answers are read."""
        self._has_room = True
        self._server.add_turn(self)

    def take_turn(self) -> None:
        """Answer a question, or look for more if there is none."""
        if self._transport is None or not self._has_room:
            return
        if not self._questions:
            self._transport.resume_reading()
            return
        self._transport.write(self._answer(self._questions.popleft()))
        if self._has_room:
            self._server.add_turn(self)


def truth_answer(simulation: Simulation, line: str) -> bytes:
    """Return the answer of USARTruth: where robots and victims are."""
    actors = [(v.robot.name, v.model.name, v.robot.body) for v in simulation.vehicles]
    actors += [
        (v.name, VICTIM, Pose3(*v.position, yaw=v.yaw))
        for v in simulation.scene.victims
    ]
    return answer_truth(line, actors, simulation.time, simulation.config.dialect)


def wireless_answer(simulation: Simulation, line: str) -> bytes:
    """Return the answer to a question of a wireless server."""
    robots = [
        (v.robot.name, v.robot.body.numbers()[:3], not v.alive)
        for v in simulation.vehicles
    ]
    count = partial(count_obstacles, simulation.scene)
    return answer_wireless(line, robots, count, simulation.config.dialect)


def count_obstacles(scene: Scene, start: Triple, end: Triple) -> int:
    """Return how many bodies are on the straight line between two places."""
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
