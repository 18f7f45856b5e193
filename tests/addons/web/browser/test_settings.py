"""Settings of sensors in the page, and what beams meet by them."""

import json
import statistics

import pytest
from commander_page import CommanderPage
from commands import run_in_process

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


def test_a_greater_side_offset_frays_the_rays(commander: CommanderPage) -> None:
    commander.add_robot("F1", place=(-8, 0, 0))

    def spread() -> float:
        """Return the mean deviation of the beams in scans one after the other, m."""
        scans = []
        for _ in range(8):
            scans.append(commander.ranges("F1", "lms200"))
            commander.page.wait_for_timeout(300)  # longer than from scan to scan
        return statistics.fmean(map(statistics.pstdev, zip(*scans, strict=True)))

    set_slider(commander, "Side offset", 0)
    smooth = spread()
    set_slider(commander, "Side offset", 100)
    assert spread() > smooth + 0.05
