"""Serves the page over HTTP, and exchanges messages with browsers over WebSockets.

HTTP serves only the files of the page. The first message on a WebSocket has to contain
the token, and the number of messages that a browser may send in a second is limited.
"""

import asyncio
import mimetypes
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from radarsim.addons.web.commander import Commander
from radarsim.addons.web.requests import (
    LONGEST_MESSAGE,
    MESSAGES_PER_SECOND,
    BadRequest,
    Hello,
    parse_request,
)
from radarsim.addons.web.server_link import Link, ParentLink, ServerLink
from radarsim.addons.web.viewers import SlowViewer
from radarsim.errors import RadarsimError
from radarsim.listening import bind, first_of, in_daemon_thread
from radarsim.plotting.palette import PAGE_COLOURS
from radarsim.server.web_server import AllowedHosts, HostCheck, WebServer, is_token
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.web.cli import PageOptions
    from radarsim.addons.web.scene_message import SceneMessages

PAGE: Final = Path(__file__).parent / "page"
HELLO_TIMEOUT: Final = 5.0  # s; timeout for the first message
# Close codes of WebSockets, in addition to the codes that the protocol defines.
WRONG_TOKEN, NO_HELLO, SLOW, TOO_FAST = 4401, 4408, 4409, 4429
# The MIME tables of some systems list JavaScript as plain text.
mimetypes.add_type("text/css", ".css")
mimetypes.add_type("text/javascript", ".js")
mimetypes.add_type("image/svg+xml", ".svg")


async def serve_page(
    server: tuple[str, int] | Path,
    page: "PageOptions",
    config: SimulationConfig,
    *,
    token: str,
    map_: str | None,
    end: asyncio.Future[Any],
    announce: Callable[[tuple[str, int]], None],
    is_child: bool = False,
) -> None:
    """Serve the page until the future ``end`` is done.

    Args:
        server: Host and port of the USARSim server, or the folder of a recording that
            is played instead.
        page: Address and port of the page, and the folder for its recordings.
        config: How the server was started, as far as it is known.
        token: Token that a browser has to send.
        map_: Name or path of the map that the server serves; None if it is not known.
        end: Future that is done when serving has to end; its result is the exit code.
        announce: Called with address and port as soon as browsers can connect.
        is_child: Whether the server runs in the parent process, which checks the map.
            The page ends with the parent. Without a parent, the map is loaded before
            browsers can connect.

    Raises:
        MapError: If the map is wrong.
        RecordingError: If the recording cannot be read.
        ServerError: If the address or the port of the page cannot be used.
    """
    with bind(page.web_host, page.web) as listening, ExitStack() as stack:
        address = listening.getsockname()[:2]
        link: Link
        if isinstance(server, Path):
            from radarsim.addons.recording.bag import BagReader  # noqa: PLC0415
            from radarsim.addons.web.playback import (  # noqa: PLC0415
                Playback,
                RecordedLines,
            )

            bag = BagReader(server)
            lines = RecordedLines(stack.enter_context(bag.open()), bag.info)
            link = Playback(lines)
        elif is_child:
            link = ParentLink(server)
            link.follow(end)
        else:
            link = ServerLink(server)
        commander = Commander(link, config, page.record_to, map_=map_)
        allowed = AllowedHosts(page.web_host, address[1])
        app = create_app(commander, allowed, token)
        web = WebServer(app, lambda: announce(address), longest_message=LONGEST_MESSAGE)
        loading = asyncio.ensure_future(in_daemon_thread(_load_scene, map_))
        # The parent process has checked the map, so a child process accepts browsers
        # before the map is loaded.
        if not is_child:
            await asyncio.wait({end, loading}, return_when=asyncio.FIRST_COMPLETED)
            if end.done():
                return
            loading.result()  # raises errors of the map
        working = asyncio.ensure_future(_work(commander, loading))
        serving = asyncio.ensure_future(web.serve([listening]))
        try:
            pending: set[asyncio.Future[Any]] = {end, working, serving}
            await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        finally:
            # Browsers are disconnected first, so that the robots they drive stop.
            web.should_exit = True
            await asyncio.wait({serving})
            working.cancel()
            await asyncio.wait({working})
        for task in (working, serving):
            if not task.cancelled():
                task.result()  # raises the error that ended it


