"""Ports at which robots reach each other, and the connections through them.

A robot that reads slowly does not fill the memory: what comes for it waits at its
sender, and it is closed if it reads nothing for ``STALL_TIMEOUT``. A connection rests
after each piece that it has passed on, and longer the more of them there are, so that
robots have time whatever is sent.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from radarsim.errors import ServerError
from radarsim.listening import (
    ACCEPTED_AT_ONCE,
    MAX_WAITING,
    bind,
    configure_socket,
)

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Coroutine, Sequence

log = logging.getLogger("radarsim.server")

CONNECT_TIMEOUT: Final = 5.0  # s
REST: Final = 0.01  # s
READ_BYTES: Final = 32_768  # passed on at a time
STALL_TIMEOUT: Final = 60.0  # s; else who is gone would hold a link for ever
CLOSE_GRACE: Final = 2.0  # s to read what was written before a link was closed
Place: TypeAlias = tuple[str, int]  # address and port


class RelayPort:
    """A port at which one robot reaches a port of another.

    Attributes:
        number: The port.
        links: The connections through it.
    """

    def __init__(
        self,
        addresses: Sequence[str],
        target: Callable[[], Place | None],
        rest: Callable[[], float],
    ) -> None:
        """Choose a port, which is closed at first.

        Args:
            addresses: Addresses to listen on.
            target: Returns the place that a caller is connected to; None to refuse it.
            rest: Returns how long a connection rests after each piece, s.

        Raises:
            ServerError: If there is no free port.
        """
        self._addresses, self._target, self._rest = addresses, target, rest
        self._listeners: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[Any]] = set()
        self._is_open = False
        self.links: set[Link] = set()
        with bind(addresses[0], 0) as sock:
            self.number: int = sock.getsockname()[1]

    @property
    def outgoing_ports(self) -> list[int]:
        """Ports from which the robot is reached."""
        return [link.outgoing_port for link in self.links]

    def open(self) -> None:
        """Listen, if it does not; where another program has the port, try later."""
        if self._is_open:
            return
        with suppress(ServerError, OSError), ExitStack() as unless_all:
            sockets = []
            for address in self._addresses:
                sock = bind(address, self.number, only_ipv6=True)
                sockets.append(unless_all.enter_context(sock))
                sock.listen(MAX_WAITING)  # at once, as whoever has asked comes now
            unless_all.pop_all()
            self._is_open = True
            self._run(self._serve(sockets))

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)  # else it may be forgotten before it is done
        task.add_done_callback(self._tasks.discard)

    async def _serve(self, sockets: list[socket.socket]) -> None:
        loop = asyncio.get_running_loop()
        for sock in sockets:
            listener = await loop.create_server(
                self._accept, sock=sock, backlog=ACCEPTED_AT_ONCE
            )
            self._listeners.append(listener)
            sock.listen(MAX_WAITING)  # as of ``listening.listen``
        if not self._is_open:  # closed meanwhile
            self.close()

    def _accept(self) -> asyncio.BaseProtocol:
        return Pipe(self._link, self._rest)

    def _link(self, pipe: Pipe) -> None:
        """Connect a caller with the robot, or close its connection."""
        place = self._target() if self._is_open else None
        if place is None:
            pipe.close()
            return
        link = Link(pipe, Pipe(lambda _: None, self._rest), self.links.discard)
        self.links.add(link)
        self._run(link.connect(*place))

    def close(self) -> None:
        """Stop listening, and close all connections through it."""
        self._is_open = False
        while self._listeners:
            self._listeners.pop().close()
        for link in list(self.links):
            link.close()


class Pipe(asyncio.BufferedProtocol):
    """An end of a link: what comes is written to the other end."""

    def __init__(
        self, ready: Callable[[Pipe], None], rest: Callable[[], float]
    ) -> None:
        """Create the protocol of a connection.

        Args:
            ready: Called once it is made.
            rest: Returns how long it rests after each piece, s.
        """
        self._ready, self._rest = ready, rest
        self._buffer = bytearray(READ_BYTES)
        self._deadline: asyncio.TimerHandle | None = None  # to read what is written
        self._transport: asyncio.Transport | None = None
        self.other: Pipe | None = None  # nothing is read before there is one
        self.closed: Callable[[], None] = lambda: None
        self._is_resting = False
        self._has_room = True  # at the other end

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait until there is another end."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.pause_reading()
        configure_socket(transport)
        self._ready(self)

    def join(self, other: Pipe) -> None:
        """Pass on what comes from now on."""
        self.other = other
        self._read_on()

    @property
    def is_open(self) -> bool:
        """Whether there is a connection, even if it is being closed."""
        return self._transport is not None

    @property
    def local_port(self) -> int:
        """The port of this program at this end."""
        assert self._transport is not None
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - asyncio's name
        """Return the buffer that received bytes are written to."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass on data, and rest, so that robots have time whatever is sent."""
        assert self.other is not None
        self.other.write(bytes(self._buffer[:nbytes]))
        self._is_resting = True
        self._read_on()
        asyncio.get_running_loop().call_later(self._rest(), self._wake)

    def write(self, data: bytes) -> None:
        """Write data to this end."""
        if self._transport is not None:
            self._transport.write(data)

    def pause_writing(self) -> None:
        """Let the other end wait, but not for ever."""
        self._abort_after(STALL_TIMEOUT)
        self._let_other_read(has_room=False)

    def resume_writing(self) -> None:
        """Let the other end go on."""
        if self._transport is not None and not self._transport.is_closing():
            self._abort_after(None)
        self._let_other_read(has_room=True)

    def connection_lost(self, _: Exception | None) -> None:
        """Close the other end as well."""
        self._abort_after(None)
        self._transport = None
        self.closed()

    def close(self) -> None:
        """Close this end, once what is written has been sent, but soon."""
        if self._transport is not None:
            self._abort_after(CLOSE_GRACE)
            self._transport.close()

    def _abort_after(self, seconds: float | None) -> None:
        """Close this end whatever is written, after a time or, with None, never."""
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        if self._transport is not None and seconds is not None:
            loop = asyncio.get_running_loop()
            self._deadline = loop.call_later(seconds, self._transport.abort)

    def _let_other_read(self, *, has_room: bool) -> None:
        if self.other is not None:
            self.other._has_room = has_room
            self.other._read_on()

    def _wake(self) -> None:
        self._is_resting = False
        self._read_on()

    def _read_on(self) -> None:
        if self._transport is None:
            return
        if self._is_resting or not self._has_room:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()


