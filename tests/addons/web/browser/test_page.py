"""The page in a browser: what it shows, asks for, and lets nobody do."""

from collections.abc import Callable
from pathlib import Path

from commander_page import CommanderPage
from playwright.sync_api import Browser
from served_page import Served, run_commander

from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread

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
        lambda: "radar beams pass through" in commander.text("finding"),
        "for what it sees",
    )
    for canvas, least in (("#plan", 5000), ("#radar canvas", 1000)):
        commander.until(
            lambda canvas=canvas, least=least: (  # type: ignore[misc]
                commander.page.locator(canvas).evaluate(PAINTED) > least
            ),
            f"for {canvas}",
        )
    assert "foliage" in commander.text("materials")


def test_the_scene_in_3d_is_painted_and_nothing_fetched_from_elsewhere(
    commander: CommanderPage,
) -> None:
    commander.add_robot("R1")
    commander.page.click("[data-view=map]")
    commander.page.click("[data-view=space]")
    commander.page.wait_for_selector("#space[data-engine]")

    def colours() -> int:
        picture = commander.page.locator("#space").screenshot()
        return len(set(picture))  # of a compressed picture: a plain one has few

    commander.until(lambda: colours() > 200, "for the scene in 3D")
    assert commander.hosts == {"127.0.0.1"}


def test_the_token_leaves_the_address_bar_and_a_reload_loses_nothing(
    commander: CommanderPage,
) -> None:
    commander.add_robot("R1")
    assert "token" not in commander.page.url
    commander.page.reload()
    commander.until(lambda: commander.text("driven") == "R1", "for the robot")


def test_addresses_with_a_wrong_token_and_without_one_say_so(
    served: Served, browser: Browser
) -> None:
    address = served.url.partition("#")[0]
    for fragment, message in (("#token=wrong", "wrong token"), ("", "no token")):
        context = browser.new_context()  # no token is left from before
        page = CommanderPage(context.new_page())
        page.page.goto(address + fragment)
        page.until(lambda page=page, message=message: page.text("link") == message)  # type: ignore[misc]
        assert page.frames == []
        assert page.text("level") == ""
        context.close()


def test_names_of_robots_and_maps_are_text(
    open_page: Callable[..., CommanderPage], tmp_path: Path
) -> None:
    map_file = tmp_path / "nasty.yaml"
    map_file.write_text(NASTY_MAP.format(name=NASTY))
    server = ServerThread(Host(load_map(map_file)), speed=1.0)
    with run_commander(server.begin(), map_=str(map_file)) as running:
        commander = open_page(running)
        commander.add_robot(NASTY)
        assert NASTY in commander.text("level")
        assert NASTY in commander.text("robots")
        assert commander.page.locator("body img").count() == 0
        commander.page.click("[data-view=space]")
        commander.page.wait_for_timeout(300)
        commander.page.context.close()
    server.finish()


def test_legend_names_what_is_drawn(commander: CommanderPage) -> None:
    commander.add_robot("R1", place=(-8, 0, 0))
    drawn = ("radar ray", "radar reading", "reading behind", "depleted", "free start")
    commander.until(lambda: all(each in commander.text("legend") for each in drawn))
    # The laser reads nothing within 4 m.
    assert "laser" not in commander.text("legend")
    commander.page.locator("#beam [name=scanner]").select_option("Hokuyo")
    commander.until(lambda: "laser ray" in commander.text("legend"))
    commander.until(lambda: "power depleted" not in commander.text("legend"))
    commander.page.click("[data-view=map]")
    commander.page.locator("#mapping [name=on]").check()
    commander.until(lambda: "not sensed" in commander.text("legend"), "for a map")
    assert "smoke" not in commander.text("legend")
