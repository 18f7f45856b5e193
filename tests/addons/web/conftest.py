import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
from web_pages import Page, open_page

from radarsim.addons.web.program import CommanderSettings, serve_page
from radarsim.addons.web.scene_message import SceneMessages
from radarsim.addons.web.time_control import TimeControl
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread
from radarsim.simulation.config import SimulationConfig

TOKEN = "a-token-of-tests-0123456789"


@dataclass(frozen=True, slots=True)
class RunningCommander:
    """A commander in a thread.

    Attributes:
        web: Host and port of the page.
        server: Host and port of the USARSim server.
        token: The token of the page.
    """

    web: str
    server: tuple[str, int]
    token: str = TOKEN

    @property
    def url(self) -> str:
        return f"http://{self.web}/#token={self.token}"


Starter = Callable[..., AbstractContextManager[RunningCommander]]


class CommanderThread(threading.Thread):
    """Runs a commander in an event loop of its own."""

    def __init__(self, settings: CommanderSettings) -> None:
        super().__init__(daemon=True)
        self.address = ("", 0)
        self._settings = settings
        self._is_up = threading.Event()

    def begin(self) -> str:
        self.start()
        self._is_up.wait()
        return f"{self.address[0]}:{self.address[1]}"

    def finish(self) -> None:
        self._loop.call_soon_threadsafe(self._end.set_result, None)
        self.join(240)
        assert not self.is_alive()

    def run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._end = self._loop.create_future()
        try:
            time = TimeControl()
            await serve_page(self._settings, self._announce, self._end, time)
        finally:
            self._is_up.set()

    def _announce(self, address: tuple[str, int]) -> None:
        self.address = address
        self._is_up.set()


@pytest.fixture
def server(
    foliage_room: Scene, request: pytest.FixtureRequest
) -> Iterator[tuple[str, int]]:
    """Serve a room with bushes, and return host and port; its parameter is a speed."""
    thread = ServerThread(Host(foliage_room), speed=getattr(request, "param", 1.0))
    address = thread.begin()
    yield address
    thread.finish()


@pytest.fixture(scope="session")
def scene_messages(foliage_room: Scene) -> SceneMessages:
    return SceneMessages(foliage_room)


@pytest.fixture
def commander(server: tuple[str, int]) -> Iterator[RunningCommander]:
    """Run a commander for the room."""
    with run_commander(server, map="foliage_room") as running:
        yield running


@pytest.fixture
async def page(commander: RunningCommander) -> AsyncIterator[Page]:
    """Open the page of the commander."""
    async with open_page(commander.web, commander.token) as page:
        yield page


@pytest.fixture(scope="session")
def start_commander() -> Starter:
    """Return the context in which a commander of a server runs."""
    return run_commander


@contextmanager
def run_commander(
    server: tuple[str, int] | None, **settings: Any
) -> Iterator[RunningCommander]:
    """Run a commander.

    Args:
        server: Host and port of the server; None of a recording.
        settings: Of ``CommanderSettings``.
    """
    usual: dict[str, Any] = {"web_host": "127.0.0.1", "web_port": 0, "token": TOKEN}
    usual |= {"config": SimulationConfig()}
    thread = CommanderThread(CommanderSettings(server=server, **usual | settings))
    yield RunningCommander(thread.begin(), server or ("", 0))
    thread.finish()
