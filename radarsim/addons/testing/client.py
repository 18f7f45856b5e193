"""A blocking client for tests, which returns the server's lines as they are."""

import socket
import time
from contextlib import suppress

TIMEOUT = 5.0  # s of the wall clock
MIN_WAIT = 0.001  # s; a socket timeout of 0 would make the socket non-blocking


class UsarsimClient:
    """A blocking client: lines out, lines in, nothing interpreted and nothing skipped.

    The first line read is the greeting, ``NFO {Gametype ...} {Level ...}``.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        """Connect.

        Raises:
            OSError: If there is no server.
        """
        self._socket = socket.create_connection(address, TIMEOUT)
        self._unread = b""

    def send(self, line: str) -> None:
        """Send one line, with CRLF appended."""
        if "\r" in line or "\n" in line:
            raise ValueError(f"line {line[:80]!r}, expected no line end in it")
        self._socket.settimeout(TIMEOUT)
        self._socket.sendall(line.encode("latin-1") + b"\r\n")

    def read_line(self, timeout: float = TIMEOUT) -> str:
        """Wait for the next line, and return it without its end.

        Args:
            timeout: Longest wait, s of the wall clock.

        Raises:
            TimeoutError: If no complete line comes by then; an incomplete one is kept.
            ConnectionError: If the server has closed the connection.
        """
        deadline = time.monotonic() + timeout
        while b"\r\n" not in self._unread:
            self._unread += self._receive(deadline)
        line, _, self._unread = self._unread.partition(b"\r\n")
        return line.decode("latin-1")

    def read_until(self, verb: str, *parts: str, timeout: float = TIMEOUT) -> str:
        """Skip lines up to one of a kind, and return it.

        Args:
            verb: Start of the line.
            parts: Texts that the line contains, such as ``"{Type RangeScanner}"``.
            timeout: Longest wait for it, s of the wall clock.

        Raises:
            TimeoutError: If none comes by then; names the last line.
            ConnectionError: If the server has closed the connection.
        """
        deadline = time.monotonic() + timeout
        line = ""
        while (left := deadline - time.monotonic()) > 0:
            with suppress(TimeoutError):
                line = self.read_line(left)
                if line.startswith(verb) and all(part in line for part in parts):
                    return line
        wanted = " ".join((verb, *parts))
        raise TimeoutError(
            f"no {wanted!r} within {timeout:g} s, the last line was {line[:80]!r}"
        )

    def close(self) -> None:
        """Close the connection, which removes the robot."""
        self._socket.close()

    def _receive(self, deadline: float) -> bytes:
        left = max(deadline - time.monotonic(), MIN_WAIT)
        self._socket.settimeout(left)
        try:
            data = self._socket.recv(65536)
        except TimeoutError:
            so_far = f"{self._unread[:80]!r} is there of it"
            raise TimeoutError(f"no line in time, {so_far}") from None
        if not data:
            raise ConnectionError("the server has closed the connection")
        return data
