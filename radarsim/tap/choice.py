"""Which of the connections is listened to: the first one on which a scanner scans.

Probes come and go, and a panel may look on; a robot is known by its scans. When those
begin, its client has usually not yet asked where the scanner is, so all that the robot
says is kept for a moment, until the answers have passed or nobody seems to ask.
"""

from collections import deque
from collections.abc import Callable
from typing import Final, Protocol, TypeGuard

from radarsim.client.facts import same_name
from radarsim.protocol.reports import RangeScan, Report
from radarsim.tap.overheard import Overheard

PATIENCE: Final = 3.0  # s from the first scan for the client to ask about its scanner
MOST_SCANS: Final = 100  # in that time; some servers do not tell the time
MOST_BEFORE: Final = 200  # reports that are kept of each connection before a scan


class Consumer(Protocol):
    """What makes something of a robot's reports."""

    def take(self, report: Report) -> object:
        """Take in a report; what is returned is ignored."""


class Choice:
    """Gives all that one robot says, in order, to one consumer.

    Attributes:
        chosen: The connection of the robot; None before one is.
        consumer: None until it has begun.
    """

    def __init__(
        self,
        begin: Callable[[Overheard, str], Consumer],
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
        self.chosen: Overheard | None = None
        self.consumer: Consumer | None = None
        self._begin = begin
        self._scanner = scanner
        self._patience = patience
        self._first: RangeScan | None = None
        self._scans = 0
        self._kept: dict[int, deque[Report]] = {}
        self._waiting: list[Report] = []

    def take(self, overheard: Overheard, report: Report) -> None:
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

    def _choose(self, overheard: Overheard, first: RangeScan) -> None:
        self.chosen, self._first = overheard, first
        self._waiting = [*self._kept.get(overheard.number, ())]
        self._kept.clear()

    def _give(self, overheard: Overheard, first: RangeScan, report: Report) -> None:
        if self.consumer is not None:
            self.consumer.take(report)
            return
        self._waiting.append(report)
        self._scans += isinstance(report, RangeScan)
        late = overheard.session.time - first.time >= self._patience
        if late or self._scans >= MOST_SCANS or overheard.is_described(first.name):
            self.finish()
