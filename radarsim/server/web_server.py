"""A web server that can run inside another program, with checks of Host and Origin.

Programs on other machines, and web pages of other sites in a browser on this machine,
must not see or drive robots. The header ``Host`` contains the host name that the
browser used; any other name than this server's indicates DNS rebinding: a foreign name
resolves to this address. The header ``Origin`` contains the site that sent the request,
which has to be this server. Both are checked before anything else, even before the
token.
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

ANY_ADDRESS: Final = ("0.0.0.0", "::")  # only for comparison, not for binding
HTTP_PORT: Final = 80
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
HEADERS: Final[Mapping[str, str]] = {
    # Files that a browser has cached from another version may not work with this one.
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
    """The values of the headers Host and Origin that are accepted."""

    def __init__(self, address: str, port: int) -> None:
        """Allow the address of the server, and the loopback names of this machine.

        Args:
            address: Address on which the server listens. If it listens on all
                addresses, any numeric address is allowed, but no other host name,
                because a foreign name may resolve to this machine.
            port: Port on which the server listens.
        """
        self._any_address = address in ANY_ADDRESS
        names = (*LOOPBACK, address.lower())
        self._hosts = {join_address(name, port) for name in names}
        self._port = port

    def admit(self, headers: Headers, *, needs_origin: bool) -> bool:
        """Return whether a request is accepted.

        Args:
            headers: Headers of the request.
            needs_origin: Whether the header Origin is required; browsers always send it
                when they open a WebSocket.
        """
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or not self._is_known(hosts[0].lower()):
            return False
        if not origins:
            return not needs_origin
        return [origin.lower() for origin in origins] == [f"http://{hosts[0].lower()}"]

    def _is_known(self, host: str) -> bool:
        if host.endswith("]") or ":" not in host:
            host += f":{HTTP_PORT}"  # browsers omit the default port
        if host in self._hosts:
            return True
        name, _, port = host.rpartition(":")
        return self._any_address and port == str(self._port) and _is_address(name)


class HostCheck:
    """ASGI middleware that answers requests from other hosts or origins with 403."""

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
            # A WebSocket that is closed before it is accepted is answered with 403.
            await send({"type": "websocket.close"})
        else:
            refusal = PlainTextResponse("wrong Host or Origin\n", 403)
            await refusal(scope, receive, send_guarded)


def make_token() -> str:
    """Return a new random token that cannot be guessed."""
    return secrets.token_urlsafe(24)


def is_token(given: str, expected: str) -> bool:
    """Compare tokens in constant time, to prevent timing attacks."""
    return secrets.compare_digest(given.encode(), expected.encode())


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


MOST_CONNECTIONS: Final = 200
# Open files per permitted connection; connections use at most half of all open files.
FILES_EACH: Final = 4
END_TIMEOUT: Final = 1  # s for clients to disconnect when the server stops
REQUEST_TIMEOUT: Final = 5.0  # s for the headers of a request; uvicorn sets no limit


class HttpConnection(H11Protocol):
    """A uvicorn connection that is closed if no request arrives in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request; abort if there are too many connections."""
        super().connection_made(transport)
        assert self.limit_concurrency is not None
        # Beyond the limit uvicorn answers with 503, for which each connection needs an
        # open file. Beyond twice the limit, connections are aborted.
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
        # A connection that became a WebSocket is no longer in ``connections``.
        if self.cycle is answered and self in self.connections:
            self.transport.abort()


class WebServer(uvicorn.Server):
    """A uvicorn server without signal handlers, which reports when it listens."""

    def __init__(
        self, app: ASGIApp, on_start: Callable[[], None], *, longest_message: int
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            app: The ASGI application to serve.
            on_start: Called as soon as the server listens.
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
        """Do not install signal handlers."""
        return nullcontext()

    async def startup(self, sockets: list[socket] | None = None) -> None:
        """Start to listen, and call ``on_start``."""
        log_refused_accepts(log)
        await super().startup(sockets)
        self._on_start()
