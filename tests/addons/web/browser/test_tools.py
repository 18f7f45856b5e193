"""What one does in the plan: add a robot, pick a goal, explain a beam, measure."""

import functools
import io
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commander_page import CommanderPage
from commands import run_in_process
from PIL import Image
from served_page import Served

WALL = (8.7, -3.0)  # m; near the eastern wall of the room


def click(page: CommanderPage, x: float, y: float) -> None:
    """Click a point of the map, m."""
    left, top = page.point(x, y)
    page.page.click("#plan", position={"x": left, "y": top})


def test_a_click_on_a_free_start_adds_a_robot_there(commander: CommanderPage) -> None:
    # Another one stands in the middle, so that the first free start is not meant.
    click(commander, -8, -3.5)
    commander.until(lambda: bool(commander.robot("R1")), "for the robot")
    robot = commander.robot("R1")
    assert (robot["x"], robot["y"]) == pytest.approx((-8, -3.5), abs=0.05)
    # The start is taken: a click there explains a beam, and adds nothing.
    commander.until(lambda: bool(commander.robot("R1")["scans"]), "for a scan")
    click(commander, -8, -3.5)
    commander.until(lambda: "Beam " in commander.text("reading"), "for the beam")
    assert len(commander.frames[-1]["robots"]) == 1


def test_a_goal_too_near_to_a_wall_is_refused_before_the_drive(
    commander: CommanderPage,
) -> None:
    commander.add_robot("R1", kind="P3AT_Compare360", place=(-8, 0, 0))
    commander.page.click("#goal-pick")
    click(commander, *WALL)
    commander.until(lambda: "too near" in commander.text("error"), "for the error")
    assert "east" in commander.text("error")
    assert commander.text("tasks") == ""
    # The same place by numbers is refused by the commander.
    commander.page.keyboard.press("Escape")
    for name, value in zip(("x", "y"), WALL, strict=True):
        commander.page.locator(f"#goto [name={name}]").fill(str(value))
    commander.page.click("#goto button.main")
    commander.until(
        lambda: "safety distance" in commander.text("error"), "for the error"
    )
    assert commander.text("tasks") == ""


def test_a_line_is_measured(commander: CommanderPage) -> None:
    commander.page.click("#measure")
    click(commander, -4, 1)
    click(commander, 0, 4)
    commander.until(lambda: commander.text("aim").endswith("°"), "for the length")
    length, _, angle = commander.text("aim").partition(" m, ")
    assert float(length) == pytest.approx(5.0, abs=0.05)
    degrees = math.degrees(math.atan2(3, 4))
    assert float(angle.rstrip("°")) == pytest.approx(degrees, abs=1)
    commander.page.keyboard.press("Escape")
    commander.until(lambda: commander.page.locator("#aim").is_hidden(), "for its end")


@pytest.mark.parametrize("view", ["plan", "space"])
def test_the_view_is_saved_as_a_picture(
    commander: CommanderPage, tmp_path: Path, view: str
) -> None:
    commander.add_robot("R1")
    commander.page.click(f"[data-view={view}]")
    if view == "space":
        commander.page.wait_for_selector("#space[data-engine]")
        commander.page.wait_for_timeout(500)
    with commander.page.expect_download() as download:
        commander.page.click("#picture")
    assert download.value.suggested_filename.startswith("DM-FoliageRoom_")
    download.value.save_as(tmp_path / "view.png")
    picture = Image.open(tmp_path / "view.png")
    box = commander.page.locator(f"#{view}").bounding_box()
    assert box is not None
    assert picture.width == round(box["width"])
    colours = picture.convert("RGB").getcolors(maxcolors=2**24)
    assert colours is not None
    assert len(colours) > 100


def test_ten_robots_have_colours_of_their_own(commander: CommanderPage) -> None:
    commander.add_robot("C1", place=(-8, 0, 0))
    commander.add_robot("C2", place=(-8, 3.5, 0))
    commander.until(lambda: bool(commander.robot("C1")["colour"]), "for colours")
    colours = [commander.robot(name)["colour"] for name in ("C1", "C2")]
    assert len(set(colours)) == 2
    # What the robot that is not selected reads has its colour.
    picture = commander.page.locator("#plan").screenshot()
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).reshape(-1, 3)
    red, green, blue = (int(colours[0][i : i + 2], 16) for i in (1, 3, 5))
    near = np.abs(pixels.astype(int) - (red, green, blue)).max(axis=1) < 40
    assert near.sum() > 100


