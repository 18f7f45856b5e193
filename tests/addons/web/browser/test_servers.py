"""The page with servers that are lost, speak another dialect, or cannot watch."""

from collections.abc import Callable
from pathlib import Path

from commander_page import CommanderPage
from deaf_to_watch import without_watch
from served_page import serve_robots, show

OpenPage = Callable[..., CommanderPage]


def test_a_lost_server_is_told_and_a_new_one_is_found(
    open_page: OpenPage, tmp_path: Path
) -> None:
    words = ("--draw", "empty_room", "--record-to", str(tmp_path))
    with (
        serve_robots("empty_room") as (process, address),
        show(address, *words) as served,
    ):
        commander = open_page(served)
        lost = commander.page.locator("#lost")
        commander.add_robot("L1")
        commander.page.click("#record")
        commander.until(lambda: "Records to" in commander.text("notice"))
        assert lost.is_hidden()
        process.kill()
        process.wait()
        commander.until(lost.is_visible, "for the banner")
        assert "connect" in commander.text("lost")
        commander.until(lambda: "Recorded in" in commander.text("notice"))
        (folder,) = tmp_path.iterdir()
        assert (folder / "metadata.yaml").exists()
        assert "stale" in (commander.page.locator("body").get_attribute("class") or "")
        with serve_robots("empty_room", port=address[1]):
            commander.until(lost.is_hidden, "for the new server")
            commander.add_robot("L2")
            assert commander.robot("L1") is None
            commander.page.context.close()


def test_a_server_that_cannot_watch_shows_the_pages_own_robots(
    open_page: OpenPage,
) -> None:
    with (
        serve_robots("empty_room") as (_, address),
        without_watch(address) as other,
        show(other) as served,
    ):
        commander = open_page(served)
        commander.add_robot("N1", kind="P3AT", echoes=False)
        assert "does not tell what they meet" in commander.text("finding")
        assert commander.page.locator("#settings input:visible").count() == 0
        robot = commander.robot("N1")
        assert robot is not None
        commander.page.focus("#plan")
        commander.page.keyboard.down("w")
        commander.until(lambda: commander.robot("N1")["x"] > robot["x"] + 0.2)  # type: ignore[index]
        commander.page.keyboard.up("w")
        commander.page.context.close()
