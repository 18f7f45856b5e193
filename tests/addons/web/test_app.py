import asyncio
import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
import websockets
from served_page import run_commander
from web_pages import Page
from websockets.typing import Origin

from radarsim.addons.web.program import PAGE
from radarsim.plotting.palette import PAGE_COLOURS
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread


@pytest.fixture(scope="module")
def commander(foliage_room: Scene) -> Iterator[Any]:
    """Run a commander for all of these tests."""
    thread = ServerThread(Host(foliage_room), speed=1.0)
    with run_commander(thread.begin(), map_="foliage_room") as running:
        yield running
    thread.finish()


def get(web: str, path: str = "/", **headers: str) -> httpx.Response:
    return httpx.get(f"http://{web}{path}", headers=headers, timeout=240)


def test_page_is_sent_with_headers_that_keep_others_out(commander: Any) -> None:
    response = get(commander.web)
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/html")
    policy = response.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert response.headers["x-content-type-options"] == "nosniff"
    assert response.headers["referrer-policy"] == "no-referrer"
    assert "access-control-allow-origin" not in response.headers
    assert commander.token not in response.text


@pytest.mark.parametrize("path", ["/", "/static/index.html", "/nothing", "/ws"])
def test_wrong_host_or_origin_is_refused(commander: Any, path: str) -> None:
    assert get(commander.web, path, Host="evil.example").status_code == 403
    assert get(commander.web, path, Origin="http://evil.example").status_code == 403


def test_nothing_else_is_sent(commander: Any) -> None:
    names = ["../program.py", "%2e%2e/program.py", "/etc/passwd", ""]
    paths = ["/program.py", "/ws", *(f"/static/{name}" for name in names)]
    codes = {path: get(commander.web, path).status_code for path in paths}
    assert codes == dict.fromkeys(paths, 404)


def test_page_has_the_colours_of_the_pictures(commander: Any) -> None:
    response = get(commander.web, "/static/palette.css")
    assert response.headers["content-type"].startswith("text/css")
    assert '/static/palette.css"' in get(commander.web).text
    light, dark = response.text.splitlines()
    assert "(prefers-color-scheme: dark)" in dark
    for name, colours in PAGE_COLOURS.items():
        for line, colour in zip((light, dark), colours, strict=True):
            assert f"--{name}:{colour};" in line
    style = (PAGE / "style.css").read_text()
    assert not [name for name in PAGE_COLOURS if f"--{name}:" in style]


async def refusal(web: str, token: str, **options: Any) -> int:
    """Return the HTTP status with which a WebSocket is refused."""
    with pytest.raises(websockets.InvalidStatus) as raised:
        async with websockets.connect(f"ws://{web}/ws", **options) as socket:
            await socket.send(json.dumps({"op": "hello", "token": token}))
    return raised.value.response.status_code


async def test_sockets_of_other_sites_are_refused_also_with_the_token(
    commander: Any,
) -> None:
    web, token = commander.web, commander.token
    assert await refusal(web, token) == 403
    assert await refusal(web, token, origin="http://evil.example") == 403


def test_sockets_that_name_another_host_are_refused(commander: Any) -> None:
    headers = {
        "Host": "evil.example",
        "Origin": "http://evil.example",
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version": "13",
    }
    assert get(commander.web, "/ws", **headers).status_code == 403


async def close_code(web: str, *messages: str | bytes) -> int:
    """Send messages, and return why the WebSocket is closed."""
    origin = Origin(f"http://{web}")
    async with websockets.connect(f"ws://{web}/ws", origin=origin) as socket:
        try:
            for message in messages:
                await socket.send(message)
            async with asyncio.timeout(240):
                async for _ in socket:
                    pass
        except websockets.ConnectionClosed:
            pass
        assert socket.close_code is not None
        return socket.close_code


async def test_without_the_token_nothing_is_reported(commander: Any) -> None:
    wrong = '{"op": "hello", "token": "wrong"}'
    for first in (wrong, '{"op": "stop"}', "nonsense", b"\xff", ""):
        assert await close_code(commander.web, first) == 4401


async def test_long_messages_are_not_read(commander: Any) -> None:
    hello = json.dumps({"op": "hello", "token": commander.token})
    assert await close_code(commander.web, hello, "x" * 5000) == 1009


async def test_who_sends_too_much_is_closed(commander: Any) -> None:
    hello = json.dumps({"op": "hello", "token": commander.token})
    stops = ['{"op": "stop"}'] * 1000
    assert await close_code(commander.web, hello, *stops) == 4429


async def test_hello_lists_what_there_is_and_the_map_follows(page: Page) -> None:
    hello = page.hello
    assert hello["level"] == "DM-FoliageRoom"
    assert next(start["name"] for start in hello["starts"]) == "RobotStart1"
    assert "P3AT" in [each["name"] for each in hello["classes"]]
    assert (await page.hear("scene"))["level"] == "DM-FoliageRoom"
    await page.send("triangles")
    assert (await page.hear("triangles"))["parts"]


async def test_impossible_values_are_reported(page: Page) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"op": "drive", "robot": "x", "v": 1, "w": 0}, "no robot 'x'"),
        ({"op": "nonsense"}, "nonsense"),
        ({"op": "record", "on": "x"}, "on"),
        ({"op": "spawn", "class": "P3AT", "start": "a", "pose": [0, 0, 0]}, "only one"),
        ({"op": "hello", "token": "again"}, "not possible on"),
    ]
    for message, text in cases:
        await page.send(**message)
        assert text in (await page.hear("error"))["text"]
