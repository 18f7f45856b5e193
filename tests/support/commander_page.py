"""The commander's page in a browser, as a user has it before him."""

import json
import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

if TYPE_CHECKING:  # tests that need it are skipped where it is missing
    from playwright.sync_api import Page, WebSocket

PATIENCE = 240.0  # s
STEP = 40.0  # ms between two looks


class CommanderPage:
    """A page of the commander, with what it asked for and what it was sent."""

    def __init__(self, page: "Page") -> None:
        self.page = page
        self.frames: list[dict[str, Any]] = []
        self.hosts: set[str | None] = set()
        self.problems: list[str] = []
        self.bounds = (-5.0, -5.0, 5.0, 5.0)  # west, south, east, north, m
        self.map: dict[str, Any] | None = None
        self.paths: dict[str, dict[str, Any]] = {}
        page.on("request", lambda request: self._note_host(request.url))
        page.on("websocket", self._follow)
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.on("dialog", self._refuse)
        page.on("console", self._note_console)

    def open(self, url: str) -> None:
        """Open the page, and wait for the scene's name."""
        self.page.goto(url)
        self.until(lambda: self.text("link") == "connected")

    def until(self, holds: Callable[[], bool], what: str = "") -> None:
        """Wait until something holds."""
        for _ in range(int(PATIENCE * 1000 / STEP)):
            if holds():
                return
            self.page.wait_for_timeout(STEP)
        raise AssertionError(f"waited in vain {what}; error: {self.text('error')!r}")

    def text(self, name: str) -> str:
        """Return the text of an element by its id."""
        return self.page.locator(f"#{name}").text_content() or ""

    def robot(self, name: str) -> dict[str, Any]:
        """Return the newest frame's entry of a robot, nothing if it is not there."""
        robots = self.frames[-1]["robots"] if self.frames else []
        return next((robot for robot in robots if robot["name"] == name), {})

    def add_robot(
        self,
        name: str,
        *,
        kind: str = "P3AT_Compare",
        echoes: bool = True,
        place: tuple[float, float, float] | None = None,
    ) -> None:
        """Add a robot by the form, and wait until it is shown."""
        form = self.page.locator("#spawn")
        self.page.evaluate("document.getElementById('add').open = true")
        form.locator("[name=class]").select_option(kind)
        form.locator("[name=name]").fill(name)
        if place is not None:
            form.locator("[name=where]").select_option("at a pose")
            for key, value in zip(("x", "y", "yaw"), place, strict=True):
                form.locator(f"[name={key}]").fill(str(value))
        form.locator("button.main").click()
        self.until(lambda: self._is_shown(name, echoes), f"for robot {name}")

    def remove_robots(self) -> None:
        """Remove all robots of the commander."""
        for _ in range(100):
            mine = [r["name"] for r in self.frames[-1]["robots"] if r["mine"]]
            if not mine:
                return
            row = self.page.locator("#robots button").filter(has_text=mine[0]).first
            if not row.count():  # another page has removed it just now
                self.page.wait_for_timeout(100)
                continue
            row.click()
            self.page.locator("#remove").click()
            gone = mine[0]
            self.until(lambda gone=gone: not self.robot(gone), "for its end")  # type: ignore[misc]

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the map is in the plan, px from its corner.

        The corners of the scene are where the page fits them; it must not be zoomed.
        """
        canvas = self.page.locator("#plan").bounding_box()
        covered = [
            self.page.locator(f"#{name}").bounding_box()
            for name in ("finding", "zoom", "legend")
        ]
        assert canvas is not None
        finding, zoom, bottom = (0 if box is None else box["height"] for box in covered)
        top = max(finding, zoom)
        x0, y0, x1, y1 = self.bounds
        across = (canvas["width"] - 28) / (x1 - x0)
        scale = min(across, (canvas["height"] - top - bottom - 28) / (y1 - y0))
        middle = (y0 + y1) / 2 + (top - bottom) / 2 / scale
        left = canvas["width"] / 2 + (x - (x0 + x1) / 2) * scale
        return left, canvas["height"] / 2 - (y - middle) * scale

    def _is_shown(self, name: str, echoes: bool) -> bool:
        robot = self.robot(name)
        return (
            bool(robot.get("scans"))
            and (bool(robot["echoes"]) or not echoes)
            and self.text("driven") == name
        )

    def _note_host(self, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("data", "blob"):
            self.hosts.add(parts.hostname)

    def _note_console(self, message: Any) -> None:
        if message.type == "error" or "Security Policy" in message.text:
            self.problems.append(message.text)

    def _refuse(self, dialog: Any) -> None:
        self.problems.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def _follow(self, socket: "WebSocket") -> None:
        self._note_host(socket.url)
        socket.on("framereceived", self._take)

    def _take(self, payload: str | bytes) -> None:
        if isinstance(payload, str):
            message = json.loads(payload)
            if message["op"] == "scene":
                self.bounds = message["bounds"]
            elif message["op"] == "map":
                self.map = message
            elif message["op"] == "path":
                self.paths[message["robot"]] = message
            return
        (length,) = struct.unpack_from("<I", payload)
        frame = json.loads(payload[4 : 4 + length])
        self.frames = [*self.frames[-20:], frame]
