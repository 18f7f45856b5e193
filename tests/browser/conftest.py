"""A server with its page, and a Chromium to look at it."""

import os
import re
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from commander_page import CommanderPage
from playwright.sync_api import Browser, sync_playwright
from processes import start_radarsim
from truth import Truth

NAMES = ("chromium", "chromium-browser", "google-chrome")
# Tests may run as root, where there is no sandbox; 3D is drawn without a graphics card.
OPTIONS = ("--no-sandbox", "--enable-unsafe-swiftshader")


@dataclass(frozen=True)
class Served:
    """A running server with its page.

    Attributes:
        process: The server.
        address: Host and port for robots.
        url: Address of the page, with its token.
    """

    process: subprocess.Popen[bytes]
    address: tuple[str, int]
    url: str


def serve(*words: str) -> Served:
    """Serve a map and its page on free ports."""
    process = start_radarsim("serve", *words, "--port", "0", "--web", "0")
    stdout, stderr = process.stdout, process.stderr
    assert stdout is not None
    assert stderr is not None
    threading.Thread(target=stderr.read, daemon=True).start()  # so that it never fills
    told = ""
    while "commander on" not in told or not told.endswith("\n"):
        line = stdout.readline().decode()
        assert line, f"the server has ended: {told}"
        told += line
    found = re.search(r"listening on ([\d.]+):(\d+)", told)
    url = re.search(r"commander on (\S+)", told)
    assert found
    assert url
    threading.Thread(target=stdout.read, daemon=True).start()
    return Served(process, (found[1], int(found[2])), url[1])


def end(served: Served) -> None:
    """End a server."""
    served.process.terminate()
    served.process.wait(240)


@pytest.fixture(scope="session")
def chromium() -> str:
    """The path of a Chromium; without one, tests fail in CI and skip elsewhere."""
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        text = f"no Chromium: none of {', '.join(NAMES)} is on the PATH"
        if os.environ.get("CI") == "true":
            pytest.fail(text)
        pytest.skip(text)
    return path


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=list(OPTIONS)
        )
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def served(chromium: str) -> Iterator[Served]:  # noqa: ARG001 - skips first
    served = serve("foliage_room")
    yield served
    end(served)


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Callable[..., CommanderPage]]:
    """Open pages, each with its own profile; they must not complain of anything."""
    opened: list[CommanderPage] = []

    def open_one(served: Served, **options: object) -> CommanderPage:
        size = {"width": 1280, "height": 800}
        context = browser.new_context(**{"viewport": size, **options})  # type: ignore[arg-type]
        context.set_default_timeout(240_000)
        opened.append(CommanderPage(context.new_page()))
        opened[-1].open(served.url)
        return opened[-1]

    yield open_one
    for one in opened:
        one.page.context.close()
    assert [problem for one in opened for problem in one.problems] == []


@pytest.fixture
def commander(
    served: Served, open_page: Callable[..., CommanderPage]
) -> Iterator[CommanderPage]:
    """The page of a server without robots."""
    page = open_page(served)
    page.until(lambda: bool(page.frames), "for a frame")
    yield page
    page.remove_robots()


@pytest.fixture
def truth(served: Served) -> Iterator[Truth]:
    watch = Truth(served.address)
    yield watch
    watch.close()
