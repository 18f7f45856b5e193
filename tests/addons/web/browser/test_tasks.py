"""What robots do by themselves when the page asks for it."""

import io
import math
from base64 import b64decode
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commander_page import CommanderPage
from PIL import Image
from served_page import serve
from truth import Truth

GOAL = (-7.2, 0.4)
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


def test_a_drag_from_the_goal_gives_the_heading(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.add_robot("Turner", kind="P3AT_Compare360", place=(-8, 0, 0))
    heading = commander.page.locator("#goto [name=heading]")
    assert heading.input_value() == ""
    commander.page.click("#goal-pick")
    canvas = commander.page.locator("#plan").bounding_box()
    assert canvas is not None
    left, top = commander.point(*GOAL)
    left, top = left + canvas["x"], top + canvas["y"]
    commander.page.mouse.move(left, top)
    commander.page.mouse.down()
    commander.page.mouse.move(left, top + 20)
    commander.page.mouse.move(left, top + 60)  # to the south
    commander.page.mouse.up()
    assert heading.input_value() == "-90"
    commander.until(lambda: "done" in commander.text("tasks"), "for the goal")
    assert "facing -90°" in commander.text("tasks")
    place = truth.last("Turner")
    assert (place.x, place.y) == pytest.approx(GOAL, abs=0.5)
    assert commander.robot("Turner")["yaw"] == pytest.approx(-math.pi / 2, abs=0.1)
    commander.until(lambda: commander.paths["Turner"]["heading"] is not None)
    assert commander.paths["Turner"]["heading"] == pytest.approx(-math.pi / 2)
    # Without a heading in the form the robot ends as it arrives.
    heading.fill("")
    commander.page.click("#goto button.main")
    commander.until(lambda: commander.paths["Turner"]["heading"] is None)


BLOCKED_MAP = """
version: 1
level: DM-Blocked
materials: {concrete: {density: opaque}}
objects:
  - {name: floor, box: [9, 6, 0.2], position: [0, 0, -0.1], material: concrete}
  - {name: block, box: [0.6, 1.2, 1], position: [0, 0, 0.5], material: concrete}
  - {name: west, box: [0.2, 6, 1], position: [-4.5, 0, 0.5], material: concrete}
  - {name: east, box: [0.2, 6, 1], position: [4.5, 0, 0.5], material: concrete}
  - {name: south, box: [9, 0.2, 1], position: [0, -3, 0.5], material: concrete}
  - {name: north, box: [9, 0.2, 1], position: [0, 3, 0.5], material: concrete}
starts:
  - {name: RobotStart1, position: [-3, 0, 0]}
"""
PIXEL = """(canvas, [left, top]) => {
  const density = canvas.width / canvas.clientWidth;
  const pen = canvas.getContext("2d");
  return [...pen.getImageData(left * density, top * density, 1, 1).data.slice(0, 3)];
}"""
HIT = [0xFF, 0xC8, 0x00]  # --hit
LEAVE = [0x06, 0xA8, 0xFE]  # --leave


@pytest.mark.slow
def test_bug2_goes_around_a_block_and_the_page_shows_where(
    open_page: Callable[..., CommanderPage], tmp_path: Path
) -> None:
    map_file = tmp_path / "blocked.yaml"
    map_file.write_text(BLOCKED_MAP)
    with serve(str(map_file), "--speed", "3") as served:
        commander = open_page(served)
        commander.add_robot("Bug", kind="P3AT_Compare360")
        commander.page.locator("#goto [name=algorithm]").select_option(label="Bug2")
        left, top = commander.point(3, 0)
        plan = commander.page.locator("#plan")
        plan.click(position={"x": left, "y": top}, modifiers=["Shift"])
        commander.until(lambda: "done" in commander.text("tasks"), "for the goal")
        path = commander.paths["Bug"]
        (hit,), (leave,) = path["hits"], path["leaves"]
        assert -2 < hit[0] < -0.3
        assert 0.3 < leave[0] < 3  # between the block and the goal
        assert leave[1] == pytest.approx(0, abs=0.2)  # on the line to the goal
        assert plan.evaluate(PIXEL, commander.point(*hit)) == HIT
        assert plan.evaluate(PIXEL, commander.point(*leave)) == LEAVE
        assert "hit point" in commander.text("legend")
        commander.page.context.close()


def test_go_is_offered_to_robots_that_can(commander: CommanderPage) -> None:
    go = commander.page.locator("#goto button.main")
    commander.add_robot("Half", kind="P3AT", place=(-8, 0, 0))
    commander.until(lambda: "180°" in commander.text("hindrance"), "for the reason")
    assert go.is_disabled()
    commander.add_robot("Whole", kind="P3AT_Compare360", place=(-8, -2, 0))
    commander.until(go.is_enabled, "for what it can do")
    assert commander.text("hindrance") == ""


def test_a_map_grows_behind_the_hedge_with_the_radar_alone(
    commander: CommanderPage,
) -> None:
    commander.add_robot("Mapper", place=(-3.2, 0.6, 0))
    commander.page.click("[data-view=map]")
    switch = commander.page.locator("#mapping [name=on]")
    scanner = commander.page.locator("#beam [name=scanner]")
    scanner.select_option("Hokuyo")
    switch.check()
    commander.until(lambda: free_behind(commander) is not None, "for a map")
    assert free_behind(commander) == 0
    switch.uncheck()
    commander.until(lambda: free_behind(commander) is None, "for its end")
    scanner.select_option("lms200")
    switch.check()
    commander.until(lambda: (free_behind(commander) or 0) > 1, "for free floor")


def free_behind(commander: CommanderPage) -> float | None:
    """Return how much floor behind the hedge a map has as free, m²; None without."""
    if commander.map is None or not commander.map["png"]:
        return None
    pixels = np.asarray(Image.open(io.BytesIO(b64decode(commander.map["png"]))))
    size = commander.map["resolution"]
    column = max(0, math.ceil((BEHIND - commander.map["origin"][0]) / size))
    return float((pixels[:, column:] == 255).all(axis=2).sum() * size**2)
