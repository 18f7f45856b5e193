"""What bytes travel on between a client that waits and a server.

A link has a time of its own: that of the wall for a socket, simulated time where client
and server take turns in one process. Clients wait by it and look at no other clock.
"""

import socket
import time
from contextlib import suppress
from typing import Protocol

from radarsim.client.session import check_timeout
from radarsim.errors import ClientError

SHORTEST_WAIT = 0.001  # s; 0 would mean not to wait even for what is there
CHUNK = 65536  # bytes
LAST_WORDS = 0.2  # s that a server has to take what was sent last
STUCK = "the server takes nothing any more"


class Transport(Protocol):
    """A connection to a server; see ``SocketTransport`` for one.

    A ``ConnectionError`` says in its text what happened, for the sentence that a
    ``ClientError`` makes of it.
    """

    def send(self, data: bytes) -> None:
        """Hand over bytes, all of them.

        Raises:
            ConnectionError: If the server does not take them, or the link is closed.
        """

    def receive(self, timeout: float) -> bytes:
        """Wait for bytes; never gives none.

        Args:
            timeout: Longest wait, s of the link's time. What is there already comes
                even if this is not above 0.

        Raises:
            TimeoutError: If nothing has come by then.
            ConnectionError: If the link is closed, by whichever side.
        """

    def time(self) -> float:
        """Give the time by which this link waits, s since whenever."""

    def close(self) -> None:
        """Let go of the server; more than once does nothing more."""


class SocketTransport:
    """A TCP connection, timed by the wall clock."""

    def __init__(self, host: str, port: int, *, timeout: float = 5.0) -> None:
        """Connect.

        Args:
            host: Name or address.
            port: TCP port.
            timeout: Longest wait, s, for the connection and for the server to take
                what is sent.

        Raises:
            ClientError: If nobody answers there.
            ValueError: If the timeout is not above 0.
        """
        check_timeout(timeout)
        self._timeout = timeout
        self._stuck = False
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except OSError as error:
            raise ClientError(f"no server at {host}:{port}: {error}") from None
        with suppress(OSError):  # orders to drive are short, and urgent
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        """Send bytes, as ``Transport.send``; after half a line nothing more is sent."""
        if self._stuck:
            raise ConnectionError(STUCK)
        try:
            self._socket.settimeout(self._timeout)
            self._socket.sendall(data)
        except TimeoutError:
            self._stuck = True
            raise ConnectionError(STUCK) from None
        except OSError as error:
            raise ConnectionError(f"the connection is lost: {error}") from None

    def receive(self, timeout: float) -> bytes:
        """Wait for bytes, as ``Transport.receive``."""
        try:
            self._socket.settimeout(max(timeout, SHORTEST_WAIT))
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            raise
        except OSError as error:
            raise ConnectionError(f"the connection is lost: {error}") from None
        if not data:
            raise ConnectionError("the server closed the connection")
        return data

    def time(self) -> float:
        """Give the time of the wall's steady clock, s."""
        return time.monotonic()

    def close(self) -> None:
        """Close the socket, upon which a server takes the robot off the floor.

        What the server still says is read away for a moment: a socket that is closed
        before may take the last orders back, one that the robot stops among them.
        """
        if self._socket.fileno() < 0:
            return
        until = time.monotonic() + LAST_WORDS
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            while (left := until - time.monotonic()) > 0:
                self._socket.settimeout(left)
                if not self._socket.recv(CHUNK):
                    break
        self._socket.close()