class Link:
    """A connection from one robot to another.

    Attributes:
        outgoing_port: The port of this server from which the other one is reached; 0
            before it is.
    """

    def __init__(self, near: Pipe, far: Pipe, forget: Callable[[Link], None]) -> None:
        """Begin with the end of the robot that came.

        Args:
            near: Its end.
            far: The other one, which is not connected yet.
            forget: Called once both ends are closed.
        """
        self.outgoing_port = 0
        self._near, self._far = near, far
        self._forget = forget
        self._is_closed = False
        near.closed = far.closed = self._lose

    async def connect(self, address: str, port: int) -> None:
        """Connect the other end, or close the link if nobody listens there."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                await loop.create_connection(lambda: self._far, address, port)
        except (OSError, TimeoutError) as error:
            log.info("no connection to %s port %d: %s", address, port, error)
            self.close()
            return
        if self._is_closed:
            self._far.close()
            return
        self.outgoing_port = self._far.local_port
        self._near.join(self._far)
        self._far.join(self._near)

    def close(self) -> None:
        """Close both ends."""
        if not self._is_closed:
            self._is_closed = True
            self._near.close()
            self._far.close()

    def _lose(self) -> None:
        """Close the other end after one, and be forgotten after both."""
        self.close()
        if not (self._near.is_open or self._far.is_open):
            self._forget(self)
