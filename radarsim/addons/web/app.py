"""The web application: the files of the page, and the WebSocket of each browser.

A browser may send only so many messages in a second.
"""

import asyncio
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from radarsim.addons.web.commander import Commander
from radarsim.addons.web.requests import (
    LONGEST_MESSAGE,
    MESSAGES_PER_SECOND,
    BadRequest,
    Hello,
    parse_request,
)
from radarsim.addons.web.viewer import SlowViewer, Viewer
from radarsim.errors import RadarsimError
from radarsim.server.web_server import DoorKeeper, Doors, is_token


class RateLimit:
    """Counts messages in a window of a second."""

    def __init__(self, most: int) -> None:
        """Start with an empty window.

        Args:
            most: Greatest number of messages in any second.
        """
        self._times: deque[float] = deque(maxlen=most)

    def allows(self, now: float) -> bool:
        """Count a message at a time in s, and return whether it is within the limit."""
        times = self._times
        is_full = len(times) == times.maxlen
        within = not is_full or now - times[0] >= 1.0
        times.append(now)
        return within


PAGE: Final = Path(__file__).parent / "page"
HELLO_TIMEOUT: Final = 5.0  # s
# Why a WebSocket was closed, beside the codes of the protocol.
WRONG_TOKEN, NO_HELLO, SLOW, TOO_FAST, TOO_LONG = 4401, 4408, 4409, 4429, 1009
# Not left to the tables of the system, where scripts may be plain text.
MEDIA_TYPES: Final[Mapping[str, str]] = {
    ".css": "text/css",
    ".html": "text/html",
    ".ico": "image/x-icon",
    ".js": "text/javascript",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
    ".woff2": "font/woff2",
}


def create_app(commander: Commander, doors: Doors, token: str) -> Starlette:
    """Create the application.

    Args:
        commander: What browsers see and ask.
        doors: Who may come in.
        token: What a browser has to know.
    """
    files = find_files(PAGE)

    async def send_index(_: Request) -> Response:
        return _send_file(files.get("index.html"))

    async def send_static(request: Request) -> Response:
        return _send_file(files.get(request.path_params["name"]))

    async def talk(socket: WebSocket) -> None:
        await _Conversation(socket, commander, token).run()

    routes = [
        Route("/", send_index),
        Route("/static/{name:path}", send_static),
        WebSocketRoute("/ws", talk),
    ]
    return Starlette(routes=routes, middleware=[Middleware(DoorKeeper, doors=doors)])


def find_files(folder: Path) -> dict[str, Path]:
    """Return the files of a page by their names with folders, such as ``a/b.js``.

    What is asked for is looked up here, so that nothing else can be read.
    """
    return {
        path.relative_to(folder).as_posix(): path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in MEDIA_TYPES
    }


def _send_file(path: Path | None) -> Response:
    if path is None:
        return PlainTextResponse("no such file\n", 404)
    headers = {"Cache-Control": "no-cache"}
    return FileResponse(path, headers=headers, media_type=MEDIA_TYPES[path.suffix])


class _Conversation:
    """What one browser says and is told."""

    def __init__(self, socket: WebSocket, commander: Commander, token: str) -> None:
        self._socket = socket
        self._commander = commander
        self._token = token
        self._limit = RateLimit(MESSAGES_PER_SECOND)
        self._clock = asyncio.get_running_loop().time

    async def run(self) -> None:
        """Talk until either side ends it."""
        await self._socket.accept()
        with suppress(WebSocketDisconnect):
            if await self._is_welcome():
                await self._talk()

    async def _is_welcome(self) -> bool:
        """Return whether the first message has the token; else close."""
        try:
            async with asyncio.timeout(HELLO_TIMEOUT):
                text = await self._receive()
            hello = parse_request(text)
        except TimeoutError:
            await self._socket.close(NO_HELLO)
            return False
        except BadRequest:
            hello = None
        if isinstance(hello, Hello) and is_token(hello.token, self._token):
            return True
        await self._socket.close(WRONG_TOKEN)
        return False

    async def _talk(self) -> None:
        viewer = self._commander.join()
        sending = asyncio.ensure_future(self._send(viewer))
        hearing = asyncio.ensure_future(self._hear(viewer))
        try:
            await asyncio.wait({sending, hearing}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._commander.leave(viewer)  # at once: it may be driving
            sending.cancel()
            hearing.cancel()
        await asyncio.gather(sending, hearing, return_exceptions=True)
        code = SLOW if sending.done() and not sending.cancelled() else TOO_FAST
        with suppress(RuntimeError):  # it is closed already
            await self._socket.close(code)

    async def _hear(self, viewer: Viewer) -> None:
        """Act upon messages until there are too many of them."""
        while self._limit.allows(self._clock()):
            text = await self._receive()
            try:
                self._commander.act(viewer, parse_request(text))
            except RadarsimError as error:
                viewer.send({"op": "error", "text": str(error)})

    async def _send(self, viewer: Viewer) -> None:
        """Send what there is to send until the browser is too slow."""
        with suppress(SlowViewer):
            async for data in viewer.outgoing():
                if isinstance(data, str):
                    await self._socket.send_text(data)
                else:
                    await self._socket.send_bytes(data)

    async def _receive(self) -> str:
        """Return the next message.

        Raises:
            WebSocketDisconnect: If the browser is gone, or its message is too long.
        """
        message = await self._socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1005))
        text = message.get("text")
        if text is None:
            return ""  # bytes, which are no request
        if len(text) > LONGEST_MESSAGE:
            await self._socket.close(TOO_LONG)
            raise WebSocketDisconnect(TOO_LONG)
        return str(text)
