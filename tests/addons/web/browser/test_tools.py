"""What one does in the plan: add a robot, pick a goal, explain a beam, measure."""

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
    run = run_in_process(*words.split(), "--ray", "centre", "--format", "json")
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
    assert [row[1] for row in rows] == ["enters", "is spent in"]
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
