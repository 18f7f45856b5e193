"""Transports, which send and receive the bytes of a blocking client.

Each transport has a clock: the wall clock for a socket, or simulated time if client and
server run in lockstep in one process. Timeouts of clients use only this clock.
"""

import errno
import selectors
import socket
import threading
import time
from contextlib import suppress
from typing import Protocol

from radarsim.client.session import check_timeout
from radarsim.errors import (
    ClientError,
    describe_os_error,
    error_number,
    join_address,
)

SHORTEST_WAIT = 0.001  # s; a timeout of 0 would expire before received data is read
CHUNK = 65536  # bytes per read
CLOSE_GRACE = 0.2  # s for the server to read the last commands before the close
LOCAL_HOSTS = ("", "localhost", "0.0.0.0", "::", "::1")
DEFAULT_PORT = 3000  # default port of USARSim
CLOSED = "the connection is closed"
STUCK = "the server has stopped reading"


def no_server(host: str, port: int, error: OSError | UnicodeError) -> ClientError:
    """Create the error for an unreachable server, with a hint for a local address."""
    at = f"no server at {join_address(host, port)}"
    is_local = host in LOCAL_HOSTS or host.startswith("127.")
    is_refused = (
        isinstance(error, OSError) and error_number(error) == errno.ECONNREFUSED
    )
    if is_local and is_refused:
        option = "" if port == DEFAULT_PORT else f" --port {port}"
        return ClientError(f"{at}; start one with: radarsim serve foliage_room{option}")
    return ClientError(f"{at}: {describe_os_error(error)}")


def lost(error: OSError) -> ConnectionError:
    """Create the error for a connection that the operating system reports as broken."""
    return ConnectionError(f"the connection is lost: {describe_os_error(error)}")


class Transport(Protocol):
    """The interface of a blocking connection to a server, such as ``SocketTransport``.

    The text of a ``ConnectionError`` becomes the start of the ``ClientError`` that the
    client raises.
    """

    def send(self, data: bytes) -> None:
        """Send all bytes to the server.

        Raises:
            ConnectionError: If the server does not accept the bytes, or the transport
                is closed.
        """

    def receive(self, timeout: float) -> bytes:
        """Wait for bytes from the server, and return at least one byte.

        Args:
            timeout: Longest wait, s. If it is 0 or less, bytes that have already
                arrived are still returned.

        Raises:
            TimeoutError: If no bytes arrive in time.
            ConnectionError: If either side has closed the connection.
        """

    def time(self) -> float:
        """Return the time of the clock by which a client measures timeouts, s."""

    def close(self) -> None:
        """Close the connection; a waiting ``receive`` in another thread then raises.

        Further calls of ``close`` have no effect.
        """


class SocketTransport:
    """A TCP connection to a server; timeouts are measured by the wall clock."""

    def __init__(self, host: str, port: int, *, timeout: float = 5.0) -> None:
        """Connect to a server.

        Args:
            host: Name or address.
            port: TCP port.
            timeout: Timeout of the connection attempt and of sending, s.

        Raises:
            ClientError: If the connection cannot be opened.
            ValueError: If the timeout is not above 0.
        """
        check_timeout(timeout)
        self._timeout = timeout
        self._stuck = False
        self._closed = threading.Event()
        self._receiving = threading.Lock()
        try:
            # An invalid host name raises a UnicodeError when it is encoded for DNS.
            self._socket = socket.create_connection((host, port), timeout)
        except (OSError, UnicodeError) as error:
            raise no_server(host, port, error) from None
        with suppress(OSError):  # short commands are sent without Nagle's delay
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # Receiving uses the timeout of a selector, because the timeout of the socket
        # applies to sending.
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)

    def send(self, data: bytes) -> None:
        """Send all bytes to the server; after a timeout, every further call raises.

        Raises:
            ConnectionError: If the server does not accept the bytes, or the transport
                is closed.
        """
        if self._stuck:
            raise ConnectionError(STUCK)
        try:
            self._socket.sendall(data)
        except TimeoutError:
            # The server may have half a line, and would take the next line as the rest.
            self._stuck = True
            raise ConnectionError(STUCK) from None
        except OSError as error:
            raise lost(error) from None

    def receive(self, timeout: float) -> bytes:
        """Wait for bytes from the server, and return at least one byte."""
        with self._receiving:
            if self._closed.is_set():
                raise ConnectionError(CLOSED)
            if not self._selector.select(max(timeout, SHORTEST_WAIT)):
                raise TimeoutError
            try:
                data = self._socket.recv(CHUNK)
            except OSError as error:
                text = CLOSED if self._closed.is_set() else str(lost(error))
                raise ConnectionError(text) from None
        if not data:
            text = "the server closed the connection"
            raise ConnectionError(CLOSED if self._closed.is_set() else text)
        return data

    def time(self) -> float:
        """Return the time, s, of a wall clock that never goes back."""
        return time.monotonic()

    def close(self) -> None:
        """Close the socket; the server then removes the robot.

        Before the socket is closed, data from the server is read and dropped for up to
        0.2 s. Closing a socket with unread data would reset the connection, and the
        server might lose the last commands, such as the one that stops the robot.
        """
        if self._closed.is_set():
            return
        self._closed.set()
        until = time.monotonic() + CLOSE_GRACE
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            while (left := until - time.monotonic()) > 0:
                self._socket.settimeout(left)
                if not self._socket.recv(CHUNK):
                    break
        with suppress(OSError):  # this wakes a thread that waits in receive()
            self._socket.shutdown(socket.SHUT_RDWR)
        with self._receiving:
            self._selector.close()
            self._socket.close()
