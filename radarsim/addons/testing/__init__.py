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

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from radarsim.addons.testing.client import UsarsimClient
from radarsim.errors import RadarsimError

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
DEFAULTS: dict[str, Any] = {
    "seed": 0,
    "dialect": "compat",
    "speed": 1.0,
    "settings": {},
}


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
    # Imported here, so that pytest starts fast where no test uses a server.
    from radarsim.addons.testing.server_thread import ServerThread, make_host  # noqa: PLC0415

    options = _options(request.node, usarsim_map)
    try:
        thread = ServerThread(make_host(options), speed=options["speed"])
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
    options = dict(DEFAULTS, map=map_)
    for mark in reversed(list(item.iter_markers("usarsim"))):
        if mark.args or not mark.kwargs.keys() <= options.keys():
            came = ", ".join([*map(repr, mark.args), *mark.kwargs])[:80]
            expected = f"expected some of {sorted(options)} by name"
            pytest.fail(f"mark usarsim({came}), {expected}", pytrace=False)
        options |= mark.kwargs
    return options
