"""A web server for programs that have an end of their own."""

from collections.abc import Callable
from contextlib import nullcontext
from socket import socket
from typing import Any, Final

import uvicorn
from starlette.types import ASGIApp

MOST_CONNECTIONS: Final = 200
END_TIMEOUT: Final = 1  # s that clients have to go at the end


class WebServer(uvicorn.Server):
    """A server of uvicorn that leaves signals alone, and tells when it listens."""

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
            http="h11",
            lifespan="off",
            limit_concurrency=MOST_CONNECTIONS,
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
        """Listen, and tell that it does."""
        await super().startup(sockets)
        self._on_start()
