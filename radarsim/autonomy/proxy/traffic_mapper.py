"""Map made of the reports of a robot that another client drives.

Its reports are those that pass a proxy, or, of a robot of radarsim, those that it lets
be watched: then nobody is in between, and an observer gets the lines that the robot's
own client is sent.
"""

import asyncio
import math
import time
from collections.abc import Callable
from typing import Any, Final

from radarsim.autonomy.exploration.exploration import NOISE
from radarsim.autonomy.mapping.mapper import Mapper, MapperSettings
from radarsim.autonomy.mapping.slam import SlamSettings
from radarsim.autonomy.navigation.plans import MotionSource
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.proxy.line_queue import Side
from radarsim.autonomy.proxy.observer import (
    NO_DEFAULTS,
    ConnectionState,
    RobotSelector,
    ScannerDefaults,
    TrafficObserver,
)
from radarsim.autonomy.proxy.tcp_proxy import (
    DataCallback,
    TcpProxy,
    forward_until_signal,
)
from radarsim.client import session as questions
from radarsim.client.session import RANGE_SCANNER, ROBOT, Question, Session
from radarsim.client.transport import CHUNK, lost, no_server
from radarsim.errors import ClientError
from radarsim.listening import exit_code_of_signal
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import CommandError, Report, WatchedLine, Watching

