"""Map made of the reports of a robot that another client drives.

A server of radarsim lets robots be watched: it sends copies of the lines that the
robot's own client is sent. Where mapping is slower than the robot scans, copies are
left unread, and the server drops the oldest.
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

ECHO_WAIT: Final = 1.0  # s
PATIENCE: Final = 2.0  # s without a line, after which the robot may have left
MOST_EARLY: Final = 200  # reports that are kept until the scanner is known
_ECHOES: Final = questions.set_item(RANGE_SCANNER, None, "ECHOES", "true")

Side: TypeAlias = Literal["client", "server"]  # that sends
DataCallback: TypeAlias = Callable[[Side, bytes], None]


class RobotWatcher:
    """Watches one robot until it leaves.

    Attributes:
        on_wait: Called once if the robot is not there yet.
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
        """Create a watcher that is not connected.

        Args:
            server: Host and port of the server.
            robot: Name of the robot, in any case; of several, the first that reports.
            echoes: Whether its scanners shall list their echoes.
            patience: Time without a line after which the server is asked whether the
                robot is there, s.

        Raises:
            ValueError: If the name cannot be sent.
        """
        self.on_wait: Callable[[], None] = lambda: None
        self.robot = robot
        self._server = server
        self._command = questions.watch(robot, echoes)
        self._patience = patience
        self._session = Session()
        self._is_watching = self._has_seen = self._has_waited = False

    def copies(self) -> Generator[list[WatchedLine], None, None]:
        """Watch until the robot leaves, if it has been there.

        Yields:
            Copies of the lines of the robot, as they come.

        Raises:
            ClientError: If the server is not there, does not let robots be watched, or
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
        """Wait for the next reports; return whether they say that the robot left."""
        try:
            data = transport.receive(self._patience)
        except TimeoutError:
            if not self._is_watching:
                text = "no answer to WATCH, expected a server of radarsim"
                raise ClientError(text) from None
            # No line reports that a robot leaves: GEO is refused once it has.
            transport.send(self._question(questions.geometry, ROBOT))
            return False
        for report in self._session.receive(data):
            match report:
                case Watching():
                    self._is_watching = True
                    transport.send(self._question(questions.geometry, ROBOT))
                case CommandError(text):
                    # GEO of a robot that is not there is refused: it has left, or it
                    # has not come yet.
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
        # What its own client may never ask: mount and limits of its scanners.
        for ask in (questions.geometry, questions.configuration):
            transport.send(self._question(ask, RANGE_SCANNER))

    def _question(self, ask: Callable[..., Question], kind: str) -> bytes:
        return ask(kind, robot=printable_name(self.robot)).data


class WatchMapper:
    """Maps what a robot of radarsim reports.

    Attributes:
        mapper: The mapper; None before the scanner is known.
        trip: Time and path length so far.
        error: Why there is no map, or only a part of it; empty if there is one.
        outcome: How the run ends, as that of an exploration.
        unreached: No places, since another client drives.
        safety_distance: None, likewise.
        on_data: Called with what the robot's client would have sent and was sent, for a
            recording; it must not raise.
        on_scan: Called after every scan that is on the map.
    """

    outcome = "watched"
    unreached: tuple[Point, ...] = ()
    safety_distance: float | None = None

    def __init__(self, plan: ExplorationPlan) -> None:
        """Create a mapper that waits for a robot.

        Args:
            plan: The scanner, by default the first that scans, whether it lists its
                echoes, for which scans wait, the source of its motion, and the map's
                cells.
        """
        self.mapper: Mapper | None = None
        self.trip = TripMeter(noise=NOISE)
        self.error = ""
        self.on_data: DataCallback = lambda *_: None
        self.on_scan: Callable[[], None] = lambda: None
        self._plan = plan
        self._descriptions = ScannerDescriptions()
        self._first_scan: RangeScan | None = None
        # Poses come before the first scan, and a map needs the one that belongs to it.
        self._early = deque[Report](maxlen=MOST_EARLY)

    def watch(self, watcher: RobotWatcher) -> int:
        """Map what a robot reports, until it leaves or a signal raises SystemExit.

        Args:
            watcher: Watches the robot.

        Returns:
            The exit code: 0 if the robot has left, that of the signal, or 1 if it
            cannot be watched. ``error`` is the reason if there is no map.
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
                # As if its client had asked, for recordings.
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
            # for servers whose time stamps are missing or stand still
            clock=time.monotonic,
        )
        for each in self._early:
            self._map(self.mapper, each)

    def _scanner_info(self) -> ScannerInfo | None:
        """Return the scanner once it has scanned and the server has described it."""
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
