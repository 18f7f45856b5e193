"""Fixtures for the test suites of USARSim clients, which pytest loads by itself.

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
``speed`` as the options of ``radarsim serve``, and ``settings`` as its ``--set``, such
as ``settings={"lms200": {"max_range": 20}}``. Of each, the mark nearest a test counts.

A server that cannot start fails the test's set-up; what goes wrong inside a running one
closes its connections and fails the test's teardown. What it logs is in ``caplog``.

Nothing else of radarsim is imported before a test asks for a server.
"""

import socket
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import pytest

from radarsim.errors import RadarsimError

if TYPE_CHECKING:
    from radarsim.server.server_thread import ServerThread

__all__ = [
    "UsarsimClient",
    "UsarsimServer",
    "usarsim_client",
    "usarsim_map",
    "usarsim_server",
]

MARKER = (
    "usarsim(map='empty_room', seed=0, dialect='compat', speed=1, settings={}):"
    " what the usarsim_server of a test serves, and how"
)
TIMEOUT = 5.0  # s of the wall clock
MIN_WAIT = 0.001  # s; a socket timeout of 0 would make the socket non-blocking


@dataclass(frozen=True, slots=True)
class UsarsimServer:
    """The address of a running server.

    Attributes:
        host: Always 127.0.0.1.
        port: Port that the server listens on.
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
            self._socket.settimeout(max(deadline - time.monotonic(), MIN_WAIT))
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                so_far = f"received {self._unread[:80]!r}"
                raise TimeoutError(f"no complete line in time, {so_far}") from None
            if not data:
                raise ConnectionError("the server has closed the connection")
            self._unread += data
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


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", MARKER)


@pytest.fixture
def usarsim_map() -> str | Path:
    """The map of tests without a mark: a shipped map's name, or a map file's path."""
    return "empty_room"


@pytest.fixture
def usarsim_server(
    request: pytest.FixtureRequest, usarsim_map: str | Path
) -> Iterator[UsarsimServer]:
    """A USARSim server that runs while the test does, on a free port of 127.0.0.1."""
    try:
        thread = make_thread(_options(request.node, usarsim_map))
    except (RadarsimError, ValueError) as error:
        text = f"usarsim_server cannot start: {error}"
        raise pytest.fail.Exception(text, pytrace=False) from None
    yield UsarsimServer(*thread.begin())
    thread.finish()


@pytest.fixture
def usarsim_client(usarsim_server: UsarsimServer) -> Iterator[UsarsimClient]:
    """A blocking client, connected to the test's ``usarsim_server``."""
    with closing(UsarsimClient(usarsim_server.address)) as client:
        yield client


def _options(item: pytest.Item, map_: str | Path) -> dict[str, Any]:
    """Return the options of a test; of several marks the nearest counts."""
    options: dict[str, Any] = {"map": map_}
    for mark in reversed(list(item.iter_markers("usarsim"))):
        if mark.args:
            raise ValueError(f"mark usarsim{mark.args!r}, expected options by name")
        options |= mark.kwargs
    return options


def make_thread(options: dict[str, Any]) -> "ServerThread":
    """Create the thread of a server with the options of a test.

    Raises:
        RadarsimError: If the map or the settings are wrong.
        ValueError: If another option is, or is of another type.
    """
    # Imported here, so that pytest starts fast where no test uses a server: they import
    # the engine, Embree and shapely.
    from annotated_types import Ge, Gt  # noqa: PLC0415
    from pydantic import (  # noqa: PLC0415
        BaseModel,
        ConfigDict,
        FiniteFloat,
        ValidationError,
    )

    from radarsim.protocol.dialect import get_dialect  # noqa: PLC0415
    from radarsim.scene.map_file import load_map  # noqa: PLC0415
    from radarsim.server.host import Host  # noqa: PLC0415
    from radarsim.server.server_thread import ServerThread  # noqa: PLC0415
    from radarsim.simulation.config import SimulationConfig  # noqa: PLC0415
    from radarsim.validation import describe_settings  # noqa: PLC0415

    class Options(BaseModel):
        model_config = ConfigDict(strict=True, extra="forbid")

        map: str | Path
        seed: Annotated[int, Ge(0)] = 0
        dialect: Literal["compat", "udk"] = "compat"
        speed: Annotated[FiniteFloat, Gt(0)] = 1.0
        settings: dict[str, dict[str, Any]] = {}

    try:
        checked = Options.model_validate(options)
    except ValidationError as error:
        raise ValueError(describe_settings(error, Options)[0]) from None
    scene = load_map(checked.map)
    config = SimulationConfig(
        get_dialect(checked.dialect), item_settings=checked.settings
    )
    host = Host(scene, config=config, seed=checked.seed)
    return ServerThread(host, speed=checked.speed)
