"""Fixtures: scripted TCP servers, and both clients."""

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any, cast

import pytest

from radarsim.client import AsyncClient, Client

DEADLINE = 240.0  # s of the wall clock, for a busy machine
Serve = Callable[[Callable[[socket.socket], None]], int]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Return a function that serves one client by a handler and returns the port."""
    with ExitStack() as cleanup:

        def start(handle: Callable[[socket.socket], None]) -> int:
            listener = cleanup.enter_context(socket.create_server(("127.0.0.1", 0)))

            peers: list[socket.socket] = []

            def run() -> None:
                with suppress(OSError):
                    peer, _ = listener.accept()
                    with peer:
                        peers.append(peer)
                        handle(peer)

            def hang_up() -> None:
                for end in (listener, *peers):
                    with suppress(OSError):
                        end.shutdown(socket.SHUT_RDWR)

            thread = threading.Thread(target=run, daemon=True)
            cleanup.callback(thread.join, DEADLINE)
            cleanup.callback(hang_up)
            thread.start()
            return int(listener.getsockname()[1])

        yield start


class BlockingClient:
    """An ``AsyncClient`` with blocking calls, like those of ``Client``."""

    def __init__(self, runner: asyncio.Runner, client: AsyncClient) -> None:
        self.runner = runner
        self.client = client
        self.session = client.session

    def __getattr__(self, name: str) -> Callable[..., Any]:
        call = getattr(self.client, name)
        return lambda *args, **kwargs: self.runner.run(call(*args, **kwargs))


async def open_client(port: int, timeout: float) -> AsyncClient:  # noqa: ASYNC109
    return await AsyncClient.connect(port=port, timeout=timeout)


@pytest.fixture(params=["blocking", "asynchronous"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[..., Client]]:
    """Return a function that connects a client, which is closed at the end."""
    request.getfixturevalue("serve")  # servers end after their clients
    with ExitStack() as cleanup:
        runner = asyncio.Runner()

        def start(port: int, timeout: float = DEADLINE) -> Client:
            if request.param == "blocking":
                client = Client.connect(port=port, timeout=timeout)
            else:
                opened = runner.run(open_client(port, timeout))
                client = cast("Client", BlockingClient(runner, opened))
            cleanup.callback(client.close)
            return client

        cleanup.enter_context(runner)
        yield start