COUNT = """([canvas, colour]) => {
  const pen = canvas.getContext("2d");
  const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    count += colour.every((part, k) => Math.abs(data[i + k] - part) < 20);
  }
  return count;
}"""
LAYERS = {  # a colour of each, and how many pixels have it at least
    ("Rays", "radar"): ((0xDD, 0xD7, 0xFB), 4000),
    ("Readings", "laser"): ((0xFE, 0x5A, 0x0B), 300),
    ("Other", "true scene"): ((0xBE, 0xD0, 0x8B), 4000),
}


def test_layers_are_switched_off_and_stay_off(commander: CommanderPage) -> None:
    commander.add_robot("R1", kind="P3AT_Compare360", place=(-8, 0, 0))
    page = commander.page
    plan = page.locator("#plan").element_handle()
    page.keyboard.press("Escape")
    page.click("#zoom-fit")  # so that keys act on the scene
    page.keyboard.press("l")
    boxes = [
        page.get_by_role("group", name=group).get_by_label(name)
        for group, name in LAYERS
    ]
    for box, (colour, least) in zip(boxes, LAYERS.values(), strict=True):
        count = functools.partial(page.evaluate, COUNT, [plan, colour])
        commander.until(lambda: count() > least, "for a layer")  # noqa: B023
        box.focus()
        page.keyboard.press("Space")
        commander.until(lambda: count() < least / 10, "for its end")  # noqa: B023
    commander.until(lambda: "foliage" not in commander.text("legend"), "for the legend")
    assert "radar reading" in commander.text("legend")
    assert "laser reading" not in commander.text("legend")
    assert "ray" not in commander.text("legend")
    page.reload()
    commander.until(lambda: commander.text("driven") == "R1", "for the page")
    assert page.locator("#layers input:not(:checked)").count() == 3
    page.click("[data-view=space]")
    page.wait_for_selector("#space[data-engine]")
    commander.until(lambda: "reading" in commander.text("legend"), "for the 3D view")
    assert "ray" not in commander.text("legend")


SCALES = """() => import("/static/polar.js").then(({ outerRange }) => {
  const robot = (name, ...ranges) => {
    return { name, scans: [{ ranges: Float32Array.from(ranges) }] };
  };
  const near = Array(179).fill(8);
  return [
    outerRange(robot("R", 29, 8, ...near), 0),
    outerRange(robot("R", 29, 29, ...near), 0),
    outerRange(robot("R", 8, 8, ...near), 2000),
    outerRange(robot("R", 8, 8, ...near), 4000),
    outerRange(robot("S"), 0),
    outerRange(robot("T", Infinity, 4), 0),
  ];
})"""


def test_one_far_beam_does_not_change_the_scale_of_scans(
    commander: CommanderPage,
) -> None:
    assert commander.page.evaluate(SCALES) == [10, 30, 30, 10, 2, 5]


def test_plan_has_the_height_that_it_needs(commander: CommanderPage) -> None:
    box = commander.page.locator("#plan").bounding_box()
    assert box is not None
    west, south, east, north = commander.bounds
    (left, top), (right, bottom) = (
        commander.point(west, north),
        commander.point(east, south),
    )
    assert right - left == pytest.approx(box["width"] - 28, abs=1)  # all the width
    assert 0 < top < bottom < box["height"]


