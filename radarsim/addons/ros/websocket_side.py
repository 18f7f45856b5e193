"""A WebSocket server for the clients of rosbridge or Foxglove."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.board import Board, BoardClient
from radarsim.addons.ros.bridge import DriveCallback
from radarsim.listening import bind, first_of
from radarsim.server.web_server import AllowedHosts, WebServer

LONGEST_MESSAGE: Final = 65536  # bytes of a message from a client
MOST_ANSWERS: Final = 1000  # messages that may wait for a client


class WebSocketSide:
    """Serves topics to clients, such as roslibpy, roslib and Foxglove."""

    def __init__(
        self,
        board: Board,
        address: str,
        port: int,
        announce: Callable[[str, tuple[str, int]], None],
        origins: Sequence[str] = (),
    ) -> None:
        """Create a WebSocket server that does not listen yet.

        Args:
            board: The topics for the clients of a protocol.
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.
            announce: Called with the name of the protocol and the address as soon as
                clients can connect.
            origins: Origins of sites whose pages may connect.
        """
        self._board = board
        self._address, self._port = address, port
        self._announce = announce
        self._origins = {origin.rstrip("/").lower() for origin in origins}
        self._clients: dict[BoardClient, asyncio.Event] = {}

    def publish(self, message: TopicMessage) -> None:
        """Send a message to its subscribers; see ``RosSide.publish``."""
        is_new = message.topic not in self._board.types
        wanting = [each for each in self._clients if each.wants(message.topic)]
        data = self._board.add(message, wanted=bool(wanting))
        now = asyncio.get_running_loop().time()
        if is_new:
            for client, news in self._clients.items():
                client.announce(message.topic)
                news.set()
        for client in wanting:
            client.offer(message.topic, data, now)
            self._clients[client].set()

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """Subscribe to velocity commands; see ``RosSide.subscribe``."""
        self._board.drivers[topic] = take

    async def run(self) -> None:
        """Serve WebSocket clients until cancelled; see ``RosSide.run``.

        Raises:
            ServerError: If the address or the port cannot be used.
        """
        with bind(self._address, self._port) as listening:
            place = listening.getsockname()[:2]
            self._allowed = AllowedHosts(self._address, place[1])
            app = Starlette(routes=[WebSocketRoute("/{path:path}", self._serve)])
            server = WebServer(
                app,
                lambda: self._announce(self._board.protocol.name, place),
                longest_message=LONGEST_MESSAGE,
            )
            serving = asyncio.ensure_future(server.serve([listening]))
            try:
                # The server must not be cancelled, since it closes its connections
                # after ``should_exit`` is set below.
                await asyncio.shield(serving)
            finally:
                server.should_exit = True
                await asyncio.wait({serving})

    async def _serve(self, socket: WebSocket) -> None:
        # A web page of another site may connect only if the page's origin is listed or
        # trusted.
        origin = socket.headers.get("origin", "").lower()
        is_named = origin in self._origins or self._board.protocol.trusts(origin)
        if not is_named and not self._allowed.admit(socket.headers, needs_origin=False):
            await socket.close()
            return
        asked = socket.scope["subprotocols"]
        common = [each for each in self._board.protocol.subprotocols if each in asked]
        await socket.accept(common[0] if common else None)
        client, news = self._board.protocol(self._board), asyncio.Event()
        self._clients[client] = news
        news.set()

        async def hear() -> None:
            # The queue drops old messages of topics, but never answers to service
            # calls. If too many answers wait, the connection is closed.
            while len(client.waiting) < MOST_ANSWERS:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                client.receive(message.get("text") or message.get("bytes") or b"")
                news.set()

        try:
            with suppress(RuntimeError, WebSocketDisconnect):  # the client is gone
                await first_of(hear(), _send(socket, client, news))
        finally:
            del self._clients[client]


async def _send(socket: WebSocket, client: BoardClient, news: asyncio.Event) -> None:
    """Send the queued messages of a client until cancelled."""
    while True:
        await news.wait()
        news.clear()
        while client.waiting:
            data = client.waiting.popleft()
            if isinstance(data, str):
                await socket.send_text(data)
            else:
                await socket.send_bytes(data)
