"""What robots do by themselves when the page asks for it."""

import io
import math
from base64 import b64decode

import numpy as np
import pytest
from commander_page import CommanderPage
from PIL import Image
from truth import Truth

GOAL = (-6.6, 0.8)
BEHIND = 1.7  # m, x behind the bushes


def test_a_shift_click_drives_the_robot_there_by_bug2(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.add_robot("Bug", kind="P3AT_Radar360", place=(-8, 0, 0))
    commander.page.locator("#goto [name=algorithm]").select_option(label="Bug2")
    left, top = commander.point(*GOAL)
    plan = commander.page.locator("#plan")
    plan.click(position={"x": left, "y": top}, modifiers=["Shift"])
    commander.until(lambda: "done" in commander.text("tasks"), "for the goal")
    place = truth.last("Bug")
    assert place.x == pytest.approx(GOAL[0], abs=0.5)
    assert place.y == pytest.approx(GOAL[1], abs=0.5)


def test_stop_cancels_a_task(commander: CommanderPage, truth: Truth) -> None:
    commander.add_robot("Stopped", kind="P3AT_Radar360", place=(-8, 0, 0))
    start = truth.last("Stopped")
    commander.page.locator("#goto [name=x]").fill("-2")
    commander.page.locator("#goto button.main").click()
    commander.until(lambda: truth.last("Stopped").distance(start) > 0.1, "for a start")
    commander.page.keyboard.press("Space")
    commander.until(lambda: "cancelled" in commander.text("tasks"), "for the end")
    assert truth.last("Stopped").x < -2.5


@pytest.mark.parametrize(("scanner", "sees"), [("lms200", True), ("Hokuyo", False)])
def test_a_map_grows_behind_the_hedge_with_the_radar_alone(
    commander: CommanderPage, scanner: str, sees: bool
) -> None:
    commander.add_robot("Mapper", place=(-3.2, 0.6, 0))
    commander.page.click("[data-view=map]")
    commander.page.locator("#beam [name=scanner]").select_option(scanner)
    commander.page.locator("#mapping [name=on]").check()
    commander.until(lambda: free_behind(commander) is not None, "for a map")
    if sees:
        commander.until(lambda: (free_behind(commander) or 0) > 1, "for free floor")
    else:
        commander.page.wait_for_timeout(2500)
        assert free_behind(commander) == 0


def free_behind(commander: CommanderPage) -> float | None:
    """Return how much floor behind the hedge a map has as free, m²; None without."""
    if commander.map is None or not commander.map["png"]:
        return None
    pixels = np.asarray(Image.open(io.BytesIO(b64decode(commander.map["png"]))))
    size = commander.map["resolution"]
    column = max(0, math.ceil((BEHIND - commander.map["origin"][0]) / size))
    return float((pixels[:, column:] == 255).all(axis=2).sum() * size**2)
