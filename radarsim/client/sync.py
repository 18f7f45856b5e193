"""A client that blocks the calling thread."""

import threading
from collections.abc import Iterable, Iterator
from contextlib import closing
from typing import Any, Self, TypeVar

from radarsim.client import session as questions
from radarsim.client.requests import Exchange, Requests
from radarsim.client.robot_info import RobotInfo
from radarsim.client.session import PoseLike, Session
from radarsim.client.transport import SocketTransport, Transport
from radarsim.errors import ClientError
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import Greeting, Report

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)


class Client:
    """One connection to a server and its robot there.

    Every call that waits raises ``ClientTimeout`` when its time is up and
    ``ClientError`` when the connection is lost. Both name what was expected and the
    last line that was received. While one thread waits for reports, others may call as
    well; each gets what it waits for.

    Attributes:
        transport: Connection to the server; its clock is the only one that is used.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        timeout: float = 5.0,
    ) -> None:
        """Use a transport, which the client closes.

        Args:
            transport: Open connection.
            timeout: Default timeout of every call, s of the transport's clock.

        Raises:
            ValueError: If the timeout is not above 0.
        """
        self.transport = transport
        self._requests = Requests(
            transport.time,
            timeout=timeout,
            # Why commands had no effect, which some transports know.
            diagnostics=getattr(transport, "diagnostics", None),
        )
        self._condition = threading.Condition()
        self._is_receiving = False
        self._closed = threading.Event()

    @classmethod
    def connect(
        cls, host: str = "127.0.0.1", port: int = 3000, *, timeout: float = 5.0
    ) -> Self:
        """Connect over TCP.

        Args:
            host: Name or address.
            port: TCP port.
            timeout: Timeout of the connection attempt and default of every call, s.

        Raises:
            ClientError: If the connection cannot be opened.
            ValueError: If the timeout is not above 0.
        """
        return cls(SocketTransport(host, port, timeout=timeout), timeout=timeout)

    @property
    def session(self) -> Session:
        """State of the connection: latest time stamp, latest scans, skipped lines."""
        return self._requests.session

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def greeting(self) -> Greeting:
        """Return the greeting, which names the map."""
        return self._run(self._requests.greeting())

    def start_poses(self) -> dict[str, Pose3]:
        """Request the start poses of the map by name."""
        return self._run(self._requests.start_poses())

    def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: PoseLike | None = None,
        timeout: float | None = None,
    ) -> None:
        """Spawn a robot and wait for its first report.

        A server does not report a failure: without such a class, or without a free
        place, no report comes. As long as a busy server answers nothing that is sent
        after the request, the client waits up to 60 s.

        Args:
            class_name: Class of the robot, such as ``P3AT``.
            name: Name of the robot; None lets the server choose.
            start: Name of a start pose, in any case.
            pose: Pose of the robot if ``start`` is None; also as numbers, ``(x, y)``,
                ``(x, y, yaw)`` or the six of a ``Pose3``. Without both, it takes the
                first start of the map at which radarsim has room for it, or the first
                one of another server.
            timeout: Longest time to wait, s, also for a busy server; None for
                the default.

        Raises:
            ClientError: If no report comes, the map has no such start, or the robot is
                still that of a class before.
            ValueError: If both ``start`` and ``pose`` are given, the pose is none, or a
                text cannot be written on a line.
        """
        self._run(self._requests.spawn(class_name, name, start, pose, timeout))

    def geometry(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Report:
        """Request the robot's dimensions or the mounts of items.

        Args:
            kind: ``Robot``, or a type of items such as ``RangeScanner``.
            name: Name of one item; None for all items of the type.
            robot: Name of the robot of another client, of which only radarsim tells;
                None for the client's own.

        Returns:
            A ``RobotGeo`` or an ``ItemGeo``.
        """
        return self._run(self._requests.geometry(kind, name, robot))

    def configuration(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Report:
        """Request settings; arguments as in ``geometry``.

        Returns:
            A ``RobotConf``, a ``ScannerConf`` or another report named ``...Conf``.
        """
        return self._run(self._requests.configuration(kind, name, robot))

    def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """Request the robot's dimensions and limits and its scanners.

        Properties of a scanner that a server does not report within 2 s are taken from
        its scans.

        Args:
            drive_unit: Unit of the server's wheel speeds, which no server reports.

        Raises:
            ClientError: If the geometry or the configuration of the robot does not
                come, or is not plausible.
        """
        return self._run(self._requests.robot_info(drive_unit))

    def echoes(self, scanner: str, on: bool = True) -> None:
        """Switch the ``EchoLine`` reports before each scan of a scanner on or off."""
        self.send(questions.echoes(scanner, on))

    def targets(self, scanner: str, on: bool = True) -> None:
        """Switch the ``RadarTargets`` reports of a scanner's detector on or off."""
        self.send(questions.targets(scanner, on))

    def watch(
        self,
        robots: str | Iterable[str] | None = None,
        *,
        echoes: bool | str | Iterable[str] = False,
        clock: bool = False,
    ) -> None:
        """Ask radarsim for copies of what the clients of robots are sent.

        They come as ``WatchedLine`` reports. ``RobotJoined`` and ``RobotLeft`` tell
        which robots there are, if all are watched. A later call replaces this one.

        Args:
            robots: Name or names, in any case; None for all, an empty list for none.
            echoes: Whether their scanners shall list all echoes, or the names of those
                robots whose scanners shall.
            clock: Whether the server shall tell the time in every tick of 10 ms, as
                ``ClockTick`` reports.

        Raises:
            ClientError: If the server refuses it or, like others than radarsim, does
                not answer.
            ValueError: If a name is empty, or has a comma.
        """
        self._run(self._requests.watch(robots, echoes, clock))

    def change_settings(self, scanner: str | None = None, /, **settings: Any) -> None:
        """Change settings of a scanner of the client's robot, from its next scan on.

        Only radarsim can. Scans from before, which have not been read, are dropped.

        Args:
            scanner: Name of the scanner; None for all.
            **settings: Values by the names of settings, such as ``side_offset_uu``.

        Raises:
            ClientError: If there is no such scanner or setting, or a value is refused.
            ValueError: If there are none, or a text cannot be written on a line.
        """
        self._run(self._requests.change_settings(scanner, settings))

    def set_item(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> None:
        """Send an opcode to the items of a type, such as ``RESET`` to ``Odometry``.

        ``SETTING`` is waited for, as in ``change_settings``.
        """
        self._run(self._requests.set_item(kind, name, opcode, params))

    def send(self, data: bytes) -> None:
        """Send whole lines as they are, and wait for no answer.

        Raises:
            ClientError: If the connection is lost.
        """
        self._run(self._requests.send(data))

    def drive(self, left: float, right: float) -> None:
        """Set the speeds of the left and the right wheels in the server's unit.

        They hold until the next call. ``RobotInfo.wheel_speeds`` computes them. A car
        is steered instead, once ``robot_info`` has told that it is one.
        """
        self.send(questions.drive(left, right, self._requests.session.car))

    def stop(self) -> bool:
        """Stop the wheels; return whether that could be sent, and never raise."""
        try:
            self.drive(0.0, 0.0)
        except ClientError:
            return False
        return True

    def read(self, timeout: float | None = None) -> list[Report]:
        """Return the next reports, at least one, in order.

        Those come first that another call has passed over.
        """
        return self._run(self._requests.read(timeout))

    def __iter__(self) -> Iterator[Report]:
        """Yield the reports one after the other, until the client is closed.

        Those that are left when a loop ends can be read by other calls.

        Raises:
            ClientError: If the connection is lost, or no report comes within the
                default timeout.
        """
        while not self._closed.is_set():
            try:
                report = self._run(self._requests.next_report())
            except ClientError:
                if self._closed.is_set():  # by another thread
                    return
                raise
            yield report

    def newest(self, kind: type[AnyReport]) -> AnyReport | None:
        """Return the newest report of a class that has come, read or not.

        It waits for nothing: call it beside a loop over the client or other calls that
        wait. None before the first one, and after a spawn.
        """
        report = self.session.newest.get(kind)
        return report if isinstance(report, kind) else None

    def wait_for(
        self,
        kind: type[AnyReport],
        *,
        name: str | None = None,
        timeout: float | None = None,
    ) -> AnyReport:
        """Return the first report of a kind that no call has returned.

        All others can still be read or waited for. Of the readings of one sensor that
        are passed over, only the newest is kept.

        Args:
            kind: Class of the report, such as ``RangeScan``.
            name: Name of the item; None accepts any.
            timeout: Timeout, s; None for the default.

        Raises:
            TypeError: If the kind is no class.
        """
        return self._run(self._requests.wait_for(kind, name, timeout))

    def close(self) -> None:
        """Stop the robot if possible and close the connection; never raise.

        Calls of other threads that wait raise ``ClientError``.
        """
        self._closed.set()
        if self._requests.has_robot:
            self.stop()
            self._requests.has_robot = False
        self.transport.close()

    def _run(self, exchange: Exchange[Value]) -> Value:
        """Run an exchange over the transport and return its result."""
        with self._condition, closing(exchange):
            try:
                step = next(exchange)
                while True:
                    try:
                        if isinstance(step, bytes):
                            self.transport.send(step)
                        else:
                            self._receive(step)
                    except (TimeoutError, ConnectionError) as error:
                        # Only the exchange knows what was expected, so it words the
                        # error.
                        step = exchange.throw(error)
                    else:
                        step = next(exchange)
            except StopIteration as end:
                value: Value = end.value
                return value

    def _receive(self, timeout: float) -> None:
        """Receive, or wait for the thread that does; others may call meanwhile."""
        if self._is_receiving:
            self._condition.wait(timeout)
            return
        self._is_receiving = True
        self._condition.release()
        try:
            data = self.transport.receive(timeout)
        finally:
            self._condition.acquire()
            self._is_receiving = False
            self._condition.notify_all()
        self._requests.receive(data)
