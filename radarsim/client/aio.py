"""A client that waits in an event loop."""

import asyncio
from types import TracebackType
from typing import Self, TypeVar

from radarsim.client import session as asking
from radarsim.client.deprecation import warn_renamed
from radarsim.client.requests import Exchange, Requests, Step
from radarsim.client.robot_info import RobotInfo
from radarsim.client.session import Session, check_timeout
from radarsim.client.transport import CHUNK, SHORTEST_WAIT, STUCK
from radarsim.errors import ClientError
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import Greeting, Report

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)


class AsyncClient:
    """What ``Client`` is, for tasks: the same calls, to be awaited.

    One task waits for reports; others may drive, stop and close meanwhile.
    """

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        *,
        timeout: float = 5.0,
    ) -> None:
        """Talk over streams, which from now on belong to the client.

        Args:
            reader: Of a connection.
            writer: Of the same.
            timeout: Longest wait where a call is told no other, and for the server to
                take what is sent, s of the loop's time.

        Raises:
            ValueError: If that is not above 0.
        """
        self._reader = reader
        self._writer = writer
        loop = asyncio.get_running_loop()
        self._talk = Requests(loop.time, timeout=timeout)

    @classmethod
    async def connect(
        cls,
        host: str = "127.0.0.1",
        port: int = 3000,
        *,
        timeout: float = 5.0,  # noqa: ASYNC109
    ) -> Self:
        """Connect over TCP; arguments and errors as of ``Client.connect``."""
        check_timeout(timeout)
        try:
            async with asyncio.timeout(timeout):
                reader, writer = await asyncio.open_connection(host, port)
        except OSError as error:
            why = str(error) or "timed out"
            raise ClientError(f"no server at {host}:{port}: {why}") from None
        return cls(reader, writer, timeout=timeout)

    @property
    def session(self) -> Session:
        """All that the server has said: newest time and scans, lines skipped."""
        return self._talk.session

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def greeting(self) -> Greeting:
        """As ``Client.greeting``."""
        return await self._run(self._talk.greeting())

    async def start_poses(self) -> dict[str, Pose3]:
        """As ``Client.start_poses``."""
        return await self._run(self._talk.start_poses())

    async def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: Pose2 | Pose3 | None = None,
    ) -> None:
        """As ``Client.spawn``."""
        await self._run(self._talk.spawn(class_name, name, start, pose))

    async def geometry(self, kind: str, name: str | None = None) -> Report:
        """As ``Client.geometry``."""
        return await self._run(self._talk.ask(asking.geometry(kind, name)))

    async def configuration(self, kind: str, name: str | None = None) -> Report:
        """As ``Client.configuration``."""
        return await self._run(self._talk.ask(asking.configuration(kind, name)))

    async def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """As ``Client.robot_info``."""
        return await self._run(self._talk.robot_info(drive_unit))

    async def facts(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """Call ``robot_info``; deprecated."""
        warn_renamed("AsyncClient.facts", "AsyncClient.robot_info")
        return await self.robot_info(drive_unit=drive_unit)

    async def echoes(self, scanner: str, on: bool = True) -> None:
        """As ``Client.echoes``."""
        await self._run(self._talk.send(asking.echoes(scanner, on)))

    async def set_item(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> None:
        """As ``Client.set_item``."""
        await self._run(self._talk.send(asking.set_item(kind, name, opcode, params)))

    async def order(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> None:
        """Call ``set_item``; deprecated."""
        warn_renamed("AsyncClient.order", "AsyncClient.set_item")
        await self.set_item(kind, name, opcode, params)

    async def drive(self, left: float, right: float) -> None:
        """As ``Client.drive``."""
        await self._run(self._talk.send(asking.drive(left, right)))

    async def stop(self) -> bool:
        """As ``Client.stop``."""
        try:
            await self.drive(0.0, 0.0)
        except ClientError:
            return False
        return True

    async def read(self, timeout: float | None = None) -> list[Report]:  # noqa: ASYNC109
        """As ``Client.read``."""
        return await self._run(self._talk.read(timeout))

    async def wait_for(
        self,
        kind: type[AnyReport],
        *,
        name: str | None = None,
        timeout: float | None = None,  # noqa: ASYNC109
    ) -> AnyReport:
        """As ``Client.wait_for``."""
        return await self._run(self._talk.wait_for(kind, name, timeout))

    async def close(self) -> None:
        """As ``Client.close``."""
        if self._talk.has_robot:
            self._talk.has_robot = False
            await self.stop()
        self._writer.close()
        try:
            async with asyncio.timeout(self._talk.timeout):
                await self._writer.wait_closed()
        except OSError:  # what was lost, or is taken by nobody
            self._writer.transport.abort()

    async def _run(self, talk: Exchange[Value]) -> Value:
        """Send and wait as a talk says, and give what comes of it."""
        try:
            step = next(talk)
            while True:
                try:
                    came = await self._do(step)
                except (TimeoutError, ConnectionError) as error:
                    step = talk.throw(error)
                else:
                    step = talk.send(came)
        except StopIteration as end:
            value: Value = end.value
            return value

    async def _do(self, step: Step) -> bytes:
        if isinstance(step, bytes):
            await self._send(step)
            return b""
        return await self._receive(step)

    async def _send(self, data: bytes) -> None:
        if self._writer.is_closing():
            raise ConnectionError("the connection is closed")
        self._writer.write(data)
        try:
            async with asyncio.timeout(self._talk.timeout):
                await self._writer.drain()
        except TimeoutError:
            raise ConnectionError(STUCK) from None
        except OSError as error:
            raise ConnectionError(f"the connection is lost: {error}") from None

    async def _receive(self, seconds: float) -> bytes:
        try:
            async with asyncio.timeout(max(seconds, SHORTEST_WAIT)):
                data = await self._reader.read(CHUNK)
        except TimeoutError:
            raise
        except OSError as error:
            raise ConnectionError(f"the connection is lost: {error}") from None
        if not data:
            raise ConnectionError("the server closed the connection")
        return data