ECHO_WAIT: Final = 1.0  # s
PATIENCE: Final = 2.0  # s without a line, after which the robot may have left
NUMBER: Final = 1  # of the only connection
_ECHOES: Final = questions.set_item(RANGE_SCANNER, None, "ECHOES", "true")


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
        on_data: DataCallback,
        *,
        echoes: bool = True,
        patience: float = PATIENCE,
    ) -> None:
        """Create a watcher that is not connected.

        Args:
            server: Host and port of the server.
            robot: Name of the robot, in any case; of several, the first that reports.
            on_data: Called with the lines of the robot as with those of a server, and
                with what its client would have sent; must not raise or block.
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
        self._on_data = on_data
        self._echoes = echoes
        self._patience = patience
        self._session = Session()
        self._is_watching = self._has_seen = self._has_waited = False

    async def run(self) -> None:
        """Watch until the robot leaves, if it has been there.

        Raises:
            ClientError: If the server is not there, does not let robots be watched, or
                closes the connection.
        """
        try:
            reader, writer = await asyncio.open_connection(*self._server)
        except (OSError, UnicodeError) as error:
            raise no_server(*self._server, error) from None
        try:
            writer.write(self._command)
            while not self._has_left(await self._reports(reader), writer):
                pass
        finally:
            writer.close()

    async def _reports(self, reader: asyncio.StreamReader) -> list[Report] | None:
        """Return the next reports; None if nothing has come for a while."""
        try:
            async with asyncio.timeout(self._patience):
                data = await reader.read(CHUNK)
        except TimeoutError:
            return None
        except OSError as error:
            raise ClientError(str(lost(error))) from None
        if not data:
            raise ClientError("the server closed the connection")
        return self._session.receive(data)

    def _has_left(
        self, reports: list[Report] | None, writer: asyncio.StreamWriter
    ) -> bool:
        if reports is None:
            if not self._is_watching:
                raise ClientError("no answer to WATCH, expected a server of radarsim")
            # No line tells that a robot leaves: GEO is refused once it has.
            writer.write(self._question(questions.geometry, ROBOT))
        for report in reports or ():
            match report:
                case Watching():
                    self._is_watching = True
                    writer.write(self._question(questions.geometry, ROBOT))
                case CommandError(text):
                    # GEO of a robot that is not there is refused: it has left, or it
                    # has not come yet.
                    if self._has_seen:
                        return True
                    self._wait(text)
                case WatchedLine():
                    self._pass_on(report, writer)
                case _:
                    pass
        return False

    def _wait(self, text: str) -> None:
        if not self._is_watching:
            raise ClientError(text)
        if not self._has_waited:
            self._has_waited = True
            self.on_wait()

    def _pass_on(self, copy: WatchedLine, writer: asyncio.StreamWriter) -> None:
        if not self._has_seen:
            self._has_seen = True
            self.robot = copy.robot
            if self._echoes:
                # As if its client had asked: scans wait for their echoes then.
                self._on_data(NUMBER, "client", _ECHOES)
            # What its own client may never ask: mount and limits of its scanners.
            for ask in (questions.geometry, questions.configuration):
                writer.write(self._question(ask, RANGE_SCANNER))
        if copy.robot == self.robot:
            self._on_data(NUMBER, "server", f"{copy.line}\r\n".encode("latin-1"))

    def _question(self, ask: Callable[..., Question], kind: str) -> bytes:
        return ask(kind, robot=printable_name(self.robot)).data


async def watch_until_signal(watcher: RobotWatcher) -> int:
    """Watch a robot until it leaves, or a signal comes.

    Returns:
        Exit code: 0 if the robot has left, or after a request to terminate; 130 after
        an interrupt.

    Raises:
        ClientError: If the robot cannot be watched.
    """
    with exit_code_of_signal() as exit_code:
        watching = asyncio.ensure_future(watcher.run())
        both: set[asyncio.Future[Any]] = {watching, exit_code}
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        if exit_code.done():
            watching.cancel()
            # Until its connection is closed.
            await asyncio.wait({watching})
            return exit_code.result()
        watching.result()  # raises its error
        return 0


class TrafficMapper:
    """Maps what the first robot that scans sends; a ``Consumer`` of its reports.

    Attributes:
        mapper: The mapper; None before a robot was selected.
        motion_source: Where the motion between scans is read from.
        trip: Time and path length so far.
        dropped: Number of scans that were left out, as mapping fell behind.
        error: Why there is no map, or only a part of it; empty if there is one.
        on_data: Called with what passes, for a recording; it must not raise.
        on_scan: Called after every scan that is on the map, in the observer's thread.
        on_guess: Called with the name of a scanner whose mount and limits no client has
            asked the server for, and for which no defaults are set.
    """

    def __init__(
        self,
        *,
        motion_source: MotionSource,
        resolution: float,
        map_range: float = math.inf,
        scanner: str | None = None,
        defaults: ScannerDefaults = NO_DEFAULTS,
    ) -> None:
        """Create a mapper that waits for a robot.

        Args:
            motion_source: Where the motion between scans is read from.
            resolution: Side of a cell, m.
            map_range: Range of the scanner that is mapped, m.
            scanner: Name of the scanner to map with; the first that scans by default.
            defaults: Mount and maximum range, where no client asks the server for them.
        """
        self.mapper: Mapper | None = None
        self.trip = TripMeter(noise=NOISE)
        self.dropped = 0
        self.error = ""
        self.on_data: DataCallback | None = None
        self.on_scan: Callable[[], None] = lambda: None
        self.on_guess: Callable[[str], None] = lambda _: None
        self.motion_source: MotionSource = motion_source
        self._resolution = resolution
        self._map_range = map_range
        self._scanner = scanner
        self._defaults = defaults

    def run(
        self,
        server: tuple[str, int],
        listen: tuple[str, int],
        announce: Callable[[tuple[str, int]], None],
    ) -> int:
        """Forward between clients and a server until a signal comes; map what passes.

        Args:
            server: Host and port of the server.
            listen: Address and port to listen on; port 0 for a free one.
            announce: Called with the address as soon as clients can connect.

        Returns:
            The exit code that the signal asks for; ``error`` tells whether there is
            a map.

        Raises:
            ServerError: If the port is taken.
        """

        def forward(on_data: DataCallback) -> int:
            proxy = TcpProxy(server, on_data)
            return asyncio.run(forward_until_signal(proxy, *listen, announce))

        return self._observe(forward)

    def watch(
        self,
        server: tuple[str, int],
        robot: str,
        on_wait: Callable[[], None],
        *,
        echoes: bool,
    ) -> int:
        """Map what a robot of radarsim reports, until it leaves or a signal comes.

        Args:
            server: Host and port of the server.
            robot: Name of the robot.
            on_wait: Called if the robot is not there yet.
            echoes: Whether its scanners shall list their echoes.

        Returns:
            The exit code; ``error`` tells whether there is a map.

        Raises:
            ValueError: If the name cannot be sent.
        """
        reason = ""

        def follow(on_data: DataCallback) -> int:
            nonlocal reason
            watcher = RobotWatcher(server, robot, on_data, echoes=echoes)
            watcher.on_wait = on_wait
            try:
                return asyncio.run(watch_until_signal(watcher))
            except ClientError as error:
                reason = str(error)
                return 1

        code = self._observe(follow)
        self.error = reason or self.error
        return code

    async def follow(
        self, server: tuple[str, int], robot: str, *, echoes: bool
    ) -> None:
        """Map what a robot of radarsim reports, until it leaves.

        Args:
            server: Host and port of the server.
            robot: Name of the robot; it may come later.
            echoes: Whether its scanners shall list their echoes.

        Raises:
            ClientError: If the connection is lost, or the server lets nobody watch.
            ValueError: If the name cannot be sent.
        """
        observer = TrafficObserver(RobotSelector(self.begin, scanner=self._scanner))
        watcher = RobotWatcher(server, robot, observer.add_data, echoes=echoes)
        observer.start()
        try:
            await watcher.run()
        finally:
            # It may take seconds, in which the event loop has to go on.
            await asyncio.to_thread(observer.finish)

    def _observe(self, run: Callable[[DataCallback], int]) -> int:
        observer = TrafficObserver(RobotSelector(self.begin, scanner=self._scanner))
        observer.start()
        record = self.on_data

        def pass_on(number: int, side: Side, data: bytes) -> None:
            observer.add_data(number, side, data)
            if record is not None:
                record(number, side, data)

        try:
            code = run(pass_on)
        finally:
            is_finished = observer.finish()
            self.dropped = observer.dropped
            self.error = self._fault(observer, is_finished=is_finished)
            if not is_finished:  # the thread may still change it
                self.mapper = None
            elif self.mapper is not None:
                self.mapper.finish()
        return code

    def begin(self, connection: ConnectionState, scanner: str) -> "TrafficMapper":
        """Start the map with the scans of one scanner."""
        info = connection.scanner(scanner, self._defaults)
        assert info is not None  # a robot is selected by its first scan
        if not connection.is_described(scanner) and self._defaults == NO_DEFAULTS:
            self.on_guess(scanner)
        echoes = connection.asks_for_echoes(scanner)
        settings = MapperSettings(
            slam=SlamSettings(motion_source=self.motion_source),
            resolution=self._resolution,
            map_range=self._map_range,
            echo_wait=ECHO_WAIT if echoes else 0.0,
        )
        # The clock is for servers whose time stamps are missing or stand still.
        self.mapper = Mapper(info, settings, clock=time.monotonic)
        return self

    def take(self, report: Report) -> None:
        """Add a report of the robot."""
        assert self.mapper is not None
        observation = self.mapper.take(report)
        if observation is not None:
            self.trip.add(observation)
            self.on_scan()

    def _fault(self, observer: TrafficObserver, *, is_finished: bool) -> str:
        if observer.error is not None:
            return f"the map ends early: {observer.error}"
        if not is_finished:
            return "no map: what had passed was still being read after 30 s"
        if self.mapper is None:
            return "no map: no scan has passed"
        if self.mapper.scans:
            return ""
        cure = f"; {self.mapper.cure}" * bool(self.mapper.cure)
        return f"no map: no {self.mapper.missing} has passed{cure}"