@pytest.mark.parametrize(
    ("touch", "sizes"),
    [(False, [(1280, 800), (1920, 1080)]), (True, [(1024, 600), (390, 844)])],
)
def test_nothing_is_cut_off_and_time_and_stop_are_in_reach(
    open_page: Callable[..., CommanderPage],
    served: Served,
    touch: bool,
    sizes: list[tuple[int, int]],
) -> None:
    page = open_page(served, has_touch=touch)
    page.add_robot("R1", kind="P3AT_Compare360")
    for name in ("x", "y"):  # numbers of goals fit into their fields
        field = page.page.locator(f"#goto [name={name}]")
        field.fill("-123.45")
        assert field.evaluate("field => field.scrollWidth <= field.clientWidth")
    for width, height in sizes:
        page.page.set_viewport_size({"width": width, "height": height})
        check_layout(page, width, height)
        if touch:
            small = page.page.evaluate(
                """() => [...document.querySelectorAll("button, select")]
                    .filter((one) => one.offsetParent && one.offsetHeight < 36)
                    .map((one) => one.id || one.textContent)"""
            )
            assert small == []
    page.remove_robots()


def check_layout(page: CommanderPage, width: int, height: int) -> None:
    assert page.page.evaluate("document.documentElement.scrollWidth") <= width
    page.page.evaluate("scrollTo(0, 0)")
    for name in ("#stop", "#pause", "#step", "#plan", "#measure", "#picture"):
        box = page.page.locator(name).bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] + min(box["height"], 300) <= height


BUSH = (0.4, 0.3)  # m, within bush_4
TABLE = "#rows tbody td"


def set_slider(commander: CommanderPage, label: str, value: float) -> None:
    """Set a slider, and wait until the scanner has that value."""
    slider = commander.page.get_by_label(label)
    slider.fill(str(value))
    commander.page.wait_for_timeout(2000)  # it shows what was set by hand till then
    commander.until(lambda: float(slider.input_value()) == value, f"for {label}")


def select_beam(commander: CommanderPage, number: int) -> list[list[str]]:
    """Select a beam by its number, and return the table of what it meets."""
    commander.page.locator("#beam [name=beam]").fill(str(number))
    commander.until(lambda: f"Beam {number} " in commander.text("reading"))
    commander.page.locator("#beam [name=hold]").check()
    cells = commander.page.locator(TABLE).all_text_contents()
    commander.page.locator("#beam [name=hold]").uncheck()
    return [cells[row : row + 4] for row in range(0, len(cells), 4)]


def explain(beam: int) -> dict[str, float]:
    """Return where a bush begins and where the power ends, by ``radarsim explain``."""
    words = f"explain foliage_room --sensor radar --start RobotStart1 --beam {beam}"
    options = ("--set", "ray_weights=0,1,0", "--format", "json")
    run = run_in_process(*words.split(), *options)
    report = json.loads(run.out)
    return {"enter": report["crossings"][0]["entry"], "end": report["distance"]}


def test_a_click_on_a_bush_shows_the_numbers_of_explain(
    commander: CommanderPage,
) -> None:
    commander.add_robot("B1", place=(-8, 0, 0))
    set_slider(commander, "Side offset", 0)  # all three rays are the centre ray then
    left, top = commander.point(*BUSH)
    commander.page.locator("#plan").click(position={"x": left, "y": top})
    commander.until(lambda: commander.text("reading").startswith("Beam "))
    number = int(commander.text("reading").split()[1])
    assert number == 92
    rows = select_beam(commander, number)
    expected = explain(number)
    assert [row[1] for row in rows] == ["enters", "is depleted in"]
    assert [row[2] for row in rows] == ["bush_4 (foliage)"] * 2
    assert float(rows[0][0]) == pytest.approx(expected["enter"], abs=0.011)
    assert float(rows[1][0]) == pytest.approx(expected["end"], abs=0.011)
    assert [float(row[3]) for row in rows] == [1, 0]


def test_a_click_in_the_laser_scan_explains_a_beam_of_the_laser(
    commander: CommanderPage,
) -> None:
    commander.add_robot("L1", place=(-3, 0, 0))
    commander.page.locator("#laser canvas").click()
    commander.until(lambda: commander.text("reading").startswith("Beam "))
    assert commander.page.locator("#beam [name=scanner]").input_value() == "Hokuyo"
    assert "power" not in commander.text("error")
    assert commander.page.locator("#laser .name").text_content() == "Laser “Hokuyo”"
    chosen = commander.page.locator("#beam [name=scanner] option:checked")
    assert chosen.text_content() == "laser “Hokuyo”"
    assert commander.text("settings-heading") == "Sensor: laser “Hokuyo”"
