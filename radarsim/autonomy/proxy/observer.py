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

The state of a connection is what its client and its server have said so far.

An observer cannot ask the server. It knows a scanner by the answers to the client's own
requests; where the client does not ask, by the defaults of the user; and otherwise by
the scans themselves.
"""

import logging
import math
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final, Protocol, TypeGuard

import numpy as np

from radarsim.autonomy.proxy.line_queue import Line, LineQueue, Side
from radarsim.client import ScannerInfo, Session
from radarsim.client.robot_info import DEFAULT_MOUNT, ScannerDescriptions, same_name
from radarsim.client.session import RANGE_SCANNER
from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.commands import (
    Command,
    Init,
    SetItem,
    parse_command,
    parse_switch,
)
from radarsim.protocol.dialect import COMPAT
from radarsim.protocol.reports import (
    ItemGeo,
    RangeScan,
    Report,
    RobotGeo,
    ScannerConf,
)

SAME_RANGES: Final = 4  # equal largest ranges in a scan that are its maximum range
ANY: Final = ""  # instead of a name: all items of a type
log = logging.getLogger("radarsim.autonomy.proxy")
PATIENCE: Final = 3.0  # s from the first scan for the client to ask about its scanner
MAX_WAITING_SCANS: Final = 100  # in that time; some servers do not send the time
MAX_EARLY_REPORTS: Final = 200  # held of each connection before its first scan
# s between switches of threads: ten times as often as usual, so that the proxy's thread
# waits less for the interpreter while the observer works.
SWITCH_INTERVAL: Final = 0.0005


@dataclass(frozen=True, slots=True)
class ScannerDefaults:
    """Properties of a scanner about which no client asks the server.

    Attributes:
        mount: Pose in the body frame; None for the origin of the body.
        max_range: m; None for the largest range that several beams of one scan have
            read, and no limit before that.
    """

    mount: Pose3 | None = None
    max_range: float | None = None


NO_DEFAULTS: Final = ScannerDefaults()


@dataclass(slots=True, eq=False)
class ConnectionState:
    """What was said on one connection.

    Attributes:
        number: Number of the connection.
        session: State by the reports of the server.
        robot: Newest INIT command; None if there was none.
        geometry: Newest geometry of the robot; None if there was none.
        skipped_lines: Number of lines of the client that are no commands.
    """

    number: int
    session: Session = field(default_factory=Session)
    robot: Init | None = None
    geometry: RobotGeo | None = None
    skipped_lines: int = 0
    _mounts: dict[str, ItemGeo] = field(default_factory=dict)
    _confs: dict[str, ScannerConf] = field(default_factory=dict)
    _max_ranges: dict[str, float] = field(default_factory=dict)
    _echoes: dict[str, bool] = field(default_factory=dict)

    def receive_server_line(self, text: str) -> Report | None:
        """Process a line of the server; return its report, or None if it is none."""
        # In Latin-1, as lines are read: any byte is a character. It is one report.
        for report in self.session.receive(text.encode("latin-1") + b"\n"):
            self._process_report(report)
            return report
        return None

    def receive_client_line(self, text: str) -> Command | None:
        """Process a line of the client; return its command, or None if it is none."""
        try:
            command = parse_command(text, COMPAT).command
        except MalformedMessage:
            self.skipped_lines += 1
            return None
        if isinstance(command, Init):
            self.robot = command
        elif isinstance(command, SetItem):
            self._process_set(command)
        return command

    def asks_for_echoes(self, scanner: str) -> bool:
        """Return whether the client has switched on the echoes of a scanner."""
        return self._echoes.get(scanner.lower(), self._echoes.get(ANY, False))

    def is_described(self, scanner: str) -> bool:
        """Return whether the server has sent the mount and the limits of a scanner."""
        key = scanner.casefold()
        return key in self._mounts and key in self._confs

    def scanner(
        self, name: str | None = None, defaults: ScannerDefaults = NO_DEFAULTS
    ) -> ScannerInfo | None:
        """Return what is known of a scanner; None before its first scan.

        Args:
            name: None for the one that scanned first.
            defaults: Properties about which the server was not asked.
        """
        scans = self.session.scans
        scan = scans.get(next(iter(scans), "") if name is None else name)
        if scan is None:
            return None
        key = scan.name.casefold()
        descriptions = ScannerDescriptions()
        descriptions.add(self._mounts.get(key) or _default_mount(scan, defaults))
        descriptions.add(self._confs.get(key) or self._default_conf(scan, defaults))
        scanners = descriptions.scanners({scan.name: scan})
        return next(each for each in scanners if same_name(each.name, scan.name))

    def _process_set(self, command: SetItem) -> None:
        is_of_scanners = command.type.lower() == RANGE_SCANNER.lower()
        if not is_of_scanners or command.opcode.upper() != "ECHOES":
            return
        with suppress(MalformedMessage):
            on = parse_switch(command.params)
            if command.name is None:
                # For all scanners: what was said of single ones before no longer holds.
                self._echoes = {ANY: on}
            else:
                self._echoes[command.name.lower()] = on

    def _process_report(self, report: Report) -> None:
        if isinstance(report, RobotGeo):
            self.geometry = report
        elif isinstance(report, ItemGeo):
            self._mounts |= {name.casefold(): report for name, _ in report.mounts}
        elif isinstance(report, ScannerConf):
            self._confs |= {name.casefold(): report for name, *_ in report.items}
        elif isinstance(report, RangeScan):
            self._infer_max_range(report)

    def _infer_max_range(self, scan: RangeScan) -> None:
        largest = float(scan.ranges.max(initial=0.0))
        # Beams without return read the maximum: then several are exactly equal.
        if np.count_nonzero(scan.ranges == largest) >= SAME_RANGES:
            self._max_ranges[scan.name] = max(
                largest, self._max_ranges.get(scan.name, 0.0)
            )

    def _default_conf(self, scan: RangeScan, defaults: ScannerDefaults) -> ScannerConf:
        max_range = defaults.max_range
        if max_range is None:
            max_range = self._max_ranges.get(scan.name, math.inf)
        item = (scan.name, max_range, 0.0, math.nan, math.nan)
        return ScannerConf(RANGE_SCANNER, (item,))


def _default_mount(scan: RangeScan, defaults: ScannerDefaults) -> ItemGeo:
    mount = defaults.mount or DEFAULT_MOUNT
    return ItemGeo(RANGE_SCANNER, ((scan.name, mount),), "")


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
        # Poses come before the first scan, and a map needs the one that belongs to it.
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
            # Or all that passes would gather, and nobody takes it.
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
            # from here on lines of other connections cost no time
            self._is_settled = True
            self._queue.keep_only(chosen.number)
            self._connections = {chosen.number: chosen}
