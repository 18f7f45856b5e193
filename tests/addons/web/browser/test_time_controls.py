"""Time in the page: pause, step and speed, and the timeline of a recording."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from commander_page import CommanderPage
from served_page import run_commander, serve


def time_of(page: CommanderPage) -> float:
    found = re.match(r"[\d.]+", page.text("time"))
    assert found
    return float(found[0])


def pause(page: CommanderPage) -> float:
    """Pause, and return the time at which it stands."""
    page.page.click("#pause")
    page.until(lambda: "paused" in page.text("time"), "for a pause")
    page.page.wait_for_timeout(500)  # frames that were on their way
    return time_of(page)


def go_on(page: CommanderPage) -> None:
    page.page.click("#pause")
    page.until(lambda: "paused" not in page.text("time"), "for the run to go on")


def test_a_run_is_paused_stepped_and_goes_on(commander: CommanderPage) -> None:
    commander.add_robot("R1")
    stands = pause(commander)
    commander.page.wait_for_timeout(500)
    assert time_of(commander) == stands
    commander.page.click("#step")
    commander.until(lambda: time_of(commander) > stands, "for a step")
    commander.page.wait_for_timeout(300)
    assert time_of(commander) == pytest.approx(stands + 0.1, abs=0.051)
    go_on(commander)
    # The same by keys, and at another speed.
    commander.page.select_option("#speed", "2")
    commander.page.focus("#plan")
    commander.page.keyboard.press("p")
    commander.until(lambda: "paused" in commander.text("time"), "for a pause")
    commander.page.wait_for_timeout(300)
    stands = time_of(commander)
    commander.page.keyboard.press(".")
    commander.until(lambda: time_of(commander) > stands, "for a step")
    commander.page.keyboard.press("p")
    commander.until(lambda: "paused" not in commander.text("time"), "for an end")
    commander.page.select_option("#speed", "1")


def record_a_drive(page: CommanderPage) -> Path:
    """Record a robot that drives, by the page, and return the folder."""
    page.add_robot("R1", place=(-8, 0, 0))
    page.page.click("#record")
    page.until(lambda: "Recording to" in page.text("notice"), "for the recording")
    # The robot stands at first, so that who plays the recording sees it at its start.
    begun = time_of(page)
    page.until(lambda: time_of(page) > begun + 1.0, "for a second of it")
    start = page.robot("R1")["x"]
    page.page.focus("#plan")
    page.page.keyboard.down("w")
    page.until(lambda: page.robot("R1")["x"] > start + 1.0, "for a drive")
    page.page.keyboard.up("w")
    page.page.click("#record")
    page.until(lambda: "Recorded in" in page.text("notice"), "for its end")
    return Path(page.text("notice").removeprefix("Recorded in "))


def x_of(page: CommanderPage) -> float:
    """Return where the robot is, m; NaN while it is not there."""
    return float(page.robot("R1").get("x", math.nan))


@pytest.mark.slow
def test_a_run_is_recorded_played_paused_stepped_and_sought(
    open_page: Callable[..., CommanderPage],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with serve("foliage_room") as served:
        live = open_page(served)
        folder = record_a_drive(live)
        live.page.context.close()
    with run_commander(folder) as played:
        page = open_page(played)
        page.until(lambda: bool(page.robot("R1")), "for the robot")
        assert page.text("level") == "DM-FoliageRoom"
        first = x_of(page)
        began = time_of(page)
        page.page.click("#step")
        page.until(lambda: time_of(page) > began, "for a step")
        assert time_of(page) == pytest.approx(began + 0.1, abs=0.011)
        go_on(page)
        page.until(lambda: x_of(page) > first + 0.5, "for the drive")
        stands = pause(page)
        page.page.wait_for_timeout(300)
        assert time_of(page) == stands
        end = float(page.page.get_attribute("#seek", "max") or 0)
        page.page.locator("#seek").fill(str(round(end, 2)))
        page.until(lambda: time_of(page) == round(end, 2), "for the end")
        page.until(lambda: x_of(page) > first + 0.9, "for the end of the drive")
        # Times are shown in tenths: the robot may have come a little after this one.
        page.page.locator("#seek").fill(str(round(began + 0.1, 2)))
        page.until(lambda: abs(x_of(page) - first) < 0.05, "for the start")
        assert "pass through" in page.text("finding")  # echoes are recorded
        page.page.context.close()
