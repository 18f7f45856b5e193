"""A web server for programs that have an end of their own, and who may use it.

Programs on other machines, and pages of other sites in a browser on this one, must not
see or drive robots. A request names the host that its sender means to talk to: if that
is not this server, a foreign name was made to resolve to this address. And a browser
names the site that a request comes from, which has to be this one. Both are checked
before anything else, also before the token.
"""

import asyncio
import ipaddress
import logging
import secrets
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from socket import socket
from typing import Any, Final

import uvicorn
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from radarsim.errors import join_address
from radarsim.listening import log_refused_accepts, raise_file_limit

log = logging.getLogger("radarsim.server")

ANY_ADDRESS: Final = ("0.0.0.0", "::")  # compared, not bound
HTTP_PORT: Final = 80
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
HEADERS: Final[Mapping[str, str]] = {
    # Files of another version would not understand this program.
    "Cache-Control": "no-cache",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self';"
        " img-src 'self' data:; connect-src 'self'; base-uri 'none';"
        " form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class AllowedHosts:
    """The hosts that a request may be meant for."""

    def __init__(self, address: str, port: int) -> None:
        """Allow the address that is listened on, and the names of this machine.

        Args:
            address: Address that the server listens on; if it is all of them, any
                address is allowed, but no name: a name may be made to resolve to here.
            port: Port that it listens on.
        """
        self._any_address = address in ANY_ADDRESS
        names = (*LOOPBACK, address.lower())
        self._hosts = {join_address(name, port) for name in names}
        self._port = port

    def admit(self, headers: Headers, *, needs_origin: bool) -> bool:
        """Return whether a request may come in.

        Args:
            headers: Its headers.
            needs_origin: Whether it has to name its origin, as browsers do that open a
                WebSocket.
        """
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or not self._is_known(hosts[0].lower()):
            return False
        if not origins:
            return not needs_origin
        return [origin.lower() for origin in origins] == [f"http://{hosts[0].lower()}"]

    def _is_known(self, host: str) -> bool:
        if host.endswith("]") or ":" not in host:
            host += f":{HTTP_PORT}"  # browsers leave it out
        if host in self._hosts:
            return True
        name, _, port = host.rpartition(":")
        return self._any_address and port == str(self._port) and _is_address(name)


class HostCheck:
    """An ASGI application in front of another one, which refuses with 403."""

    def __init__(self, app: ASGIApp, allowed: AllowedHosts) -> None:
        self._app = app
        self._allowed = allowed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        is_socket = scope["type"] == "websocket"

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        if self._allowed.admit(Headers(scope=scope), needs_origin=is_socket):
            await self._app(scope, receive, send_guarded)
        elif is_socket:
            await receive()
            await send({"type": "websocket.close"})  # before it is accepted: 403
        else:
            refusal = PlainTextResponse("wrong Host or Origin\n", 403)
            await refusal(scope, receive, send_guarded)


def make_token() -> str:
    """Return a new token, which cannot be guessed."""
    return secrets.token_urlsafe(24)


def is_token(given: str, expected: str) -> bool:
    """Compare tokens in a time that does not tell how much of one is right."""
    return secrets.compare_digest(given.encode(), expected.encode())


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


MOST_CONNECTIONS: Final = 200
FILES_EACH: Final = 4  # so that connections never take more than half of all files
END_TIMEOUT: Final = 1  # s that clients have to go at the end
REQUEST_TIMEOUT: Final = 5.0  # s for the headers of a request; uvicorn sets no limit


class HttpConnection(H11Protocol):
    """A connection of uvicorn's that is closed if no request comes in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request, unless too many others do."""
        super().connection_made(transport)
        assert self.limit_concurrency is not None
        # One more than that gets an answer; but an answer takes an open file, too.
        if len(self.connections) > 2 * self.limit_concurrency:
            self.transport.abort()
            return
        self._await_request()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._await_request()
        super().on_response_complete()

    def _await_request(self) -> None:
        self.loop.call_later(REQUEST_TIMEOUT, self._close_without_request, self.cycle)

    def _close_without_request(self, answered: RequestResponseCycle | None) -> None:
        # A connection that has become a WebSocket is not among them any more.
        if self.cycle is answered and self in self.connections:
            self.transport.abort()


class WebServer(uvicorn.Server):
    """A server of uvicorn that leaves signals alone, and reports when it listens."""

    def __init__(
        self, app: ASGIApp, on_start: Callable[[], None], *, longest_message: int
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            app: What it serves.
            on_start: Called as soon as it listens.
            longest_message: Longest message on a WebSocket, bytes.
        """
        config = uvicorn.Config(
            app,
            access_log=False,
            http=HttpConnection,
            lifespan="off",
            limit_concurrency=raise_file_limit(FILES_EACH * MOST_CONNECTIONS)
            // FILES_EACH,
            log_config=None,
            server_header=False,
            timeout_graceful_shutdown=END_TIMEOUT,
            ws="websockets-sansio",
            ws_max_size=longest_message,
            ws_per_message_deflate=False,
        )
        super().__init__(config)
        self._on_start = on_start

    def capture_signals(self) -> Any:
        """Leave the handlers of signals as they are."""
        return nullcontext()

    async def startup(self, sockets: list[socket] | None = None) -> None:
        """Listen, and report that it does."""
        log_refused_accepts(log)
        await super().startup(sockets)
        self._on_start()
