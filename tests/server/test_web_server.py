import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send

from radarsim.listening import bind
from radarsim.server.web_server import AllowedHosts, WebServer, is_token, make_token

REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
HALF = REQUEST[:-4]


def admits(
    allowed: AllowedHosts, *, needs_origin: bool = False, **headers: str
) -> bool:
    return allowed.admit(Headers(headers), needs_origin=needs_origin)


@pytest.mark.parametrize(
    ("address", "port", "inside", "outside"),
    [
        (
            "127.0.0.1",
            8000,
            ["127.0.0.1:8000", "localhost:8000", "LOCALHOST:8000", "[::1]:8000"],
            [
                "evil.example:8000",
                "127.0.0.1:8001",
                "127.0.0.1",
                "localhost.evil.example:8000",
                "192.0.2.1:8000",
                "",
            ],
        ),
        ("192.0.2.1", 8000, ["192.0.2.1:8000"], ["192.0.2.2:8000"]),
        *(
            (
                every,
                8000,
                ["192.0.2.1:8000", "[2001:db8::1]:8000", "localhost:8000"],
                ["evil.example:8000", "192.0.2.1:80", "192.0.2.1", "[::1]"],
            )
            for every in ("0.0.0.0", "::")
        ),
        (
            "0.0.0.0",
            80,
            ["127.0.0.1", "localhost", "192.0.2.1", "[::1]", "[2001:db8::1]:80"],
            ["evil.example", ""],
        ),
    ],
)
def test_hosts_that_come_in(
    address: str, port: int, inside: list[str], outside: list[str]
) -> None:
    allowed = AllowedHosts(address, port)
    assert [host for host in inside if admits(allowed, host=host)] == inside
    assert [host for host in outside if admits(allowed, host=host)] == []
    same = [
        host for host in inside if admits(allowed, host=host, origin=f"http://{host}")
    ]
    assert same == inside


def test_request_has_one_host() -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed)
    pairs = [(b"host", b"127.0.0.1:8000"), (b"host", b"evil.example")]
    assert not allowed.admit(Headers(raw=pairs), needs_origin=False)


@pytest.mark.parametrize(
    "origin",
    [
        "http://localhost:8000",  # it is not the host that is asked
        "https://127.0.0.1:8000",
        "http://evil.example",
        "null",
    ],
)
def test_origin_has_to_be_the_host(origin: str) -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed, host="127.0.0.1:8000", origin=origin)


def test_socket_without_origin_does_not_come_in() -> None:
    allowed = AllowedHosts("127.0.0.1", 8000)
    assert not admits(allowed, host="127.0.0.1:8000", needs_origin=True)


def test_tokens_differ_and_are_compared() -> None:
    token = make_token()
    assert len(token) >= 32
    assert token != make_token()
    assert is_token(token, token)
    assert not is_token(token[:-1], token)
    assert not is_token("ä", token)


@asynccontextmanager
async def slow_server() -> AsyncIterator[tuple[str, int]]:
    """A server that answers after three times as long as requests have to come."""

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        await asyncio.sleep(0.6)
        await PlainTextResponse("done")(scope, receive, send)

    listens = asyncio.Event()
    server = WebServer(app, listens.set, longest_message=100)
    with bind("127.0.0.1", 0) as listening:
        serving = asyncio.ensure_future(server.serve([listening]))
        await listens.wait()
        yield listening.getsockname()
        server.should_exit = True
        await serving


async def answer(address: tuple[str, int], request: bytes) -> bytes:
    """Return all that is answered until the connection is closed."""
    reader, writer = await asyncio.open_connection(*address)
    writer.write(request)
    text = await asyncio.wait_for(reader.read(), 30)
    writer.close()
    return text


async def test_half_requests_end_and_leave_their_places_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.server.web_server.REQUEST_TIMEOUT", 0.2)
    monkeypatch.setattr("radarsim.server.web_server.MOST_CONNECTIONS", 4)
    async with slow_server() as address:
        halves = [asyncio.create_task(answer(address, HALF)) for _ in range(5)]
        await asyncio.sleep(0)
        refusal = await answer(address, REQUEST)
        assert refusal.startswith(b"HTTP/1.1 503 ")
        assert await asyncio.gather(*halves) == 5 * [b""]
        text = await answer(address, REQUEST)
        assert text.startswith(b"HTTP/1.1 200 ")
        assert text.endswith(b"done")


async def test_silent_connections_leave_files_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.server.web_server.raise_file_limit", lambda _: 16)
    monkeypatch.setattr("radarsim.server.web_server.REQUEST_TIMEOUT", 600.0)
    async with slow_server() as address:
        silent = [await asyncio.open_connection(*address) for _ in range(8)]
        assert await answer(address, b"") == b""
        for _, writer in silent:
            assert not writer.is_closing()
            writer.close()


async def test_half_request_after_a_whole_one_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.server.web_server.REQUEST_TIMEOUT", 0.2)
    async with slow_server() as address:
        text = await answer(address, REQUEST + REQUEST + HALF)
        assert text.count(b"HTTP/1.1 200 ") == 2
