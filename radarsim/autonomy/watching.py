"""Builds a map from the reports of a robot that another client drives.

A radarsim server allows clients to watch robots: it sends copies of the lines that it
sends to the robot's own client. If mapping is slower than the robot scans, copies
remain unread, and the server drops the oldest ones.
"""

import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing
from typing import Final, Literal, TypeAlias

from radarsim.autonomy.exploration.exploration import NOISE
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.client import ScannerInfo
from radarsim.client import session as questions
from radarsim.client.robot_info import ScannerDescriptions, same_name
from radarsim.client.session import RANGE_SCANNER, ROBOT, Question, Session
from radarsim.client.transport import SocketTransport
from radarsim.errors import ClientError, MappingError
from radarsim.geometry import Point
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import (
    CommandError,
    RangeScan,
    Report,
    WatchedLine,
    Watching,
)

ECHO_WAIT: Final = 1.0  # s for which scans wait for echoes
PATIENCE: Final = 2.0  # s without a line, after which the server is asked for the robot
MOST_EARLY: Final = 200  # reports stored until the scanner is known
_ECHOES: Final = questions.set_item(RANGE_SCANNER, None, "ECHOES", "true")

Side: TypeAlias = Literal["client", "server"]  # who sent the data
DataCallback: TypeAlias = Callable[[Side, bytes], None]


class RobotWatcher:
    """Watches one robot of another client until the robot leaves the server.

    Attributes:
        on_wait: Called once if the robot has not been spawned yet.
        robot: Name of the robot.
    """

    def __init__(
        self,
        server: tuple[str, int],
        robot: str,
        *,
        echoes: bool = True,
        patience: float = PATIENCE,
    ) -> None:
        """Create a watcher that is not yet connected.

        Args:
            server: Host and port of the server.
            robot: Name of the robot, case-insensitive; of several, the first that
                reports.
            echoes: Whether to request the echoes of its scanners.
            patience: Time without a line, after which the watcher asks the server
                whether the robot is still there, s.

        Raises:
            ValueError: If the name contains characters that cannot be sent.
        """
        self.on_wait: Callable[[], None] = lambda: None
        self.robot = robot
        self._server = server
        self._command = questions.watch(robot, echoes)
        self._patience = patience
        self._session = Session()
        self._is_watching = self._has_seen = self._has_waited = False

    def copies(self) -> Generator[list[WatchedLine], None, None]:
        """Wait until the robot is spawned, and watch it until it leaves the server.

        Yields:
            Copies of the lines of the robot, as they arrive.

        Raises:
            ClientError: If the server cannot be reached, does not support watching, or
                closes the connection.
        """
        with closing(SocketTransport(*self._server)) as transport:
            try:
                transport.send(self._command)
                has_left = False
                while not has_left:
                    copies: list[WatchedLine] = []
                    has_left = self._has_left(transport, copies)
                    yield copies
            except ConnectionError as error:
                raise ClientError(str(error)) from None

    def _has_left(self, transport: SocketTransport, copies: list[WatchedLine]) -> bool:
        """Wait for more reports; return whether the robot has left the server."""
        try:
            data = transport.receive(self._patience)
        except TimeoutError:
            if not self._is_watching:
                text = "no answer to WATCH, expected a server of radarsim"
                raise ClientError(text) from None
            # The server does not report that a robot
            # leaves, but then it rejects a GEO request.
            transport.send(self._question(questions.geometry, ROBOT))
            return False
        for report in self._session.receive(data):
            match report:
                case Watching():
                    self._is_watching = True
                    transport.send(self._question(questions.geometry, ROBOT))
                case CommandError(text):
                    # The server rejects GEO for a robot that
                    # has left, or has not been spawned yet.
                    if self._has_seen:
                        return True
                    self._wait(text)
                case WatchedLine():
                    self._begin(report, transport)
                    if report.robot == self.robot:
                        copies.append(report)
                case _:
                    pass
        return False

    def _wait(self, text: str) -> None:
        if not self._is_watching:
            raise ClientError(text)
        if not self._has_waited:
            self._has_waited = True
            self.on_wait()

    def _begin(self, copy: WatchedLine, transport: SocketTransport) -> None:
        if self._has_seen:
            return
        self._has_seen = True
        self.robot = copy.robot
        # The robot's client may never request where
        # its scanners are mounted, nor their limits.
        for ask in (questions.geometry, questions.configuration):
            transport.send(self._question(ask, RANGE_SCANNER))

    def _question(self, ask: Callable[..., Question], kind: str) -> bytes:
        return ask(kind, robot=printable_name(self.robot)).data


