from collections.abc import AsyncIterator, Iterator

import pytest
from served_page import Served, run_commander
from web_pages import Page, open_page

from radarsim.addons.web.scene_message import SceneMessages
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread


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
def commander(server: tuple[str, int]) -> Iterator[Served]:
    """Run a commander for the room."""
    with run_commander(server, map_="foliage_room") as running:
        yield running


@pytest.fixture
async def page(commander: Served) -> AsyncIterator[Page]:
    """Open the page of the commander."""
    async with open_page(commander) as page:
        yield page
