"""What robots do by themselves when the page asks for it."""

import pytest
from commander_page import CommanderPage
from truth import Truth

GOAL = (-4.0, 3.0)
BEHIND = 1.7  # m, x behind the bushes
# How many pixels of the drawn map are light, west and east of a column of the canvas.
FREE = """(canvas, column) => {
  const pen = canvas.getContext("2d");
  const { data, width } = pen.getImageData(0, 0, canvas.width, canvas.height);
  let free = 0;
  for (let i = 0; i < data.length; i += 4)
    if ((i / 4) % width > column && data[i] > 240 && data[i + 1] > 240) free++;
  return free;
}"""


def test_a_shift_click_drives_the_robot_there_by_bug2(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.add_robot("Bug", place=(-8, 0, 0))
    commander.page.locator("#goto [name=algorithm]").select_option(label="Bug2")
    left, top = commander.point(*GOAL)
    plan = commander.page.locator("#plan")
    plan.click(position={"x": left, "y": top}, modifiers=["Shift"])
    commander.until(lambda: "done" in commander.text("tasks"), "for the goal")
    place = truth.last("Bug")
    assert place.x == pytest.approx(GOAL[0], abs=0.6)
    assert place.y == pytest.approx(GOAL[1], abs=0.6)


def test_stop_cancels_a_task(commander: CommanderPage, truth: Truth) -> None:
    commander.add_robot("Stopped", place=(-8, 0, 0))
    start = truth.last("Stopped")
    commander.page.locator("#goto [name=x]").fill("-2")
    commander.page.locator("#goto button.main").click()
    commander.until(lambda: truth.last("Stopped").distance(start) > 0.1, "for a start")
    commander.page.keyboard.press("Space")
    commander.until(lambda: "cancelled" in commander.text("tasks"), "for the end")
    assert truth.last("Stopped").x < -2.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "sees"), [("P3AT_Radar360", True), ("P3AT_SICK", False)]
)
def test_a_map_grows_behind_the_hedge_with_the_radar_alone(
    commander: CommanderPage, kind: str, sees: bool
) -> None:
    commander.add_robot("Mapper", kind=kind, place=(-8, 0, 0))
    commander.page.click("[data-view=map]")
    commander.page.locator("#explore button.main").click()
    canvas = commander.page.locator("#plan")
    column = commander.point(BEHIND + 1, 0)[0]

    def free_behind() -> int:
        return int(canvas.evaluate(FREE, column))

    blank = free_behind()
    commander.until(lambda: "no map" not in commander.text("finding"), "for a map")
    if sees:
        commander.until(lambda: free_behind() > blank + 2000, "for free floor")
    else:
        commander.page.wait_for_timeout(10_000)
        assert free_behind() <= blank
