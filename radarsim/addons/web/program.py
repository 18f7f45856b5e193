"""The program: listens for browsers, and ends by a signal or with its parent."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from radarsim.addons.web.activities import import_algorithms, load_algorithms
from radarsim.addons.web.app import create_app
from radarsim.addons.web.commander import Commander
from radarsim.addons.web.requests import LONGEST_MESSAGE
from radarsim.listening import bind, exit_code_of_signal
from radarsim.server.web_server import Doors, WebServer
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.web.scene_message import SceneMessages

FIRST_LOOK: Final = 3.0  # s in which nothing takes time from the first browser


@dataclass(frozen=True, slots=True, kw_only=True)
class CommanderSettings:
    """How the commander is set up.

    Attributes:
        server: Host and port of the USARSim server.
        web_host: Address to listen on for browsers.
        web_port: Port to listen on; 0 for a free one.
        token: What a browser has to know.
        config: How the server was started, as far as it is known.
        map: Name or file of the map that it serves; None if it is not known.
        record_to: Folder in which each recording gets one of its own.
        is_child: Whether to end when stdin is closed. The parent checks the map; else
            it is loaded before browsers can connect.
    """

    server: tuple[str, int]
    web_host: str
    web_port: int
    token: str
    config: SimulationConfig
    map: str | None = None
    record_to: Path = Path()
    is_child: bool = False


async def run_commander(
    settings: CommanderSettings, announce: Callable[[tuple[str, int]], None]
) -> int:
    """Serve the page until a signal comes, or the parent process ends.

    Args:
        settings: How the commander is set up.
        announce: Called with address and port as soon as browsers can connect.

    Returns:
        The exit code that the signal asks for.

    Raises:
        MapError: If the map is wrong.
        ServerError: If it cannot listen.
    """
    with exit_code_of_signal() as exit_code:
        if settings.is_child:
            _end_with_stdin(exit_code)
        await serve_page(settings, announce, exit_code)
        return exit_code.result() if exit_code.done() else 0


async def serve_page(
    settings: CommanderSettings,
    announce: Callable[[tuple[str, int]], None],
    end: asyncio.Future[Any],
) -> None:
    """Serve the page until a future is done; arguments and errors as above."""
    with bind(settings.web_host, settings.web_port) as listening:
        address = listening.getsockname()[:2]
        commander = Commander(settings.server, settings.config, settings.record_to)
        doors = Doors(settings.web_host, address[1])
        app = create_app(commander, doors, settings.token)
        server = WebServer(
            app, lambda: announce(address), longest_message=LONGEST_MESSAGE
        )
        loading = asyncio.ensure_future(_load(settings.map))
        if not settings.is_child:
            await asyncio.wait({end, loading}, return_when=asyncio.FIRST_COMPLETED)
            if end.done():
                return
            loading.result()  # raises what is wrong with the map
        working = asyncio.ensure_future(_work(commander, loading))
        serving = asyncio.ensure_future(server.serve([listening]))
        try:
            pending: set[asyncio.Future[Any]] = {end, working, serving}
            await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        finally:
            server.should_exit = True
            await asyncio.wait({serving})
            working.cancel()
            await asyncio.wait({working})
        for task in (working, serving):
            if not task.cancelled():
                task.result()  # raises what ended it


async def _work(
    commander: Commander, loading: asyncio.Future[SceneMessages | None]
) -> None:
    """Run a commander, and meanwhile load what takes long."""
    running = asyncio.ensure_future(commander.run())
    try:
        scene = await loading
        if scene is not None:
            commander.show_scene(scene)
        await _in_thread(import_algorithms)
        await asyncio.sleep(FIRST_LOOK)
        await _in_thread(load_algorithms)
        await running
    finally:
        running.cancel()
        await asyncio.wait({running})


async def _load(map_: str | None) -> SceneMessages | None:
    return None if map_ is None else await _in_thread(_load_scene, map_)


def _load_scene(map_: str) -> SceneMessages:
    from radarsim.addons.web.scene_message import SceneMessages  # noqa: PLC0415
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    return SceneMessages.of(load_map(map_))


async def _in_thread(function: Callable[..., Any], *arguments: object) -> Any:
    """Call a function in a thread for which the end of the program does not wait."""
    loop = asyncio.get_running_loop()
    result: asyncio.Future[Any] = loop.create_future()

    def tell(value: Any, error: Exception | None) -> None:
        if result.cancelled():
            return
        if error is None:
            result.set_result(value)
        else:
            result.set_exception(error)

    def run() -> None:
        value, failure = None, None
        try:
            value = function(*arguments)
        except Exception as error:  # noqa: BLE001 - raised where it is awaited
            failure = error
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(tell, value, failure)

    threading.Thread(target=run, daemon=True).start()
    return await result


def _end_with_stdin(exit_code: asyncio.Future[int]) -> None:
    """Set an exit code of 0 when stdin is closed, as when the parent has ended."""
    loop = asyncio.get_running_loop()

    def end() -> None:
        if not exit_code.done():
            exit_code.set_result(0)

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 1):
            pass
        loop.call_soon_threadsafe(end)

    threading.Thread(target=wait, daemon=True).start()
