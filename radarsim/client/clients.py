"""A blocking and an asynchronous client for servers of the USARSim protocol.

Both clients take their methods from ``Requests``: the blocking client runs each request
over a ``Transport``, the asynchronous client over asyncio streams.
"""

import asyncio
import threading
from collections.abc import (
    AsyncIterator,
    Awaitable,
    Callable,
    Coroutine,
    Generator,
    Iterator,
)
from contextlib import closing, suppress
from functools import wraps
from typing import Any, Concatenate, Generic, ParamSpec, Self, TypeVar

from radarsim.client.requests import Exchange, Requests
from radarsim.client.session import Session, check_timeout
from radarsim.client.transport import (
    CHUNK,
    CLOSED,
    SHORTEST_WAIT,
    STUCK,
    SocketTransport,
    Transport,
    lost,
    no_server,
)
from radarsim.errors import ClientError
from radarsim.protocol.reports import Report

Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")
AnyReport = TypeVar("AnyReport", bound=Report)
AnyClient = TypeVar("AnyClient", bound="AsyncClient")


class _Connected:
    """Base class of ``Client`` and ``AsyncClient`` with their common properties."""

    _requests: Requests

    @property
    def session(self) -> Session:
        """State of the connection, such as the latest scans and time stamp."""
        return self._requests.session

    def newest(self, kind: type[AnyReport]) -> AnyReport | None:
        """Return the newest received report of a class, even if it was not read yet.

        This method does not wait and receives nothing itself: use it together with a
        loop over the client or other calls that wait. It returns None before the first
        such report, and after a spawn.
        """
        report = self.session.newest.get(kind)
        return report if isinstance(report, kind) else None


