"""A client for tests, which shows what the server sends as it comes."""

import socket
import time
from contextlib import suppress

TIMEOUT = 5.0  # s, of the wall clock; everything a client waits for comes sooner
SHORTEST_WAIT = 0.001  # s; 0 would mean not to wait even for what is there


class UsarsimClient:
    """A blocking client: lines out, lines in, nothing interpreted and nothing skipped.

    The first line read is the greeting, ``NFO {Gametype ...} {Level ...}``.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        """Connect.

        Raises:
            OSError: If nobody listens there.
        """
        self._socket = socket.create_connection(address, TIMEOUT)
        self._unread = b""

    def send(self, line: str) -> None:
        """Send one line; its end is added."""
        if "\r" in line or "\n" in line:
            raise ValueError(f"line {line[:80]!r}, expected no line end in it")
        self._socket.settimeout(TIMEOUT)
        self._socket.sendall(line.encode("latin-1") + b"\r\n")

    def read_line(self, timeout: float = TIMEOUT) -> str:
        """Wait for the next line, and give it without its end.

        Args:
            timeout: Longest wait, s of the wall clock.

        Raises:
            TimeoutError: If there is no whole line by then; what there is of it stays.
            ConnectionError: If the server has closed the connection.
        """
        deadline = time.monotonic() + timeout
        while b"\r\n" not in self._unread:
            self._unread += self._receive(deadline)
        line, _, self._unread = self._unread.partition(b"\r\n")
        return line.decode("latin-1")

    def read_until(self, verb: str, *parts: str, timeout: float = TIMEOUT) -> str:
        """Skip lines up to one of some kind, and give that.

        Args:
            verb: What the line begins with.
            parts: What else is in it, such as ``"{Type RangeScanner}"``.
            timeout: Longest wait for it, s of the wall clock.

        Raises:
            TimeoutError: If none has come by then; says what came last.
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
        """End the connection, upon which the robot leaves the floor."""
        self._socket.close()

    def _receive(self, deadline: float) -> bytes:
        left = max(deadline - time.monotonic(), SHORTEST_WAIT)
        self._socket.settimeout(left)
        try:
            data = self._socket.recv(65536)
        except TimeoutError:
            so_far = f"{self._unread[:80]!r} is there of it"
            raise TimeoutError(f"no line in time, {so_far}") from None
        if not data:
            raise ConnectionError("the server has closed the connection")
        return data
