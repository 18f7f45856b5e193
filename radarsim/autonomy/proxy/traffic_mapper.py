"""Map made of the reports of a robot that another client drives."""

import asyncio
import math
import time
from collections.abc import Callable

from radarsim.autonomy.exploration.exploration import NOISE
from radarsim.autonomy.mapping.mapper import Mapper, MapperSettings
from radarsim.autonomy.mapping.slam import MotionSource, SlamSettings
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.proxy.line_queue import Side
from radarsim.autonomy.proxy.observer import (
    NO_DEFAULTS,
    ConnectionState,
    RobotSelector,
    ScannerDefaults,
    TrafficObserver,
)
from radarsim.autonomy.proxy.robot_watcher import RobotWatcher, watch_until_signal
from radarsim.autonomy.proxy.tcp_proxy import (
    DataCallback,
    TcpProxy,
    forward_until_signal,
)
from radarsim.errors import ClientError
from radarsim.protocol.reports import Report

ECHO_WAIT = 1.0  # s


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
        lost = ""

        def follow(on_data: DataCallback) -> int:
            nonlocal lost
            watcher = RobotWatcher(server, robot, on_data, echoes=echoes)
            watcher.on_wait = on_wait
            try:
                return asyncio.run(watch_until_signal(watcher))
            except ClientError as error:
                lost = str(error)
                return 1

        code = self._observe(follow)
        self.error = lost or self.error
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
            await asyncio.to_thread(observer.finish)

    def _observe(self, run: Callable[[DataCallback], int]) -> int:
        """Map the data that a function passes on while it runs."""
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
