"""Ports at which robots reach each other, and the connections through them.

A robot that reads slowly does not fill the memory: what comes for it waits at its
sender. A connection rests after each piece that it has passed on, so that robots have
time whatever is sent.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from radarsim.errors import ServerError
from radarsim.listening import bind

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Coroutine

log = logging.getLogger("radarsim.server")

CONNECT_TIMEOUT: Final = 5.0  # s
REST: Final = 0.01  # s
Place: TypeAlias = tuple[str, int]  # address and port


class RelayPort:
    """A port at which one robot reaches a port of another.

    Attributes:
        number: The port.
        links: The connections through it.
    """

    def __init__(self, address: str, target: Callable[[], Place | None]) -> None:
        """Choose a port, which is closed at first.

        Args:
            address: Address to listen on.
            target: Returns the place that a caller is connected to; None to refuse it.

        Raises:
            ServerError: If there is no free port.
        """
        self._address, self._target = address, target
        self._listener: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._is_open = False
        self.links: set[Link] = set()
        with bind(address, 0) as sock:
            self.number: int = sock.getsockname()[1]

    @property
    def outgoing_ports(self) -> list[int]:
        """Ports from which the robot is reached."""
        return [link.outgoing_port for link in self.links]

    def open(self) -> None:
        """Listen, if it does not; where another program has the port, try later."""
        if self._is_open:
            return
        with suppress(ServerError, OSError):
            sock = bind(self._address, self.number)
            sock.listen()  # at once, as the robot that has asked connects now
            self._is_open = True
            self._run(self._serve(sock))

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)  # else it may be forgotten before it is done
        task.add_done_callback(self._tasks.discard)

    async def _serve(self, sock: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        self._listener = await loop.create_server(self._accept, sock=sock)
        if not self._is_open:  # closed meanwhile
            self.close()

    def _accept(self) -> asyncio.BaseProtocol:
        return Pipe(self._link)

    def _link(self, pipe: Pipe) -> None:
        """Connect a caller with the robot, or close its connection."""
        place = self._target() if self._is_open else None
        if place is None:
            pipe.close()
            return
        link = Link(pipe, self.links.discard)
        self.links.add(link)
        self._run(link.connect(*place))

    def close(self) -> None:
        """Stop listening, and close all connections through it."""
        self._is_open = False
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        for link in list(self.links):
            link.close()


class Pipe(asyncio.Protocol):
    """An end of a link: what comes is written to the other end."""

    def __init__(self, ready: Callable[[Pipe], None]) -> None:
        """Create the protocol of a connection; ``ready`` is called once it is made."""
        self._ready = ready
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
        self._ready(self)

    def join(self, other: Pipe) -> None:
        """Pass on what comes from now on."""
        self.other = other
        self._read_on()

    @property
    def local_port(self) -> int:
        """The port of this program at this end."""
        assert self._transport is not None
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    def data_received(self, data: bytes) -> None:
        """Pass on data, and rest, so that robots have time whatever is sent."""
        assert self.other is not None
        self.other.write(data)
        self._is_resting = True
        self._read_on()
        asyncio.get_running_loop().call_later(REST, self._wake)

    def write(self, data: bytes) -> None:
        """Write data to this end."""
        if self._transport is not None:
            self._transport.write(data)

    def pause_writing(self) -> None:
        """Let the other end wait."""
        self._let_other_read(has_room=False)

    def resume_writing(self) -> None:
        """Let the other end go on."""
        self._let_other_read(has_room=True)

    def connection_lost(self, _: Exception | None) -> None:
        """Close the other end as well."""
        self._transport = None
        self.closed()

    def close(self) -> None:
        """Close this end, once what is written has been sent."""
        if self._transport is not None:
            self._transport.close()

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

    def __init__(self, near: Pipe, forget: Callable[[Link], None]) -> None:
        """Begin with the end of the robot that came.

        Args:
            near: Its end.
            forget: Called once the link is closed.
        """
        self.outgoing_port = 0
        self._near, self._far = near, Pipe(lambda _: None)
        self._forget = forget
        self._is_closed = False
        near.closed = self._far.closed = self.close

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
        self.outgoing_port = self._far.local_port
        if self._is_closed:
            self._far.close()
            return
        self._near.join(self._far)
        self._far.join(self._near)

    def close(self) -> None:
        """Close both ends."""
        if not self._is_closed:
            self._is_closed = True
            self._forget(self)
            self._near.close()
            self._far.close()