class WatchMapper:
    """Builds a map from the reports of a watched robot.

    Attributes:
        mapper: The mapper; None before the scanner is known.
        trip: Time and path length so far.
        error: Reason of a missing or incomplete map; empty for a complete one.
        outcome: The outcome of the run, as of an exploration.
        unreached: Always empty, since another client drives.
        safety_distance: Always None, since another client drives.
        on_data: Called with the data that the robot's client would have sent and
            received, for a recording; it must not raise.
        on_scan: Called after every scan on the map.
    """

    outcome = "watched"
    unreached: tuple[Point, ...] = ()
    safety_distance: float | None = None

    def __init__(self, plan: ExplorationPlan) -> None:
        """Create a mapper that waits for a robot.

        Args:
            plan: The scanner, by default the first that scans, whether to wait for its
                echoes, the source of the motion, and the resolution of the map.
        """
        self.mapper: Mapper | None = None
        self.trip = TripMeter(noise=NOISE)
        self.error = ""
        self.on_data: DataCallback = lambda *_: None
        self.on_scan: Callable[[], None] = lambda: None
        self._plan = plan
        self._descriptions = ScannerDescriptions()
        self._first_scan: RangeScan | None = None
        # Reports before the first scan are kept,
        # since one of them has the pose of that scan.
        self._early = deque[Report](maxlen=MOST_EARLY)

    def watch(self, watcher: RobotWatcher) -> int:
        """Map a robot's reports until it leaves, or until a signal raises SystemExit.

        Args:
            watcher: Watches the robot.

        Returns:
            The exit code: 0 if the robot has left, the code of the signal, or 1 if the
            robot cannot be watched. ``error`` is empty if the map is complete.
        """
        code = 0
        try:
            self._follow(watcher)
        except ClientError as error:
            self.error, code = str(error), 1
        except SystemExit as end:
            code = int(end.code or 0)
        if self.mapper is not None:
            self.mapper.finish()
        self.error = self.error or self._missing()
        return code

    def _follow(self, watcher: RobotWatcher) -> None:
        echoes = self._plan.echoes
        with closing(watcher.copies()) as batches:
            for copies in batches:
                # The recording contains this request for
                # echoes as if the robot's client had sent it.
                if copies and echoes:
                    self.on_data("client", _ECHOES)
                    echoes = False
                for copy in copies:
                    self.on_data("server", f"{copy.line}\r\n".encode("latin-1"))
                for report in (copy.report for copy in copies):
                    if report is not None and not self.error:
                        self._take(report)

    def _take(self, report: Report) -> None:
        if self.mapper is not None:
            self._map(self.mapper, report)
            return
        self._descriptions.add(report)
        self._early.append(report)
        plan = self._plan
        if isinstance(report, RangeScan) and (
            plan.scanner is None or same_name(report.name, plan.scanner)
        ):
            self._first_scan = self._first_scan or report
        info = self._scanner_info()
        if info is None:
            return
        self.mapper = Mapper(
            info,
            motion_source=plan.motion_source,
            resolution=plan.resolution,
            map_range=plan.map_range,
            echo_wait=ECHO_WAIT * plan.echoes,
            # used for servers whose time stamps are missing or constant
            clock=time.monotonic,
        )
        for each in self._early:
            self._map(self.mapper, each)

    def _scanner_info(self) -> ScannerInfo | None:
        """Return the robot's scanner; None before its first scan and description."""
        scan = self._first_scan
        if scan is None:
            return None
        missing = self._descriptions.incomplete([scan.name])
        if any(same_name(name, scan.name) for name in missing):
            return None
        scanners = self._descriptions.scanners({scan.name: scan})
        return next(each for each in scanners if same_name(each.name, scan.name))

    def _map(self, mapper: Mapper, report: Report) -> None:
        try:
            observation = mapper.take(report)
        except MappingError as error:
            self.error = f"the map ends early: {error}"
            return
        if observation is not None:
            self.trip.add(observation)
            self.on_scan()

    def _missing(self) -> str:
        if self.mapper is None:
            return "no map: no scan has come"
        if self.mapper.scans:
            return ""
        hint = f"; {self.mapper.hint}" * bool(self.mapper.hint)
        return f"no map: no {self.mapper.missing} has come{hint}"
