"""How a tap ends: by a signal, and before it begins."""

import os
import signal
import socket

import pytest

from radarsim.errors import ServerError
from radarsim.proxy import TcpProxy, forward_until_signal


@pytest.mark.parametrize(
    ("number", "code"),
    [
        pytest.param(signal.SIGINT, 130, id="interrupt"),
        pytest.param(signal.SIGTERM, 0, id="terminate"),
    ],
)
async def test_a_signal_ends_it_with_its_code(number: int, code: int) -> None:
    heard: list[tuple[str, int]] = []
    before = signal.getsignal(number)

    def announce(address: tuple[str, int]) -> None:
        heard.append(address)
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # some people press Ctrl-C twice

    tap = TcpProxy(("127.0.0.1", 1), lambda *_: None)
    assert await forward_until_signal(tap, "127.0.0.1", 0, announce) == code
    ((host, port),) = heard
    assert host == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, port), 1)
    assert signal.getsignal(number) == before


async def test_a_taken_port_ends_it_before_anybody_is_told() -> None:
    heard: list[tuple[str, int]] = []
    before = signal.getsignal(signal.SIGINT)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        tap = TcpProxy(("127.0.0.1", 1), lambda *_: None)
        with pytest.raises(ServerError, match=f"cannot listen on 127.0.0.1:{port}"):
            await forward_until_signal(tap, "127.0.0.1", port, heard.append)
    assert heard == []
    assert signal.getsignal(signal.SIGINT) == before