async def _work(
    commander: Commander, loading: "asyncio.Future[SceneMessages | None]"
) -> None:
    """Run a commander, and load the map and slow imports in the background."""
    running = asyncio.ensure_future(commander.run())
    try:
        scene = await loading
        if scene is not None:
            commander.show_scene(scene)
        await in_daemon_thread(import_module, "radarsim.addons.web.algorithms")
        await running
    finally:
        running.cancel()
        await asyncio.wait({running})


def _load_scene(map_: str | None) -> "SceneMessages | None":
    if map_ is None:
        return None
    from radarsim.addons.web.scene_message import SceneMessages  # noqa: PLC0415
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    return SceneMessages(load_map(map_))


def create_app(commander: Commander, allowed: AllowedHosts, token: str) -> Starlette:
    """Create the web application.

    Args:
        commander: Executes the requests of browsers, and sends them the state.
        allowed: Host names under which requests are accepted.
        token: Token that a browser has to send.
    """

    async def talk(socket: WebSocket) -> None:
        await socket.accept()
        with suppress(WebSocketDisconnect):
            refusal = await _await_hello(socket, token)
            if refusal is None:
                await _talk(socket, commander)
            else:
                await socket.close(refusal)

    style = palette_style()
    routes = [
        Route("/", lambda _: FileResponse(PAGE / "index.html")),
        Route("/static/palette.css", lambda _: Response(style, media_type="text/css")),
        Mount("/static", StaticFiles(directory=PAGE)),
        WebSocketRoute("/ws", talk),
    ]
    return Starlette(routes=routes, middleware=[Middleware(HostCheck, allowed=allowed)])


def palette_style() -> str:
    """Return a style sheet with the colours for light and for dark mode."""
    light, dark = (
        "".join(f"--{name}:{both[scheme]};" for name, both in PAGE_COLOURS.items())
        for scheme in (0, 1)
    )
    return (
        f":root{{{light}}}\n@media (prefers-color-scheme: dark) {{:root{{{dark}}}}}\n"
    )


async def _await_hello(socket: WebSocket, token: str) -> int | None:
    """Return None if the first message has the token, else the WebSocket close code."""
    try:
        # A timeout closes connections that send nothing, so that they do not use up the
        # server's connections.
        async with asyncio.timeout(HELLO_TIMEOUT):
            hello = parse_request(await _receive(socket))
    except TimeoutError:
        return NO_HELLO
    except BadRequest:
        return WRONG_TOKEN
    if isinstance(hello, Hello) and is_token(hello.token, token):
        return None
    return WRONG_TOKEN


async def _talk(socket: WebSocket, commander: Commander) -> None:
    """Exchange messages with a browser until either side ends the connection."""
    viewer = commander.join()

    async def hear() -> int:
        """Execute requests until they arrive too fast; return the close code."""
        clock = asyncio.get_running_loop().time
        newest: deque[float] = deque(maxlen=MESSAGES_PER_SECOND)
        while len(newest) < MESSAGES_PER_SECOND or clock() - newest[0] >= 1.0:
            newest.append(clock())
            text = await _receive(socket)
            try:
                commander.act(viewer, parse_request(text))
            except RadarsimError as error:
                viewer.send({"op": "error", "text": str(error)})
        return TOO_FAST

    async def send() -> int:
        """Send queued messages until the browser is too slow; return the close code."""
        with suppress(SlowViewer):
            async for data in viewer.outgoing():
                if isinstance(data, str):
                    await socket.send_text(data)
                else:
                    await socket.send_bytes(data)
        return SLOW

    with suppress(RuntimeError):  # the socket is closed already
        try:
            code: int = await first_of(send(), hear())
        finally:
            commander.leave(viewer)
        await socket.close(code)


async def _receive(socket: WebSocket) -> str:
    """Return the next message; the web server refuses messages that are too long.

    Raises:
        WebSocketDisconnect: If the browser is gone.
    """
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    return message.get("text") or ""  # binary messages are no requests
