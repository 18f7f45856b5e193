"""Which of the connections is listened to: the first one on which a scanner scans.

Probes come and go, and a panel may look on; a robot is known by its scans. When those
begin, its client has usually not yet asked where the scanner is, so all that the robot
says is kept for a moment, until the answers have passed or nobody seems to ask.
"""

import logging
import sys
import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Protocol, TypeGuard

from radarsim.client.robot_info import same_name
from radarsim.protocol.reports import RangeScan, Report
from radarsim.proxy.connection_state import ConnectionState
from radarsim.proxy.line_queue import Line, LineQueue, Side

PATIENCE: Final = 3.0  # s from the first scan for the client to ask about its scanner
MOST_SCANS: Final = 100  # in that time; some servers do not tell the time
MOST_BEFORE: Final = 200  # reports that are kept of each connection before a scan


class Consumer(Protocol):
    """What makes something of a robot's reports."""

    def take(self, report: Report) -> object:
        """Take in a report; what is returned is ignored."""


class RobotSelector:
    """Gives all that one robot says, in order, to one consumer.

    Attributes:
        chosen: The connection of the robot; None before one is.
        consumer: None until it has begun.
    """

    def __init__(
        self,
        begin: Callable[[ConnectionState, str], Consumer],
        *,
        scanner: str | None = None,
        patience: float = PATIENCE,
    ) -> None:
        """Wait for a robot.

        Args:
            begin: Called once, with the connection and the name of its scanner, when
                these are as well known as can be hoped for.
            scanner: The name of a scanner; None for whichever scans first.
            patience: How long that may take after the first scan, s of the server.
        """
        self.chosen: ConnectionState | None = None
        self.consumer: Consumer | None = None
        self._begin = begin
        self._scanner = scanner
        self._patience = patience
        self._first: RangeScan | None = None
        self._scans = 0
        self._kept: dict[int, deque[Report]] = {}
        self._waiting: list[Report] = []

    def take(self, overheard: ConnectionState, report: Report) -> None:
        """Take in what a server says on one of the connections."""
        if self._first is None and self._is_wanted(report):
            self._choose(overheard, report)
        if self._first is None:
            kept = self._kept.setdefault(overheard.number, deque(maxlen=MOST_BEFORE))
            kept.append(report)
        elif overheard is self.chosen:
            self._give(overheard, self._first, report)

    def finish(self) -> None:
        """Begin with what there is, if a robot was chosen; nothing more will come."""
        if self.consumer is not None or self.chosen is None or self._first is None:
            return
        self.consumer = self._begin(self.chosen, self._first.name)
        waiting, self._waiting = self._waiting, []
        for report in waiting:
            self.consumer.take(report)

    def _is_wanted(self, report: Report) -> TypeGuard[RangeScan]:
        if not isinstance(report, RangeScan):
            return False
        return self._scanner is None or same_name(report.name, self._scanner)

    def _choose(self, overheard: ConnectionState, first: RangeScan) -> None:
        self.chosen, self._first = overheard, first
        self._waiting = [*self._kept.get(overheard.number, ())]
        self._kept.clear()

    def _give(
        self, overheard: ConnectionState, first: RangeScan, report: Report
    ) -> None:
        if self.consumer is not None:
            self.consumer.take(report)
            return
        self._waiting.append(report)
        self._scans += isinstance(report, RangeScan)
        late = overheard.session.time - first.time >= self._patience
        if late or self._scans >= MOST_SCANS or overheard.is_described(first.name):
            self.finish()


# Section from tap.listening.
# The thread that listens, so that nobody who talks has to wait for it.
#
# The interpreter runs one thread at a time. While a listener works it lets go of it
# ten
# times as often as usual, which keeps what is forwarded meanwhile from waiting.

log = logging.getLogger("radarsim.proxy")

TURN: Final = 0.0005  # s that a thread may keep the interpreter when others want it


class TrafficObserver:
    """Understands what passes a tap, and has one robot's reports made use of.

    Attributes:
        error: What went wrong in the making; None if nothing did. Nothing is listened
            to from then on, and whatever passes, passes.
    """

    def __init__(self, choice: RobotSelector, backlog: LineQueue | None = None) -> None:
        """Make a listener that does nothing yet.

        Args:
            choice: Works in the listener's thread, with its consumer.
            backlog: None for one of the usual size.
        """
        self.error: Exception | None = None
        self._choice = choice
        self._backlog = backlog or LineQueue()
        self._overheard: dict[int, ConnectionState] = {}
        self._is_settled = False
        self._turn = 0.0
        # A consumer that hangs does not keep the process from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def dropped(self) -> int:
        """How many scans were left out because their consumer was too slow."""
        return self._backlog.dropped

    def start(self) -> None:
        """Begin to listen."""
        self._turn = sys.getswitchinterval()
        sys.setswitchinterval(min(TURN, self._turn))
        self._thread.start()

    def hear(self, number: int, side: Side, data: bytes) -> None:
        """Keep a piece of what one side says; what ``TcpProxy`` calls."""
        self._backlog.put(number, side, data)

    def finish(self, timeout: float = 30.0) -> bool:
        """Hear no more, and let what was heard be made use of.

        Args:
            timeout: Longest wait for that, s.

        Returns:
            Whether it is all done; else the consumer is still at work.
        """
        self._backlog.end()
        self._thread.join(timeout)
        sys.setswitchinterval(self._turn)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while (line := self._backlog.take()) is not None:
                self._understand(line)
            self._choice.finish()
        except Exception as error:  # noqa: BLE001 - who waits for the end is told
            self.error = error
            self._backlog.end()
            log.warning("nothing is made of what passes any more: %s", error)

    def _understand(self, line: Line) -> None:
        overheard = self._overheard.setdefault(
            line.number, ConnectionState(line.number)
        )
        if line.side == "client":
            overheard.receive_client_line(line.text)
            return
        report = overheard.receive_server_line(line.text)
        if report is not None:
            self._choice.take(overheard, report)
        if not self._is_settled and self._choice.chosen is not None:
            self._is_settled = True
            self._backlog.keep_only(self._choice.chosen.number)
            self._overheard = {self._choice.chosen.number: self._choice.chosen}
