"""Traffic observer: parses a copy of what passes a proxy, in a thread of its own.

Every byte passes the proxy unchanged, whatever happens here: the proxy forwards data
before it passes a copy to the observer, and neither a slow consumer nor an error in one
delays or stops the traffic.

Which connection is observed
============================
The first one on which a scanner scans. Other connections, such as probes or a control
panel, come and go; a robot is recognised by its scans. When these begin, its client has
usually not yet asked where the scanner is, so all reports of the robot are held back
for a moment, until the answers have passed or no client asks.
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

log = logging.getLogger("radarsim.proxy")

PATIENCE: Final = 3.0  # s from the first scan for the client to ask about its scanner
MAX_WAITING_SCANS: Final = 100  # in that time; some servers do not send the time
MAX_EARLY_REPORTS: Final = 200  # held of each connection before its first scan
# s between switches of threads: ten times as often as usual, so that the proxy's thread
# waits less for the interpreter while the observer works.
SWITCH_INTERVAL: Final = 0.0005


class Consumer(Protocol):
    """Receives the reports of a robot."""

    def take(self, report: Report) -> object:
        """Process a report; the return value is ignored."""


class RobotSelector:
    """Passes all reports of one robot, in order, to one consumer.

    Attributes:
        chosen: Connection of the robot; None before one is chosen.
        consumer: Consumer of its reports; None before it is created.
    """

    def __init__(
        self,
        create_consumer: Callable[[ConnectionState, str], Consumer],
        *,
        scanner: str | None = None,
        patience: float = PATIENCE,
    ) -> None:
        """Wait for a robot.

        Args:
            create_consumer: Called once, with the connection and the name of its
                scanner, when as much is known of these as can be expected.
            scanner: Name of a scanner; None for the one that scans first.
            patience: Longest time that may take after the first scan, s of the server.
        """
        self.chosen: ConnectionState | None = None
        self.consumer: Consumer | None = None
        self._create_consumer = create_consumer
        self._scanner = scanner
        self._patience = patience
        self._first_scan: RangeScan | None = None
        self._scans = 0
        self._early: dict[int, deque[Report]] = {}
        self._waiting: list[Report] = []

    def take(self, connection: ConnectionState, report: Report) -> None:
        """Process a report of the server on one of the connections."""
        if self._first_scan is None and self._is_wanted(report):
            self.chosen, self._first_scan = connection, report
            self._waiting = [*self._early.get(connection.number, ())]
            self._early.clear()
        if self._first_scan is None:
            new = deque[Report](maxlen=MAX_EARLY_REPORTS)
            self._early.setdefault(connection.number, new).append(report)
        elif connection is self.chosen:
            self._pass_on(connection, self._first_scan, report)

    def finish(self) -> None:
        """Create the consumer if a robot was chosen, as no more reports will come."""
        if self.consumer is not None or self.chosen is None or self._first_scan is None:
            return
        self.consumer = self._create_consumer(self.chosen, self._first_scan.name)
        waiting, self._waiting = self._waiting, []
        for report in waiting:
            self.consumer.take(report)

    def _is_wanted(self, report: Report) -> TypeGuard[RangeScan]:
        if not isinstance(report, RangeScan):
            return False
        return self._scanner is None or same_name(report.name, self._scanner)

    def _pass_on(
        self, connection: ConnectionState, first: RangeScan, report: Report
    ) -> None:
        if self.consumer is not None:
            self.consumer.take(report)
            return
        self._waiting.append(report)
        self._scans += isinstance(report, RangeScan)
        is_late = connection.session.time - first.time >= self._patience
        has_many = self._scans >= MAX_WAITING_SCANS
        if is_late or has_many or connection.is_described(first.name):
            self.finish()


class TrafficObserver:
    """Parses the traffic of a proxy, and passes one robot's reports to a consumer.

    Attributes:
        error: Exception of the selector or the consumer, or None. After one nothing
            more is parsed; the traffic passes all the same.
    """

    def __init__(self, selector: RobotSelector, queue: LineQueue | None = None) -> None:
        """Create an observer that has not started.

        Args:
            selector: Works in the observer's thread, with its consumer.
            queue: None for one of the usual size.
        """
        self.error: Exception | None = None
        self._selector = selector
        self._queue = queue or LineQueue()
        self._connections: dict[int, ConnectionState] = {}
        self._is_settled = False
        self._switch_interval = 0.0
        # a daemon, as a consumer that hangs must not keep the process from ending
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def dropped(self) -> int:
        """Number of scans dropped because the consumer was too slow."""
        return self._queue.dropped

    def start(self) -> None:
        """Start the thread."""
        self._switch_interval = sys.getswitchinterval()
        sys.setswitchinterval(min(SWITCH_INTERVAL, self._switch_interval))
        self._thread.start()

    def add_data(self, number: int, side: Side, data: bytes) -> None:
        """Queue what one side sent; the callback of ``TcpProxy``."""
        self._queue.put(number, side, data)

    def finish(self, timeout: float = 30.0) -> bool:
        """Accept no more data, and wait until all of it is processed.

        Args:
            timeout: Longest time to wait, s.

        Returns:
            Whether all is processed; otherwise the consumer is still at work.
        """
        self._queue.end()
        self._thread.join(timeout)
        sys.setswitchinterval(self._switch_interval)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while (line := self._queue.take()) is not None:
                self._process(line)
            self._selector.finish()
        except Exception as error:  # noqa: BLE001 - reported when the observer finishes
            self.error = error
            self._queue.end()
            log.warning("nothing is made of what passes any more: %s", error)

    def _process(self, line: Line) -> None:
        new = ConnectionState(line.number)
        connection = self._connections.setdefault(line.number, new)
        if line.side == "client":
            connection.receive_client_line(line.text)
            return
        report = connection.receive_server_line(line.text)
        if report is not None:
            self._selector.take(connection, report)
        chosen = self._selector.chosen
        if not self._is_settled and chosen is not None:
            self._is_settled = True
            self._queue.keep_only(chosen.number)
            self._connections = {chosen.number: chosen}
