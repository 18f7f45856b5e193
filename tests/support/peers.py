"""Peers of servers, with sockets of their own."""

import asyncio
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Self

DEADLINE = 240.0  # s of the wall clock, for what a busy machine does late


class Peer:
    """A connection to a server."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.reader, self.writer = reader, writer

    @classmethod
    async def connect(cls, address: tuple[str, int], *, small: bool = False) -> Self:
        """Connect; a small one that does not read soon fills its buffer."""
        sock = socket.socket()
        if small:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.setblocking(False)
        try:
            await asyncio.get_running_loop().sock_connect(sock, address)
        except OSError:
            sock.close()
            raise
        return cls(*await asyncio.open_connection(sock=sock, limit=2**14))

    @property
    def transport(self) -> asyncio.Transport:
        transport = self.writer.transport
        assert isinstance(transport, asyncio.Transport)
        return transport

    async def send(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def line(self) -> bytes:
        return await asyncio.wait_for(self.reader.readline(), DEADLINE)

    async def until(self, part: bytes) -> bytes:
        """Return the next line that contains a part, or nothing at the end."""
        while line := await self.line():
            if part in line:
                break
        return line

    async def rest(self) -> bytes:
        """Read to the end of the connection, however it ends."""
        with suppress(ConnectionError):
            return await asyncio.wait_for(self.reader.read(), DEADLINE)
        return b""

    def reset(self) -> None:
        """Break the connection without closing it."""
        sock = self.writer.get_extra_info("socket")
        linger = struct.pack("ii", 1, 0)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.transport.abort()

    async def close(self) -> None:
        self.writer.close()
        with suppress(ConnectionError):
            await self.writer.wait_closed()


async def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for what a server has no event for."""
    async with asyncio.timeout(DEADLINE):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.005)
