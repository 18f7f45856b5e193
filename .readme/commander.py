"""Take pictures of the web page: python .readme/commander.py FOLDER.

Needs radarsim, playwright and a Chromium on the PATH. The README shows the first one.
"""

import itertools
import re
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

COMMAND = "radarsim serve foliage_room --port 0 --web 0"
OPTIONS = ("--no-sandbox", "--enable-unsafe-swiftshader")
WIDE = {"width": 1360, "height": 850}
NARROW = {"width": 390, "height": 844}
PLACE = {"x": "-3.7", "y": "0", "yaw": "0"}  # near enough for the laser
AHEAD = range(172, 190)  # beams of a full circle that meet the hedge
BEHIND = 8.0  # m, beyond the hedge


def add_robot(page: Page) -> None:
    """Add a robot that has a radar and a laser, and select a beam of the radar."""
    page.locator("#spawn [name=where]").select_option("at a pose")
    for key, value in PLACE.items():
        page.locator(f"#spawn [name={key}]").fill(value)
    page.locator("#spawn button.main").click()
    page.locator("#driven", has_text="R1").wait_for()


def open_page(browser: Browser, url: str, **options: object) -> Page:
    """Open the page in a profile of its own, and select a beam if there is a robot."""
    page = browser.new_context(**{"viewport": WIDE, **options}).new_page()
    page.goto(url)
    page.locator("#link[data-state=connected]").wait_for()
    page.wait_for_timeout(1000)
    return page


def select_beam(page: Page) -> None:
    """Select a beam that has passed the hedge, and hold its scan."""
    hold = page.locator("#beam [name=hold]")
    reading = page.locator("#reading")
    for beam in itertools.cycle(AHEAD):
        page.locator("#beam [name=beam]").fill(str(beam))
        page.locator("#reading", has_text=f"Beam {beam}").wait_for()
        hold.check()
        found = re.search(r"reads ([\d.]+) m", reading.text_content() or "")
        if found and float(found[1]) > BEHIND:
            break
        hold.uncheck()
    page.evaluate("document.activeElement.blur()")


def take_pictures(browser: Browser, url: str, folder: Path) -> None:
    """Take a picture of each view."""
    page = open_page(browser, url)
    add_robot(page)
    select_beam(page)
    page.wait_for_timeout(500)
    page.screenshot(path=folder / "commander.png")
    page.click("[data-view=space]")
    page.wait_for_timeout(4000)
    page.screenshot(path=folder / "commander_3d.png")
    dark = open_page(browser, url, color_scheme="dark")
    select_beam(dark)
    dark.wait_for_timeout(500)
    dark.screenshot(path=folder / "commander_dark.png")
    narrow = open_page(browser, url, viewport=NARROW, is_mobile=True, has_touch=True)
    narrow.screenshot(path=folder / "commander_narrow.png")
    dark.context.close()
    narrow.context.close()
    take_map(page, folder)


def take_map(page: Page, folder: Path) -> None:
    """Let another robot explore for a while, and take a picture of its map."""
    page.click("#remove")
    page.locator("#no-robots").wait_for()
    page.locator("#spawn [name=class]").select_option("P3AT_Radar360")
    add_robot(page)
    page.click("[data-view=map]")
    page.locator("#explore button.main").click()
    page.wait_for_timeout(40_000)
    page.screenshot(path=folder / "commander_map.png")


def main() -> None:
    """Serve a map, and take the pictures."""
    folder = Path(sys.argv[1])
    words = (sys.executable, "-m", *COMMAND.split())
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server,
        sync_playwright() as playwright,
    ):
        assert server.stdout is not None
        lines = (re.search(r"commander on (\S+)", line) for line in server.stdout)
        url = next(filter(None, lines))[1]
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(OPTIONS)
        )
        try:
            take_pictures(browser, url, folder)
        finally:
            browser.close()
            server.terminate()


if __name__ == "__main__":
    main()
