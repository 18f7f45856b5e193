"""Fixtures for the test suites of USARSim clients; pytest finds them by itself.

``usarsim_server`` is a server that runs while one test does, on a free port of
127.0.0.1, in a thread and an event loop of its own: blocking clients can talk to it,
and asynchronous ones from the test's loop. ``usarsim_client`` is a blocking client
that is connected to it.

    def test_my_client_reads_the_level(usarsim_server):
        with MyClient(usarsim_server.host, usarsim_server.port) as client:
            assert client.level == "DM-EmptyRoom"

    @pytest.mark.usarsim(map="foliage_room", seed=1, speed=5)
    def test_scan(usarsim_client):
        usarsim_client.send("INIT {ClassName USARBot.P3AT} {Start RobotStart1}")
        line = usarsim_client.read_until("SEN", "{Type RangeScanner}")
        assert line.count(",") == 180

A suite chooses its map for all tests by a ``usarsim_map`` fixture of its own, and with
the marker ``usarsim`` for a module, a class or a test: ``map``, ``seed``, ``dialect``,
``speed`` as the options of ``radarsim serve``, and ``settings`` as its ``--set``:
``settings={"lms200": {"max_range": 20}}``. Of each, the mark nearest to the test counts.

A server that cannot start fails the test's set-up; what goes wrong inside a running one
closes its connections and fails the test's teardown. What it logs is in ``caplog``.

Nothing else of radarsim is imported before a test asks for a server.
"""

import math
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    import asyncio

    from radarsim.host import Host
    from radarsim.scene.scene import Scene

MARKER = (
    "usarsim(map='empty_room', seed=0, dialect='compat', speed=1, settings={}):"
    " what the usarsim_server of a test serves, and how"
)
TIMEOUT = 5.0  # s, of the wall clock; everything a client waits for comes sooner
MOST_START = 60.0  # s
MOST_STOP = 5.0  # s; it takes some milliseconds


@dataclass(frozen=True, slots=True)
class UsarsimServer:
    """Where a running server listens.

    Attributes:
        host: Address, always 127.0.0.1.
        port: A free one.
    """

    host: str
    port: int

    @property
    def address(self) -> tuple[str, int]:
        """Host and port, as ``socket.create_connection`` takes them."""
        return self.host, self.port


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


class _ServerThread(threading.Thread):
    """Runs a server in a loop of its own, and keeps what goes wrong there."""

    def __init__(self, host: "Host", speed: float) -> None:
        super().__init__(name="usarsim_server", daemon=True)
        self.address = ("", 0)
        self._host = host
        self._speed = speed
        self._errors: list[BaseException] = []
        self._up = threading.Event()
        self._end = lambda: None

    def run(self) -> None:
        import asyncio

        try:
            with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
                runner.run(self._serve())
        except BaseException as error:  # noqa: BLE001 - the test is told
            self._errors.append(error)
        finally:
            self._up.set()

    async def _serve(self) -> None:
        import asyncio

        from radarsim.server import Server

        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._note)
        ended = asyncio.Event()
        self._end = lambda: loop.call_soon_threadsafe(ended.set)
        server = Server(self._host, speed=self._speed)
        try:
            await server.start(port=0)
            self.address = server.address
            self._up.set()
            waits = [asyncio.ensure_future(w) for w in (server.failed(), ended.wait())]
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await server.stop()
            await asyncio.sleep(0)  # sockets close in the loop's next round

    def _note(self, _: object, context: dict[str, Any]) -> None:
        error = context.get("exception") or RuntimeError(context["message"])
        self._errors.append(error)
        self._end()
