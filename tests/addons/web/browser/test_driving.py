"""Driving by the page, by what truly happens to the robot."""

from collections.abc import Callable

import pytest
from commander_page import CommanderPage
from playwright.sync_api import Page
from served_page import Served
from truth import Truth

LONGEST = 2.0  # s of the simulation in which a robot stops, on a busy machine
HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", {value: hidden, configurable: true});
  document.dispatchEvent(new Event("visibilitychange"));
}"""


def drive(commander: CommanderPage, truth: Truth, name: str, key: str = "w") -> None:
    """Hold a key until the robot is on its way."""
    start = truth.last(name)
    commander.page.focus("#plan")
    commander.page.keyboard.down(key)
    commander.until(lambda: truth.last(name).distance(start) > 0.2, "for a start")


def check_rest(commander: CommanderPage, truth: Truth, name: str) -> None:
    """Wait until a robot stands, and check how soon after the last event that is."""
    since = truth.last(name)

    def rests() -> bool:
        return truth.seconds_to_rest(name, since) is not None

    commander.until(rests, f"for {name} to rest")
    seconds = truth.seconds_to_rest(name, since)
    assert seconds is not None
    assert seconds < LONGEST


def test_a_held_key_moves_the_robot_as_far_as_the_page_says(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.add_robot("W1", place=(-8, 0, 0))
    start = truth.last("W1")
    commander.page.focus("#plan")
    commander.page.keyboard.down("w")
    commander.page.wait_for_timeout(1000)
    commander.page.keyboard.up("w")
    check_rest(commander, truth, "W1")
    end = truth.last("W1")
    assert end.x - start.x > 0.2
    assert end.y == pytest.approx(0, abs=0.01)
    commander.until(lambda: abs(commander.robot("W1")["x"] - end.x) < 0.01)
    assert f"x {end.x:.2f} m" in commander.text("driving")


def test_a_and_d_turn_to_the_left_and_to_the_right(commander: CommanderPage) -> None:
    commander.add_robot("T1", place=(-8, 0, 0))
    commander.page.focus("#plan")
    for key, sign in (("a", 1), ("d", -1)):
        before = commander.robot("T1")["yaw"]
        commander.page.keyboard.down(key)
        commander.until(
            lambda before=before, sign=sign: (  # type: ignore[misc]
                sign * (commander.robot("T1")["yaw"] - before) > 0.1
            ),
            f"for a turn by {key}",
        )
        commander.page.keyboard.up(key)


WAYS: dict[str, Callable[[Page], None]] = {
    "key-up": lambda page: page.keyboard.up("w"),
    "blur": lambda page: page.evaluate("window.dispatchEvent(new Event('blur'))"),
    "hidden": lambda page: page.evaluate(HIDE, True),
    "space": lambda page: page.keyboard.press("Space"),
    "button": lambda page: page.click("#stop"),  # while the key is still held
}


def test_a_robot_stops_when_its_driver_lets_go(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.add_robot("S1", place=(-8, 0, 0))
    page = commander.page
    for let_go in WAYS.values():
        drive(commander, truth, "S1")
        let_go(page)
        if let_go is not WAYS["key-up"]:
            page.keyboard.down("w")  # as keys that are held repeat themselves
        check_rest(commander, truth, "S1")
        page.keyboard.up("w")
        page.evaluate(HIDE, False)


GAMEPAD = """() => {
  window.pad = {connected: true, axes: [0, 0, 0, 0], buttons: []};
  navigator.getGamepads = () => [null, window.pad];
}"""


def test_a_gamepad_drives_and_its_rest_stops_the_robot(
    commander: CommanderPage, truth: Truth
) -> None:
    commander.page.evaluate(GAMEPAD)
    commander.add_robot("GP", place=(-8, 0, 0))
    start = truth.last("GP")
    commander.page.evaluate("pad.axes[1] = -0.8")  # forward
    commander.until(lambda: truth.last("GP").x > start.x + 0.2, "for a start")
    commander.page.evaluate("pad.axes[1] = 0.1")  # as sticks rest
    check_rest(commander, truth, "GP")
    yaw = commander.robot("GP")["yaw"]
    commander.page.evaluate("pad.axes[0] = -1")  # to the left
    commander.until(lambda: commander.robot("GP")["yaw"] > yaw + 0.1)
    commander.page.evaluate("pad.connected = false")  # it is pulled out
    check_rest(commander, truth, "GP")


def test_others_see_who_drives_and_the_driver_that_its_robot_is_gone(
    commander: CommanderPage,
    served: Served,
    truth: Truth,
    open_page: Callable[..., CommanderPage],
) -> None:
    commander.add_robot("G1", place=(-8, 0, 0))
    other = open_page(served)
    other.until(lambda: other.text("driven") == "G1", "for the robot")
    drive(commander, truth, "G1")
    assert "you drive" in commander.text("robots")
    other.until(lambda: "drives" in other.text("robots"), "for the driver")
    other.page.click("#remove")
    commander.until(lambda: "G1" in commander.text("error"), "for the news")
    commander.page.keyboard.up("w")
    commander.until(lambda: not commander.robot("G1"), "for its end")


def test_the_touch_stick_drives(
    served: Served, truth: Truth, open_page: Callable[..., CommanderPage]
) -> None:
    commander = open_page(
        served, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True
    )
    commander.add_robot("P1", place=(-8, 0, 0))
    start = truth.last("P1")
    stick = commander.page.locator("#stick")
    stick.scroll_into_view_if_needed()
    box = stick.bounding_box()
    assert box is not None
    across = box["x"] + box["width"] / 2
    commander.page.mouse.move(across, box["y"] + box["height"] / 2)
    commander.page.mouse.down()
    commander.page.mouse.move(across, box["y"] + 4)
    commander.until(lambda: truth.last("P1").x > start.x + 0.2, "for a start")
    commander.page.mouse.up()
    check_rest(commander, truth, "P1")
    commander.remove_robots()
