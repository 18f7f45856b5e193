"""A server with its page, and a Chromium to look at it."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from commander_page import CommanderPage
from served_page import CHROMIUM_OPTIONS, Served, serve
from truth import Truth

if TYPE_CHECKING:  # tests that need it are skipped where it is missing
    from playwright.sync_api import Browser

NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="session")
def chromium() -> str:
    """The path of a Chromium; without one, tests fail in CI and skip elsewhere."""
    path = next(filter(None, map(shutil.which, NAMES)), None)
    from playwright.sync_api import sync_playwright

    if path is None:
        with sync_playwright() as playwright:
            own = Path(playwright.chromium.executable_path)
        path = str(own) if own.exists() else None
    if path is None:
        text = f"no Chromium: neither {own} nor, on the PATH, {', '.join(NAMES)}"
        if os.environ.get("CI") == "true":
            pytest.fail(text)
        pytest.skip(text)
    return path


@pytest.fixture(scope="module")  # with its event loop, in which others cannot run
def browser(chromium: str) -> Iterator["Browser"]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=list(CHROMIUM_OPTIONS)
        )
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def served(chromium: str) -> Iterator[Served]:  # noqa: ARG001 - skips first
    """A server for all tests, which remove their robots."""
    with serve("foliage_room") as served:
        yield served


@pytest.fixture
def open_page(browser: "Browser") -> Iterator[Callable[..., CommanderPage]]:
    """Open pages, each with its own profile; they must not complain of anything."""
    opened: list[CommanderPage] = []

    def open_one(served: Any, **options: object) -> CommanderPage:
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
    watch = Truth(served.server)
    yield watch
    watch.close()
