"""Exit codes and handlers of signals to a program in the foreground."""

import asyncio
import errno
import logging
import os
import signal
import socket
from collections.abc import Callable
from types import FrameType
from typing import cast

import pytest

from radarsim.errors import ServerError
from radarsim.listening import (
    configure_socket,
    exit_code_of_signal,
    first_of,
    listen,
    log_refused_accepts,
)

CODES = [(signal.SIGINT, 130), (signal.SIGTERM, 0)]


@pytest.mark.parametrize(("number", "code"), CODES)
async def test_the_first_signal_gives_the_exit_code(number: int, code: int) -> None:
    with exit_code_of_signal() as ended:
        for one in (number, signal.SIGINT, signal.SIGTERM):
            os.kill(os.getpid(), one)
        assert await ended == code


@pytest.mark.parametrize(("number", "code"), CODES)
async def test_signal_handlers_are_restored_after_an_error(
    number: int, code: int
) -> None:
    before = signal.getsignal(number)

    def fail() -> None:
        with exit_code_of_signal():
            assert signal.getsignal(number) != before
            raise RuntimeError(code)

    with pytest.raises(RuntimeError, match=str(code)):
        fail()
    assert signal.getsignal(number) == before


def test_signal_after_the_loop_is_closed_is_ignored() -> None:
    async def handler() -> Callable[[int, FrameType | None], None]:
        with exit_code_of_signal():
            found = signal.getsignal(signal.SIGTERM)
        return cast("Callable[[int, FrameType | None], None]", found)

    asyncio.run(handler())(signal.SIGTERM, None)


class Endpoint(asyncio.BaseTransport):
    """A transport that has nothing but its socket."""

    def __init__(self, sock: socket.socket) -> None:
        super().__init__({"socket": sock})


@pytest.mark.skipif(not hasattr(socket, "TCP_KEEPIDLE"), reason="not on every system")
def test_peer_that_is_gone_without_a_word_is_noticed_within_minutes() -> None:
    with socket.socket() as sock:
        configure_socket(Endpoint(sock))
        assert sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        idle, interval, count = [
            sock.getsockopt(socket.IPPROTO_TCP, option)
            for option in (
                *(socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT),
            )
        ]
        assert idle + interval * count <= 180


async def test_several_addresses_have_one_port() -> None:
    server, (host, port) = await listen(asyncio.Protocol, "127.0.0.2,127.0.0.1", 0)
    assert host == "127.0.0.2"
    places = {sock.getsockname() for sock in server.sockets}
    assert places == {("127.0.0.1", port), ("127.0.0.2", port)}
    server.close()


async def test_error_names_all_addresses() -> None:
    with pytest.raises(ServerError, match=r"127\.0\.0\.1:\d+ and 192\.0\.2\.1:\d+: "):
        await listen(asyncio.Protocol, "127.0.0.1,192.0.2.1", 0)


async def test_lack_of_files_is_logged_in_one_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    log_refused_accepts(logging.getLogger("radarsim.server"))
    loop = asyncio.get_running_loop()
    lack = OSError(errno.EMFILE, "Too many open files")
    for _ in range(2):
        message = "socket.accept() out of system resource"
        loop.call_exception_handler({"message": message, "exception": lack})
    (record,) = caplog.records
    assert record.getMessage().startswith("new clients wait for others to end: ")
    assert record.exc_info is None
    loop.call_exception_handler({"message": "other", "exception": ValueError("bug")})
    assert "ValueError: bug" in caplog.text


async def test_the_first_of_several_ends_the_others_before_it_is_returned() -> None:
    ended = []

    async def wait() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append("waiting")

    async def work(result: int) -> int:
        await asyncio.sleep(0)
        return result

    assert await first_of(wait(), work(1), work(2)) == 1
    assert ended == ["waiting"]


async def test_the_error_of_the_first_is_raised() -> None:
    async def fail() -> None:
        raise ServerError("no")

    with pytest.raises(ServerError, match="no"):
        await first_of(asyncio.Event().wait(), fail())
