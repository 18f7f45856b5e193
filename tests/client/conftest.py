"""Servers for clients: a host in turns with its client, and odd ones behind sockets."""

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any, cast

import pytest

from radarsim.client import AsyncClient, Client, Transport
from radarsim.host import Host

Serve = Callable[[Callable[[socket.socket], None]], int]


class InTurns:
    """A link to a host of this process, whose time passes while the client waits."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._number = host.connect()
        self._open = True

    def time(self) -> float:
        return self._host.simulation.time

    def send(self, data: bytes) -> None:
        if not self._open:
            raise ConnectionError("the link is closed")
        self._host.receive(self._number, data)

    def receive(self, timeout: float) -> bytes:
        if not self._open:
            raise ConnectionError("the link is closed")
        until = self.time() + timeout
        while not (data := self._host.take(self._number)):
            if self.time() >= until:
                raise TimeoutError
            self._host.step()
        return data

    def close(self) -> None:
        if self._open:
            self._host.disconnect(self._number)
        self._open = False


@pytest.fixture
def link_to() -> Callable[[Host], Transport]:
    """Connect to a host in simulated time."""
    return InTurns


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Serve one client behind a real socket by a function; gives the port."""
    with ExitStack() as cleanup:

        def start(behave: Callable[[socket.socket], None]) -> int:
            listener = cleanup.enter_context(socket.create_server(("127.0.0.1", 0)))

            peers: list[socket.socket] = []

            def run() -> None:
                with suppress(OSError):
                    peer, _ = listener.accept()
                    with peer:
                        peers.append(peer)
                        behave(peer)

            def hang_up() -> None:
                for end in (listener, *peers):
                    with suppress(OSError):
                        end.shutdown(socket.SHUT_RDWR)

            thread = threading.Thread(target=run, daemon=True)
            cleanup.callback(thread.join, 5)
            cleanup.callback(hang_up)
            thread.start()
            return int(listener.getsockname()[1])

        yield start


class Awaited:
    """An ``AsyncClient`` whose calls run to their end, as those of a ``Client`` do."""

    def __init__(self, runner: asyncio.Runner, client: AsyncClient) -> None:
        self.runner = runner
        self.client = client
        self.session = client.session

    def __getattr__(self, name: str) -> Callable[..., Any]:
        call = getattr(self.client, name)
        return lambda *args, **kwargs: self.runner.run(call(*args, **kwargs))


@pytest.fixture(params=["blocking", "asynchronous"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[..., Client]]:
    """Connect by each of the two faces; what is connected is closed in the end."""
    request.getfixturevalue("serve")  # so that servers end after their clients
    with ExitStack() as cleanup:
        runner = asyncio.Runner()

        def start(port: int, timeout: float = 5.0) -> Client:
            if request.param == "blocking":
                client = Client.connect(port=port, timeout=timeout)
            else:
                came = runner.run(AsyncClient.connect(port=port, timeout=timeout))
                client = cast("Client", Awaited(runner, came))
            cleanup.callback(client.close)
            return client

        cleanup.enter_context(runner)
        yield start
