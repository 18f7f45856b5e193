"""Pytest fixtures for tests of USARSim clients; pytest loads this module as a plugin.

``usarsim_server`` is a server that runs during one test, on a free port of 127.0.0.1.
It has its own thread and event loop, so both blocking clients and asynchronous clients
in the test's event loop can use it. ``usarsim_client`` is a blocking client that is
connected to it.

    def test_my_client_reads_the_level(usarsim_server):
        with MyClient(usarsim_server.host, usarsim_server.port) as client:
            assert client.level == "DM-EmptyRoom"

    @pytest.mark.usarsim(map="foliage_room", seed=1, speed=5)
    def test_scan(usarsim_client):
        usarsim_client.send("INIT {ClassName USARBot.P3AT} {Start RobotStart1}")
        line = usarsim_client.read_until("SEN", "{Type RangeScanner}")
        assert line.count(",") == 180

To choose the map of all tests, override the fixture ``usarsim_map``. The marker
``usarsim`` sets options for a module, a class or a test: ``map``, ``seed``, ``dialect``
and ``speed`` as in ``radarsim serve``, and ``settings`` as in its ``--set``, such as
``settings={"lms200": {"max_range": 20}}``. The mark closest to a test has priority.

If the server cannot start, the setup of the test fails. An error in a running server
closes its connections and fails the teardown of the test. Its log is in ``caplog``.

The rest of radarsim is imported only when a test uses a server.
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
    """The address of a running USARSim server.

    Attributes:
        host: Always 127.0.0.1.
        port: Port on which the server listens.
    """

    host: str
    port: int

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the server, as ``socket.create_connection`` needs them."""
        return self.host, self.port


class UsarsimClient:
    """A blocking client that sends and receives lines without interpreting them.

    The first line to read is the greeting, ``NFO {Gametype ...} {Level ...}``.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        """Connect to a USARSim server.

        Raises:
            OSError: If no server listens at the address.
        """
        self._socket = socket.create_connection(address, TIMEOUT)
        self._unread = b""

    def send(self, line: str) -> None:
        """Append CRLF to a line of text, and send the line to the server."""
        if "\r" in line or "\n" in line:
            raise ValueError(f"line {line[:80]!r}, expected no line break in it")
        self._socket.settimeout(TIMEOUT)
        self._socket.sendall(line.encode("latin-1") + b"\r\n")

    def read_line(self, timeout: float = TIMEOUT) -> str:
        """Wait for the next line of the server, and return the line without CRLF.

        Args:
            timeout: Longest wait, s of the wall clock.

        Raises:
            TimeoutError: If no whole line arrives in time; a partial line is kept.
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
        """Read lines until a line matches a pattern, and return this line.

        Args:
            verb: Start of the line.
            parts: Texts that the line contains, such as ``"{Type RangeScanner}"``.
            timeout: Longest wait for the line, s of the wall clock.

        Raises:
            TimeoutError: If no line matches in time; the message has the last line.
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
        """Close the connection; the server then removes the robot."""
        self._socket.close()


def pytest_configure(config: pytest.Config) -> None:
    """Register the pytest marker ``usarsim``."""
    config.addinivalue_line("markers", MARKER)


@pytest.fixture
def usarsim_map() -> str | Path:
    """Default map of all tests: name of a shipped map, or path of a map file."""
    return "empty_room"


@pytest.fixture
def usarsim_server(
    request: pytest.FixtureRequest, usarsim_map: str | Path
) -> Iterator[UsarsimServer]:
    """A USARSim server that runs during the test, on a free port of 127.0.0.1."""
    try:
        thread = make_thread(_options(request.node, usarsim_map))
    except (RadarsimError, ValueError) as error:
        text = f"usarsim_server cannot start: {error}"
        raise pytest.fail.Exception(text, pytrace=False) from None
    yield UsarsimServer(*thread.begin())
    thread.finish()


@pytest.fixture
def usarsim_client(usarsim_server: UsarsimServer) -> Iterator[UsarsimClient]:
    """A blocking client that is connected to the ``usarsim_server`` of the test."""
    with closing(UsarsimClient(usarsim_server.address)) as client:
        yield client


def _options(item: pytest.Item, map_: str | Path) -> dict[str, Any]:
    """Return a test's options; those of the mark closest to the test have priority."""
    options: dict[str, Any] = {"map": map_}
    for mark in reversed(list(item.iter_markers("usarsim"))):
        if mark.args:
            raise ValueError(f"mark usarsim{mark.args!r}, expected keyword arguments")
        options |= mark.kwargs
    return options


def make_thread(options: dict[str, Any]) -> "ServerThread":
    """Create the thread that runs a server with the options of a test.

    Raises:
        RadarsimError: If the map or the settings are wrong.
        ValueError: If another option is wrong or unknown, or has another type.
    """
    # These imports load the engine, Embree and shapely. They are delayed, so that
    # pytest starts fast if no test uses a server.
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
