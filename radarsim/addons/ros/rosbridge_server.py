"""A server of rosbridge: a WebSocket for each client."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Final

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.bridge import DriveCallback
from radarsim.addons.ros.rosbridge import LONGEST_MESSAGE, RosbridgeClient, TopicBoard
from radarsim.listening import bind
from radarsim.server.web_server import AllowedHosts, WebServer

MOST_ANSWERS: Final = 1000  # that wait for a client which does not read


class RosbridgeServer:
    """Serves topics to clients of rosbridge, such as roslibpy and roslib."""

    def __init__(
        self,
        address: str,
        port: int,
        announce: Callable[[tuple[str, int]], None],
        origins: Sequence[str] = (),
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.
            announce: Called with the address as soon as clients can connect.
            origins: Sites whose pages may connect.
        """
        self._address, self._port = address, port
        self._announce = announce
        self._origins = {origin.rstrip("/").lower() for origin in origins}
        self._board = TopicBoard()
        self._clients: dict[RosbridgeClient, asyncio.Event] = {}

    def publish(self, message: TopicMessage) -> None:
        """See ``RosSide.publish``."""
        wanting = [each for each in self._clients if each.wants(message.topic)]
        text = self._board.add(message, wanted=bool(wanting))
        now = asyncio.get_running_loop().time()
        for client in wanting:
            client.offer(message.topic, text, now)
            self._clients[client].set()

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """See ``RosSide.subscribe``."""
        self._board.listen(topic, take)

    async def run(self) -> None:
        """See ``RosSide.run``.

        Raises:
            ServerError: If it cannot listen.
        """
        with bind(self._address, self._port) as listening:
            place = listening.getsockname()[:2]
            self._allowed = AllowedHosts(self._address, place[1])
            app = Starlette(routes=[WebSocketRoute("/{path:path}", self._serve)])
            server = WebServer(
                app, lambda: self._announce(place), longest_message=LONGEST_MESSAGE
            )
            serving = asyncio.ensure_future(server.serve([listening]))
            try:
                # Shielded: it is asked to exit below, and then closes its connections.
                await asyncio.shield(serving)
            finally:
                server.should_exit = True
                await asyncio.wait({serving})

    async def _serve(self, socket: WebSocket) -> None:
        # A page of another site may connect only if its site is named.
        origin = socket.headers.get("origin", "").lower()
        if origin not in self._origins and not self._allowed.admit(
            socket.headers, needs_origin=False
        ):
            await socket.close()
            return
        await socket.accept()
        client, news = RosbridgeClient(self._board), asyncio.Event()
        self._clients[client] = news
        sending = asyncio.ensure_future(_send(socket, client, news))
        try:
            # Topics are limited in the queue; answers to calls are not, but end the
            # connection.
            while len(client.waiting) < MOST_ANSWERS:
                client.receive(await socket.receive_text())
                news.set()
        except (WebSocketDisconnect, KeyError, RuntimeError):
            pass  # it is gone, or sends binary messages
        finally:
            del self._clients[client]
            sending.cancel()


async def _send(
    socket: WebSocket, client: RosbridgeClient, news: asyncio.Event
) -> None:
    """Send what waits for a client."""
    while True:
        await news.wait()
        news.clear()
        while client.waiting:
            await socket.send_text(client.waiting.popleft())
