"""A client that waits in the calling thread."""

from types import TracebackType
from typing import Self, TypeVar

from radarsim.client import session as asking
from radarsim.client.deprecation import warn_renamed
from radarsim.client.requests import Exchange, Requests, Step
from radarsim.client.robot_info import RobotInfo
from radarsim.client.session import Session
from radarsim.client.transport import SocketTransport, Transport
from radarsim.errors import ClientError
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import Greeting, Report

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)


class Client:
    """One connection to a server, and the robot that it has there.

    Whatever waits raises ``ClientTimeout`` when the time is up and ``ClientError`` when
    the connection is gone; both say what was missing, and what came last.

    Attributes:
        transport: What it talks over; its time is the only one that this client knows.
    """

    def __init__(self, transport: Transport, *, timeout: float = 5.0) -> None:
        """Talk over a link, which from now on belongs to the client.

        Args:
            transport: Connected.
            timeout: Longest wait where a call is told no other, s of the link's time.

        Raises:
            ValueError: If that is not above 0.
        """
        self.transport = transport
        self._talk = Requests(transport.time, timeout=timeout)

    @classmethod
    def connect(
        cls, host: str = "127.0.0.1", port: int = 3000, *, timeout: float = 5.0
    ) -> Self:
        """Connect over TCP.

        Args:
            host: Name or address.
            port: TCP port.
            timeout: Longest wait, s: for the connection, and as in ``Client``.

        Raises:
            ClientError: If no server is there.
            ValueError: If the timeout is not above 0.
        """
        return cls(SocketTransport(host, port, timeout=timeout), timeout=timeout)

    @property
    def link(self) -> Transport:
        """``transport``; deprecated."""
        warn_renamed("Client.link", "Client.transport")
        return self.transport

    @property
    def session(self) -> Session:
        """All that the server has said: newest time and scans, lines skipped."""
        return self._talk.session

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def greeting(self) -> Greeting:
        """Give the server's first words; they say the name of the map."""
        return self._run(self._talk.greeting())

    def start_poses(self) -> dict[str, Pose3]:
        """Ask for the start poses of the map, by name."""
        return self._run(self._talk.start_poses())

    def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: Pose2 | Pose3 | None = None,
    ) -> None:
        """Have a robot made, and wait until it says something.

        A server says nothing where it makes none: what it has no class or no place for.

        Args:
            class_name: Such as ``P3AT``.
            name: None leaves it to the server.
            start: Name of a start pose.
            pose: Of the robot, if there is no ``start``; with neither, the server's.

        Raises:
            ClientError: If the robot says nothing.
            ValueError: If both are given, or a line cannot hold what is given.
        """
        self._run(self._talk.spawn(class_name, name, start, pose))

    def geometry(self, kind: str, name: str | None = None) -> Report:
        """Ask where things are.

        Args:
            kind: ``Robot``, or a type of items such as ``RangeScanner``.
            name: Of one item; None for all of the type.

        Returns:
            A ``RobotGeo`` or an ``ItemGeo``.
        """
        return self._run(self._talk.ask(asking.geometry(kind, name)))

    def configuration(self, kind: str, name: str | None = None) -> Report:
        """Ask for settings; arguments as in ``geometry``.

        Returns:
            A ``RobotConf``, ``ScannerConf`` or another report that ends in ``Conf``.
        """
        return self._run(self._talk.ask(asking.configuration(kind, name)))

    def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """Find out what the robot is, and which scanners it has.

        What a server does not tell of a scanner is taken from its scans, after 2 s.

        Args:
            drive_unit: What the server counts wheel speeds in; no server tells.

        Raises:
            ClientError: If the robot's own geometry or configuration stays away, or
                has wheels that cannot be.
        """
        return self._run(self._talk.robot_info(drive_unit))

    def facts(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """Call ``robot_info``; deprecated."""
        warn_renamed("Client.facts", "Client.robot_info")
        return self.robot_info(drive_unit=drive_unit)

    def echoes(self, scanner: str, on: bool = True) -> None:
        """Ask a scanner for ``EchoLine`` reports before each scan, or for no more."""
        self._run(self._talk.send(asking.echoes(scanner, on)))

    def set_item(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> None:
        """Give an order to the items of a type, such as ``RESET`` to ``Odometry``."""
        self._run(self._talk.send(asking.set_item(kind, name, opcode, params)))

    def order(self, kind: str, name: str | None, opcode: str, params: str = "") -> None:
        """Call ``set_item``; deprecated."""
        warn_renamed("Client.order", "Client.set_item")
        self.set_item(kind, name, opcode, params)

    def drive(self, left: float, right: float) -> None:
        """Set the spin of the left and the right wheels, in the server's unit.

        It holds until the next call. ``RobotInfo.wheel_speeds`` gives these.
        """
        self._run(self._talk.send(asking.drive(left, right)))

    def stop(self) -> bool:
        """Stop the wheels; tells whether that could be sent, and never raises."""
        try:
            self.drive(0.0, 0.0)
        except ClientError:
            return False
        return True

    def read(self, timeout: float | None = None) -> list[Report]:
        """Give the next reports, at least one, in their order."""
        return self._run(self._talk.read(timeout))

    def wait_for(
        self,
        kind: type[AnyReport],
        *,
        name: str | None = None,
        timeout: float | None = None,
    ) -> AnyReport:
        """Skip reports up to one of a kind; those behind it stay to be read.

        Args:
            kind: Such as ``RangeScan``.
            name: Of the item, if it is to be one only.
            timeout: Longest wait for it, s.
        """
        return self._run(self._talk.wait_for(kind, name, timeout))

    def close(self) -> None:
        """Stop the robot if that can be, and let go of the server; never raises."""
        if self._talk.has_robot:
            self.stop()
            self._talk.has_robot = False
        self.transport.close()

    def _run(self, talk: Exchange[Value]) -> Value:
        """Send and wait as a talk says, and give what comes of it."""
        try:
            step = next(talk)
            while True:
                try:
                    came = self._do(step)
                except (TimeoutError, ConnectionError) as error:
                    step = talk.throw(error)
                else:
                    step = talk.send(came)
        except StopIteration as end:
            value: Value = end.value
            return value

    def _do(self, step: Step) -> bytes:
        if isinstance(step, bytes):
            self.transport.send(step)
            return b""
        return self.transport.receive(step)
