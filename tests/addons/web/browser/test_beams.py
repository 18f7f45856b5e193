"""Beams in the page: selected by keys and clicks, and listed with all they meet."""

from commander_page import CommanderPage

TABLE = "#rows tbody td"


def select_beam(commander: CommanderPage, number: int) -> list[list[str]]:
    """Select a beam by its number, and return the table of what it meets."""
    commander.page.locator("#beam [name=beam]").fill(str(number))
    commander.until(lambda: f"Beam {number} " in commander.text("reading"))
    commander.page.locator("#beam [name=hold]").check()
    cells = commander.page.locator(TABLE).all_text_contents()
    commander.page.locator("#beam [name=hold]").uncheck()
    return [cells[row : row + 4] for row in range(0, len(cells), 4)]


def test_arrow_keys_step_the_beam(commander: CommanderPage) -> None:
    commander.add_robot("A1", place=(-8, 0, 0))
    select_beam(commander, 90)
    commander.page.focus("#plan")
    commander.page.keyboard.press("ArrowLeft")
    commander.until(lambda: "Beam 91 " in commander.text("reading"))
    commander.page.keyboard.press("ArrowRight")
    commander.page.keyboard.press("ArrowRight")
    commander.until(lambda: "Beam 89 " in commander.text("reading"))


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