def _blocking(
    request: Callable[Concatenate[Requests, Arguments], Exchange[Value]],
) -> Callable[Concatenate["Client", Arguments], Value]:
    """Convert a method of ``Requests`` to a method of the blocking client."""

    @wraps(request)
    def call(
        client: "Client", /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Value:
        return client._run(request(client._requests, *args, **kwargs))

    return call


def _awaited(
    request: Callable[Concatenate[Requests, Arguments], Exchange[Value]],
) -> Callable[Concatenate["AsyncClient", Arguments], Coroutine[Any, Any, Value]]:
    """Convert a method of ``Requests`` to a coroutine of the asynchronous client."""

    @wraps(request)
    async def call(
        client: "AsyncClient", /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Value:
        return await client._run(request(client._requests, *args, **kwargs))

    return call


class Client(_Connected):
    """A blocking client: one connection to a server, with at most one robot.

    Every call that waits raises ``ClientTimeout`` when its timeout expires and
    ``ClientError`` when the connection is lost. Both errors name the expected report
    and the last received line. The client is thread-safe: several threads may wait at
    once, and each receives the reports that it waits for.

    Attributes:
        transport: Connection to the server; all timeouts use its clock.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        timeout: float = 5.0,
    ) -> None:
        """Create a client on an open connection, which ``close`` also closes.

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
            # Some kinds of connection collect reasons why commands had no effect.
            diagnostics=getattr(transport, "diagnostics", None),
        )
        self._condition = threading.Condition()
        self._is_receiving = False
        self._closed = threading.Event()

    @classmethod
    def connect(
        cls, host: str = "127.0.0.1", port: int = 3000, *, timeout: float = 5.0
    ) -> Self:
        """Create a client that is connected to a server over TCP.

        Args:
            host: Name or address.
            port: TCP port.
            timeout: Timeout of the connection attempt, and default timeout of every
                call, s.

        Raises:
            ClientError: If the connection cannot be opened.
            ValueError: If the timeout is not above 0.
        """
        return cls(SocketTransport(host, port, timeout=timeout), timeout=timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    greeting = _blocking(Requests.greeting)
    start_poses = _blocking(Requests.start_poses)
    spawn = _blocking(Requests.spawn)
    geometry = _blocking(Requests.geometry)
    configuration = _blocking(Requests.configuration)
    robot_info = _blocking(Requests.robot_info)
    echoes = _blocking(Requests.echoes)
    targets = _blocking(Requests.targets)
    watch = _blocking(Requests.watch)
    change_settings = _blocking(Requests.change_settings)
    set_item = _blocking(Requests.set_item)
    send = _blocking(Requests.send)
    drive = _blocking(Requests.drive)
    stop = _blocking(Requests.stop)
    read = _blocking(Requests.read)
    wait_for = _blocking(Requests.wait_for)

    def __iter__(self) -> Iterator[Report]:
        """Yield received reports one after the other, until the client is closed.

        Reports that remain when a loop ends can be read by other calls.

        Raises:
            ClientError: If the connection is lost, or no report comes within the
                default timeout.
        """
        while not self._closed.is_set():
            try:
                report = self._run(self._requests.next_report())
            except ClientError:
                if self._closed.is_set():  # another thread has called close()
                    return
                raise
            yield report

    def close(self) -> None:
        """Stop the robot if possible, and close the connection without an error.

        Waiting calls in other threads raise ``ClientError``.
        """
        self._closed.set()
        if self._requests.has_robot:
            self.stop()
            self._requests.has_robot = False
        self.transport.close()

    def _run(self, exchange: Exchange[Value]) -> Value:
        """Send and receive over the transport as a request asks; return its result."""
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
                        # The exchange replaces this error by one that names the report
                        # for which it has waited.
                        step = exchange.throw(error)
                    else:
                        step = next(exchange)
            except StopIteration as end:
                value: Value = end.value
                return value

    def _receive(self, timeout: float) -> None:
        """Receive data from the server, or wait until another thread has done so."""
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


class Connecting(Generic[AnyClient]):
    """An asynchronous client that connects when it is awaited, or in ``async with``."""

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


class AsyncClient(_Connected):
    """An asynchronous client, which has the methods of ``Client`` as coroutines.

    Several tasks may wait at once; each receives the reports that it waits for.
    """

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        *,
        timeout: float = 5.0,
    ) -> None:
        """Create a client on two open streams, which ``close`` also closes.

        Args:
            reader: Reader of the connection.
            writer: Writer of the connection.
            timeout: Default timeout of every call, including calls that only send, s of
                the loop's clock.

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
        """Create a client connected over TCP, with the arguments of ``Client.connect``.

        Use ``client = await AsyncClient.connect()``, or ``async with
        AsyncClient.connect() as client``.
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

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    greeting = _awaited(Requests.greeting)
    start_poses = _awaited(Requests.start_poses)
    spawn = _awaited(Requests.spawn)
    geometry = _awaited(Requests.geometry)
    configuration = _awaited(Requests.configuration)
    robot_info = _awaited(Requests.robot_info)
    echoes = _awaited(Requests.echoes)
    targets = _awaited(Requests.targets)
    watch = _awaited(Requests.watch)
    change_settings = _awaited(Requests.change_settings)
    set_item = _awaited(Requests.set_item)
    send = _awaited(Requests.send)
    drive = _awaited(Requests.drive)
    stop = _awaited(Requests.stop)
    read = _awaited(Requests.read)
    wait_for = _awaited(Requests.wait_for)

    async def __aiter__(self) -> AsyncIterator[Report]:
        """Yield received reports one after the other, until the client is closed."""
        while not self._writer.is_closing():
            try:
                report = await self._run(self._requests.next_report())
            except ClientError:
                if self._writer.is_closing():  # another task has called close()
                    return
                raise
            yield report

    async def close(self) -> None:
        """Stop the robot if possible, and close the connection without an error."""
        if self._requests.has_robot:
            # The flag is cleared before the wait, so that a second call of close() does
            # not stop the robot again.
            self._requests.has_robot = False
            await self.stop()
        self._writer.close()
        try:
            async with asyncio.timeout(self._requests.timeout):
                await self._writer.wait_closed()
        except OSError:  # the connection is lost, or the server does not read
            self._writer.transport.abort()

    async def _run(self, exchange: Exchange[Value]) -> Value:
        """Send and receive over the streams as a request asks; return its result."""
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
                        # The exchange replaces this error by one that names the report
                        # for which it has waited.
                        step = exchange.throw(error)
                    else:
                        step = next(exchange)
            except StopIteration as end:
                value: Value = end.value
                return value

    async def _send(self, data: bytes) -> None:
        # Without this error, a closing stream would silently drop written data.
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
        """Receive data from the server, or wait until another task has done so."""
        if self._reading is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(seconds):
                    await self._reading.wait()
            return
        self._reading = asyncio.Event()
        try:
            # The sleep lets other tasks begin to wait, so they get the same report.
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
