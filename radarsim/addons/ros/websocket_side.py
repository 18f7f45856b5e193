"""A server of rosbridge, or for Foxglove: a WebSocket for each client."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket

from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.bridge import DriveCallback
from radarsim.listening import bind
from radarsim.server.web_server import AllowedHosts, WebServer

LONGEST_MESSAGE: Final = 65536  # bytes of what a client sends
MOST_ANSWERS: Final = 1000  # that wait for a client which does not read


class SideClient(Protocol):
    """One client: what it wants, and what waits for it."""

    waiting: deque[Any]  # texts or bytes to send, oldest first

    def wants(self, topic: str) -> bool:
        """Return whether it is to be offered the messages of a topic."""

    def offer(self, topic: str, data: Any, now: float) -> None:
        """Queue a message of a topic that it wants; the oldest go if too many wait.

        Args:
            topic: Name of the topic.
            data: The message as the board has encoded it.
            now: Time of the loop, s.
        """

    def announce(self, topic: str) -> None:
        """Queue the news that there is a topic."""

    def receive(self, data: str | bytes) -> None:
        """Do what a message asks for; what is wrong is answered."""


class Board(Protocol):
    """The topics there are, and the protocol in which clients are told of them.

    Attributes:
        name: Name of the protocol, for people.
        subprotocols: Names of WebSocket subprotocols, of which clients ask for one.
        types: Types of topics, by name.
    """

    name: str
    subprotocols: tuple[str, ...]
    types: dict[str, str]

    def add(self, message: TopicMessage, wanted: bool) -> Any:
        """Note a message; return it encoded if somebody wants it."""

    def listen(self, topic: str, take: DriveCallback) -> None:
        """Pass the velocity commands on a topic to a function."""

    def new_client(self) -> SideClient:
        """Return a new client, for which all there is to know waits."""

    def trusts(self, origin: str) -> bool:
        """Return whether a program of this origin may connect, in lower case."""


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
        """Create a server that does not listen yet.

        Args:
            board: The protocol.
            address: Address to listen on.
            port: Port to listen on; 0 for a free one.
            announce: Called with the name of the protocol and the address as soon as
                clients can connect.
            origins: Sites whose pages may connect.
        """
        self._board = board
        self._address, self._port = address, port
        self._announce = announce
        self._origins = {origin.rstrip("/").lower() for origin in origins}
        self._clients: dict[SideClient, asyncio.Event] = {}

    def publish(self, message: TopicMessage) -> None:
        """See ``RosSide.publish``."""
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
                app,
                lambda: self._announce(self._board.name, place),
                longest_message=LONGEST_MESSAGE,
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
        is_named = origin in self._origins or self._board.trusts(origin)
        if not is_named and not self._allowed.admit(socket.headers, needs_origin=False):
            await socket.close()
            return
        asked = socket.scope["subprotocols"]
        common = [each for each in self._board.subprotocols if each in asked]
        await socket.accept(common[0] if common else None)
        client, news = self._board.new_client(), asyncio.Event()
        self._clients[client] = news
        news.set()
        sending = asyncio.ensure_future(_send(socket, client, news))
        try:
            # Topics are limited in the queue; answers to calls are not, but end the
            # connection.
            while len(client.waiting) < MOST_ANSWERS:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                client.receive(message.get("text") or message.get("bytes") or b"")
                news.set()
        except RuntimeError:
            pass  # it is gone
        finally:
            del self._clients[client]
            sending.cancel()


async def _send(socket: WebSocket, client: SideClient, news: asyncio.Event) -> None:
    """Send what waits for a client."""
    while True:
        await news.wait()
        news.clear()
        while client.waiting:
            data = client.waiting.popleft()
            if isinstance(data, str):
                await socket.send_text(data)
            else:
                await socket.send_bytes(data)
