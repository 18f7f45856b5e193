"""Beams in the page: selected by keys and clicks, and listed with all they meet."""

from commander_page import CommanderPage


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
