"""A server for programs that ask about a simulation, one line for each question.

Rule 1: a client is read again ``READ_PAUSE`` after its last questions, of which
``MOST_QUESTIONS`` are answered, and not before it has read the answers. What it sends
meanwhile waits in its socket, so that questions without end take little time from the
ticks.
Rule 2: every line is answered, and one that is too long closes the connection, as an
HTTP request does.
"""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING, Final

from radarsim.protocol.message import LineBuffer, is_http_request
from radarsim.server.peer_connections import PeerConnection, PeerServer, RefusalLog

if TYPE_CHECKING:
    from collections.abc import Callable

    from radarsim.server.questions import Answer
    from radarsim.simulation.simulation import Simulation

log = logging.getLogger("radarsim.server")

MAX_CLIENTS: Final = 16
MOST_QUESTIONS: Final = 4  # of a client in a pause
READ_PAUSE: Final = 0.01  # s
LONGEST_QUESTION: Final = 1024  # characters


class QuestionServer(PeerServer):
    """Answers questions about a simulation, which has no robots before it begins."""

    def __init__(self, answer: Answer, *, port: int) -> None:
        """Create a server that does not listen yet.

        Args:
            answer: Returns the answer to a question, of ``questions``.
            port: Port to listen on; 0 for a free one.
        """
        super().__init__(port)
        self._answer_question = answer
        self._clients: set[QuestionClient] = set()
        self._refusals = RefusalLog("clients that ask questions")
        self._simulation: Simulation | None = None

    def _accept(self) -> QuestionClient:
        return QuestionClient(self._clients, self._refusals, self._answer)

    async def begin(self, simulation: Simulation) -> None:
        """Answer questions about a simulation from now on."""
        self._simulation = simulation

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        self._close(self._clients)
        await asyncio.sleep(0)  # sockets are closed in the next round of the loop

    def _answer(self, line: str) -> bytes:
        return self._answer_question(self._simulation, line)


class QuestionClient(PeerConnection):
    """One connection of a client."""

    KIND = "client that asks questions"
    MOST = MAX_CLIENTS

    def __init__(
        self,
        clients: set[QuestionClient],
        refusals: RefusalLog,
        answer: Callable[[str], bytes],
    ) -> None:
        """Create the protocol of a connection.

        Args:
            clients: All clients, to which this one adds itself.
            refusals: The log of clients that are refused.
            answer: Returns the answer to a question.
        """
        super().__init__(clients, refusals)
        self._answer = answer
        self._lines = LineBuffer(LONGEST_QUESTION, keeps_blank=True)
        self._questions: list[str] = []
        self._has_room = True

    def _begin(self, transport: asyncio.Transport) -> None:
        transport.set_write_buffer_limits(high=0)  # any unread byte pauses writing

    def buffer_updated(self, nbytes: int) -> None:
        """Answer received questions, and read no more for a while."""
        lines = self._lines.feed(bytes(self._buffer[:nbytes]))
        self._questions += lines
        fault = str(self._lines.overflow or "")
        # Any page can make a browser on this machine send requests here.
        if any(map(is_http_request, lines)):
            fault = "an HTTP request, expected questions"
        if fault:
            log.warning("%s: closed: %s", self.peer, fault)
            self.close()
        if self._transport is not None:
            self._transport.pause_reading()
            self._answer_some()

    def pause_writing(self) -> None:
        """Note that answers are still to be read."""
        self._has_room = False

    def resume_writing(self) -> None:
        """Go on when all answers are read."""
        self._has_room = True
        self._go_on()

    def _answer_some(self) -> None:
        """Answer as many questions as may be, and look for more after a pause."""
        if self._transport is None or not self._has_room:
            return
        due = self._questions[:MOST_QUESTIONS]
        del self._questions[:MOST_QUESTIONS]
        self._transport.write(b"".join(map(self._answer, due)))
        if self._has_room:
            self._go_on()

    def _go_on(self) -> None:
        loop = asyncio.get_running_loop()
        loop.call_later(READ_PAUSE, self._look_for_more)

    def _look_for_more(self) -> None:
        if self._questions:
            self._answer_some()
        elif self._transport is not None:
            self._transport.resume_reading()
