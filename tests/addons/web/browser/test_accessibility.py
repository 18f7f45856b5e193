"""The page for people who see little, use no mouse, or have a small screen."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commander_page import CommanderPage
from served_page import Served

AXE = Path(__file__).parent / "axe" / "axe.min.js"
SERIOUS = ("serious", "critical")
# Each view, in a browser of another kind.
VIEWS: dict[str, dict[str, Any]] = {
    "plan": {},
    "map": {"color_scheme": "dark"},
    "space": {"viewport": {"width": 390, "height": 844}},
}


def check(commander: CommanderPage) -> None:
    """Check a page as it is with axe-core."""
    commander.page.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
    result = commander.page.evaluate("axe.run()")
    found = [
        f"{each['id']}: {[node['html'] for node in each['nodes']]}"
        for each in result["violations"]
        if each["impact"] in SERIOUS
    ]
    assert found == []


@pytest.mark.slow
def test_no_view_has_a_serious_finding(
    commander: CommanderPage, served: Served, open_page: Callable[..., CommanderPage]
) -> None:
    check(commander)  # without robots
    commander.add_robot("X1", place=(-8, 0, 0))
    for view, options in VIEWS.items():
        other = open_page(served, **options)
        other.until(lambda other=other: other.text("driven") == "X1", f"for {view}")  # type: ignore[misc]
        other.page.locator("#beam [name=beam]").fill("92")
        other.page.evaluate(
            "document.querySelectorAll('details').forEach((e) => { e.open = true })"
        )
        other.page.click(f"[data-view={view}]")
        other.until(lambda other=other: "Beam 92 " in other.text("reading"))  # type: ignore[misc]
        check(other)


def test_a_robot_is_added_driven_and_removed_by_keys_alone(
    commander: CommanderPage,
) -> None:
    page = commander.page

    def go_to(selector: str) -> None:
        for _ in range(120):
            if page.evaluate("s => document.activeElement?.matches(s)", selector):
                return
            page.keyboard.press("Tab")
        raise AssertionError(f"Tab does not reach {selector}")

    go_to("#spawn [name=name]")
    page.keyboard.type("Keys")
    page.keyboard.press("Enter")
    commander.until(lambda: commander.text("driven") == "Keys", "for the robot")
    page.keyboard.press("Escape")
    go_to("#plan")
    before = commander.robot("Keys")
    page.keyboard.down("d")
    commander.until(
        lambda: commander.robot("Keys")["yaw"] < before["yaw"] - 0.1,
        "for a turn",
    )
    page.keyboard.up("d")
    page.keyboard.press("ArrowLeft")
    commander.until(lambda: "Beam" in commander.text("reading"), "for a beam")
    go_to("#remove")
    page.keyboard.press("Enter")
    commander.until(lambda: not commander.robot("Keys"), "for its end")
