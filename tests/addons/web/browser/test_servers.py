"""The page with servers that are lost, are foreign, or cannot watch."""

from collections.abc import Callable

from commander_page import CommanderPage
from served_page import run_commander

from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.server_thread import ServerThread

OpenPage = Callable[..., CommanderPage]


class WithoutWatch(Host):
    """A host that knows no WATCH."""

    def receive(self, number: int, data: bytes) -> list[Diagnostic]:
        lines = data.splitlines(keepends=True)
        known = [line for line in lines if not line.startswith(b"WATCH")]
        return super().receive(number, b"".join(known))


def test_a_lost_server_is_reported_and_a_new_one_is_found(
    empty_room: Scene, open_page: OpenPage
) -> None:
    first, second = (ServerThread(Host(empty_room), speed=1.0) for _ in range(2))
    address = first.begin()
    with run_commander(address, map_="empty_room") as running:
        commander = open_page(running)
        lost = commander.page.locator("#lost")
        commander.add_robot("L1")
        assert lost.is_hidden()
        first.finish()
        commander.until(lost.is_visible, "for the banner")
        assert "stale" in (commander.page.locator("body").get_attribute("class") or "")
        commander.until(lambda: "no server" in commander.text("lost"))
        second.begin(port=address[1])
        commander.until(lost.is_hidden, "for the new server")
        commander.add_robot("L2")
        assert not commander.robot("L1")
        commander.page.context.close()
    second.finish()


def test_a_foreign_server_that_cannot_watch_has_its_page(
    foliage_room: Scene, open_page: OpenPage
) -> None:
    """It shows robots of its own, and says why time cannot be changed."""
    server = ServerThread(WithoutWatch(foliage_room), speed=1.0)
    with run_commander(server.begin()) as running:
        commander = open_page(running)
        for name in ("#pause", "#step", "#speed"):
            commander.page.wait_for_selector(f"{name}:disabled")
            assert "--web" in (commander.page.get_attribute(name, "title") or "")
        commander.add_robot("N1", kind="P3AT", echoes=False)
        assert "does not report echoes" in commander.text("finding")
        assert commander.page.locator("#settings input:visible").count() == 0
        robot = commander.robot("N1")
        assert robot is not None
        commander.page.focus("#plan")
        commander.page.keyboard.down("w")
        commander.until(lambda: commander.robot("N1")["x"] > robot["x"] + 0.2)
        commander.page.keyboard.up("w")
        commander.page.context.close()
    server.finish()
