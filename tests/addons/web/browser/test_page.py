"""The page in a browser: what it shows, asks for, and lets nobody do."""

import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from commander_page import CommanderPage
from playwright.sync_api import Browser
from served_page import CHROMIUM_OPTIONS, Served, serve
from truth import Truth

NASTY = "<img/src=x/onerror=alert(1)>"  # names of levels have no blanks
NASTY_MAP = """
version: 1
level: "{name}"
materials:
  "{name}": {{density: opaque}}
objects:
  - {{name: floor, box: [9, 9, 0.2], position: [0, 0, -0.1], material: "{name}"}}
  - {{name: "{name}", box: [1, 1, 2], position: [3, 0, 1], material: "{name}"}}
starts:
  - {{name: RobotStart1, position: [0, 0, 0]}}
"""
# The colours of a canvas, counted: how many differ from that of its first corner.
PAINTED = """canvas => {
  const pen = canvas.getContext("2d");
  const pixels = new Uint32Array(
    pen.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  return pixels.filter((pixel) => pixel !== pixels[0]).length;
}"""


def test_plan_and_scans_are_painted_once_a_robot_is_added(
    commander: CommanderPage,
) -> None:
    commander.add_robot("R1")
    assert commander.text("level") == "DM-FoliageRoom"
    commander.until(
        lambda: "R1: radar sees through with" in commander.text("finding"),
        "for what it sees",
    )
    for canvas in ("#plan", "#radar canvas"):
        commander.until(
            lambda canvas=canvas: (  # type: ignore[misc]
                commander.page.locator(canvas).evaluate(PAINTED) > 5000
            ),
            f"for {canvas}",
        )
    assert "foliage" in commander.text("materials")


def test_nothing_is_fetched_from_elsewhere(commander: CommanderPage) -> None:
    commander.add_robot("R1")
    for view in ("space", "map", "plan"):
        commander.page.click(f"[data-view={view}]")
        commander.page.wait_for_timeout(300)
    assert commander.hosts == {"127.0.0.1"}


def test_the_scene_in_3d_is_painted(commander: CommanderPage) -> None:
    commander.add_robot("R1")
    commander.page.click("[data-view=space]")
    commander.page.wait_for_selector("#space[data-engine]")

    def colours() -> int:
        picture = commander.page.locator("#space").screenshot()
        return len(set(picture))  # of a compressed picture: a plain one has few

    commander.until(lambda: colours() > 200, "for the scene in 3D")


def test_the_token_leaves_the_address_bar_and_a_reload_loses_nothing(
    commander: CommanderPage,
) -> None:
    commander.add_robot("R1")
    assert "token" not in commander.page.url
    commander.page.reload()
    commander.until(lambda: commander.text("driven") == "R1", "for the robot")


def test_a_wrong_token_shows_nothing(served: Served, browser: Browser) -> None:
    page = CommanderPage(browser.new_page())
    page.page.goto(served.url.partition("#")[0] + "#token=wrong")
    page.until(lambda: page.text("link") == "wrong token")
    assert page.frames == []
    assert page.text("level") == ""
    page.page.close()


def test_an_address_without_its_token_says_so(served: Served, browser: Browser) -> None:
    context = browser.new_context()  # no token is left from before
    page = CommanderPage(context.new_page())
    page.page.goto(served.url.partition("#")[0])
    page.until(lambda: page.text("link") == "no token")
    assert "whole address" in page.text("lost")
    context.close()


def test_the_page_is_refused_under_a_foreign_name(
    served: Served, browser: Browser, chromium: str
) -> None:
    rules = "--host-resolver-rules=MAP evil.example 127.0.0.1"
    other = browser.browser_type.launch(
        executable_path=chromium, args=[*CHROMIUM_OPTIONS, rules]
    )
    url = served.url.replace("127.0.0.1", "evil.example")
    response = other.new_page().goto(url)
    assert response is not None
    assert response.status == 403
    other.close()


def test_a_page_of_another_site_gets_neither_page_nor_socket(
    served: Served, browser: Browser
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as site:
        page = browser.new_page()
        page.route("**/evil", lambda route: route.fulfill(body="<p>hello</p>"))
        page.goto(f"http://127.0.0.1:{site.getsockname()[1]}/evil")
        own = served.url.partition("#")[0]
        fetched = page.evaluate(
            "url => fetch(url).then(() => 'answered', () => 'refused')", own
        )
        token = served.url.partition("token=")[2]
        heard = page.evaluate(
            """([url, token]) => new Promise((resolve) => {
                const socket = new WebSocket(url);
                socket.onopen = () => socket.send(JSON.stringify({op: "hello", token}));
                socket.onmessage = () => resolve("told");
                socket.onclose = () => resolve("closed");
            })""",
            [own.replace("http", "ws") + "ws", token],
        )
        page.close()
    assert (fetched, heard) == ("refused", "closed")


def test_names_of_robots_and_maps_are_text(
    open_page: Callable[..., CommanderPage], tmp_path: Path
) -> None:
    map_file = tmp_path / "nasty.yaml"
    map_file.write_text(NASTY_MAP.format(name=NASTY))
    with serve(str(map_file)) as served:
        commander = open_page(served)
        commander.add_robot(NASTY)
        assert NASTY in commander.text("level")
        assert NASTY in commander.text("robots")
        assert commander.page.locator("body img").count() == 0
        commander.page.click("[data-view=space]")
        commander.page.wait_for_timeout(300)
        commander.page.context.close()


def test_a_page_of_another_site_spawns_no_robot(
    browser: Browser, served: Served, truth: Truth
) -> None:
    host, port = served.address
    with socket.create_server(("127.0.0.1", 0)) as site:
        page = browser.new_page()
        page.route("**/evil", lambda route: route.fulfill(body="<p>hello</p>"))
        page.goto(f"http://127.0.0.1:{site.getsockname()[1]}/evil")
        body = "INIT {ClassName USARBot.P3AT} {Name Evil}\r\nDRIVE {Left 3} {Right 3}"
        sent = page.evaluate(
            """([url, body]) => fetch(url, {method: "POST", mode: "no-cors", body})
                .then(() => "answered", () => "refused")""",
            [f"http://{host}:{port}/", f"\r\n{body}\r\n"],
        )
        page.close()
    assert sent == "refused"
    assert "Evil" not in truth.names
    assert "Evil" not in truth.places


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_readings_stand_out_in_light_and_dark(
    open_page: Callable[..., CommanderPage], served: Served, scheme: str
) -> None:
    commander = open_page(served, color_scheme=scheme)
    paper = commander.page.evaluate(
        "getComputedStyle(document.querySelector('.stage')).backgroundColor"
    )
    assert paper == {"light": "rgb(255, 255, 255)", "dark": "rgb(27, 30, 35)"}[scheme]
