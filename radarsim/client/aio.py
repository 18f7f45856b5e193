"""A client for an event loop."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Iterable
from contextlib import closing, suppress
from typing import Any, Generic, Self, TypeVar

from radarsim.client import session as questions
from radarsim.client.requests import Exchange, Requests
from radarsim.client.robot_info import RobotInfo
from radarsim.client.session import PoseLike, Session, check_timeout
from radarsim.client.transport import (
    CHUNK,
    CLOSED,
    SHORTEST_WAIT,
    STUCK,
    lost,
    no_server,
)
from radarsim.errors import ClientError
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import Greeting, Report

Value = TypeVar("Value")
AnyReport = TypeVar("AnyReport", bound=Report)
AnyClient = TypeVar("AnyClient", bound="AsyncClient")


class Connecting(Generic[AnyClient]):
    """A connection that is opened when it is awaited or entered."""

    def __init__(self, connect: Callable[[], Awaitable[AnyClient]]) -> None:
        self._connect = connect
        self._client: AnyClient | None = None

    def __await__(self) -> Generator[Any, None, AnyClient]:
        return self._connect().__await__()

    async def __aenter__(self) -> AnyClient:
        self._client = await self._connect()
        return self._client

    async def __aexit__(self, *_: object) -> None:
        assert self._client is not None
        await self._client.close()


class AsyncClient:
    """The methods of ``Client`` as coroutines.

    While one task waits for reports, others may call as well; each gets what it waits
    for.
    """

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        *,
        timeout: float = 5.0,
    ) -> None:
        """Use the streams of a connection, which the client closes.

        Args:
            reader: Reader of the connection.
            writer: Writer of the connection.
            timeout: Default timeout of every call, also of sending, s of the loop's
                clock.

        Raises:
            ValueError: If the timeout is not above 0.
        """
        self._reader = reader
        self._writer = writer
        loop = asyncio.get_running_loop()
        self._requests = Requests(loop.time, timeout=timeout)
        self._reading: asyncio.Event | None = None  # set when a read has ended

    @classmethod
    def connect(
        cls, host: str = "127.0.0.1", port: int = 3000, *, timeout: float = 5.0
    ) -> "Connecting[Self]":
        """Connect over TCP; arguments and errors as in ``Client.connect``.

        The client is what ``await`` returns, and what ``async with`` enters.
        """
        return Connecting(lambda: cls._open(host, port, timeout))

    @classmethod
    async def _open(cls, host: str, port: int, timeout: float) -> Self:  # noqa: ASYNC109
        check_timeout(timeout)
        try:
            async with asyncio.timeout(timeout):
                reader, writer = await asyncio.open_connection(host, port)
        except (OSError, UnicodeError) as error:
            raise no_server(host, port, error) from None
        return cls(reader, writer, timeout=timeout)

    @property
    def session(self) -> Session:
        """State of the connection, as ``Client.session``."""
        return self._requests.session

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def greeting(self) -> Greeting:
        """See ``Client.greeting``."""
        return await self._run(self._requests.greeting())

    async def start_poses(self) -> dict[str, Pose3]:
        """See ``Client.start_poses``."""
        return await self._run(self._requests.start_poses())

    async def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: PoseLike | None = None,
        timeout: float | None = None,  # noqa: ASYNC109
    ) -> None:
        """See ``Client.spawn``."""
        await self._run(self._requests.spawn(class_name, name, start, pose, timeout))

    async def geometry(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Report:
        """See ``Client.geometry``."""
        return await self._run(self._requests.geometry(kind, name, robot))

    async def configuration(
        self, kind: str, name: str | None = None, *, robot: str | None = None
    ) -> Report:
        """See ``Client.configuration``."""
        return await self._run(self._requests.configuration(kind, name, robot))

    async def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:
        """See ``Client.robot_info``."""
        return await self._run(self._requests.robot_info(drive_unit))

    async def echoes(self, scanner: str, on: bool = True) -> None:
        """See ``Client.echoes``."""
        await self.send(questions.echoes(scanner, on))

    async def targets(self, scanner: str, on: bool = True) -> None:
        """See ``Client.targets``."""
        await self.send(questions.targets(scanner, on))

    async def watch(
        self,
        robots: str | Iterable[str] | None = None,
        *,
        echoes: bool | str | Iterable[str] = False,
        clock: bool = False,
    ) -> None:
        """See ``Client.watch``."""
        await self._run(self._requests.watch(robots, echoes, clock))

    async def change_settings(
        self, scanner: str | None = None, /, **settings: Any
    ) -> None:
        """See ``Client.change_settings``."""
        await self._run(self._requests.change_settings(scanner, settings))

    async def set_item(
        self, kind: str, name: str | None, opcode: str, params: str = ""
    ) -> None:
        """See ``Client.set_item``."""
        await self._run(self._requests.set_item(kind, name, opcode, params))

    async def send(self, data: bytes) -> None:
        """See ``Client.send``."""
        await self._run(self._requests.send(data))

    async def drive(self, left: float, right: float) -> None:
        """See ``Client.drive``."""
        await self.send(questions.drive(left, right, self._requests.session.car))

    async def stop(self) -> bool:
        """See ``Client.stop``."""
        try:
            await self.drive(0.0, 0.0)
        except ClientError:
            return False
        return True

    async def read(self, timeout: float | None = None) -> list[Report]:  # noqa: ASYNC109
        """See ``Client.read``."""
        return await self._run(self._requests.read(timeout))

    async def __aiter__(self) -> AsyncIterator[Report]:
        """See ``Client.__iter__``."""
        while not self._writer.is_closing():
            try:
                report = await self._run(self._requests.next_report())
            except ClientError:
                if self._writer.is_closing():  # by another task
                    return
                raise
            yield report

    def newest(self, kind: type[AnyReport]) -> AnyReport | None:
        """See ``Client.newest``."""
        report = self.session.newest.get(kind)
        return report if isinstance(report, kind) else None

    async def wait_for(
        self,
        kind: type[AnyReport],
        *,
        name: str | None = None,
        timeout: float | None = None,  # noqa: ASYNC109
    ) -> AnyReport:
        """See ``Client.wait_for``."""
        return await self._run(self._requests.wait_for(kind, name, timeout))

    async def close(self) -> None:
        """See ``Client.close``."""
        if self._requests.has_robot:
            # Before it waits: a second call must not send it again.
            self._requests.has_robot = False
            await self.stop()
        self._writer.close()
        try:
            async with asyncio.timeout(self._requests.timeout):
                await self._writer.wait_closed()
        except OSError:  # lost already, or the server does not read
            self._writer.transport.abort()

    async def _run(self, exchange: Exchange[Value]) -> Value:
        """Run an exchange over the streams and return its result."""
        with closing(exchange):
            try:
                step = next(exchange)
                while True:
                    try:
                        if isinstance(step, bytes):
                            await self._send(step)
                        else:
                            await self._receive(step)
                    except (TimeoutError, ConnectionError) as error:
                        # Only the exchange knows what was expected, so it words the
                        # error.
                        step = exchange.throw(error)
                    else:
                        step = next(exchange)
            except StopIteration as end:
                value: Value = end.value
                return value

    async def _send(self, data: bytes) -> None:
        # A stream that closes drops what is written, without an error.
        if self._writer.is_closing():
            raise ConnectionError(CLOSED)
        self._writer.write(data)
        try:
            async with asyncio.timeout(self._requests.timeout):
                await self._writer.drain()
        except TimeoutError:
            raise ConnectionError(STUCK) from None
        except OSError as error:
            raise lost(error) from None

    async def _receive(self, seconds: float) -> None:
        """Read, or wait until the task that reads has done so."""
        if self._reading is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(seconds):
                    await self._reading.wait()
            return
        self._reading = asyncio.Event()
        try:
            # Tasks that are about to wait for the same report shall get it as well.
            await asyncio.sleep(0)
            async with asyncio.timeout(max(seconds, SHORTEST_WAIT)):
                data = await self._reader.read(CHUNK)
        except TimeoutError:
            raise
        except OSError as error:
            raise lost(error) from None
        finally:
            self._reading.set()
            self._reading = None
        if not data:
            raise ConnectionError("the server closed the connection")
        self._requests.receive(data)
