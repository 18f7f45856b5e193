"""Requests of the commander to the server, by the pages that are visible."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from served_page import run_commander
from web_pages import Page, open_page

from radarsim.addons.recording.recorders import EventType, HostRecorder, RunEvent
from radarsim.client import AsyncClient
from radarsim.geometry import Pose2
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.tcp_server import Server

QUIET = 50  # ticks; scans of a robot come each 20


class Wire:
    """What a server does, call by call."""

    def __init__(self, scene: Scene) -> None:
        self.calls: list[RunEvent] = []
        self._news = asyncio.Event()
        self.host = Host(scene, observers=[HostRecorder(self._take)])

    def _take(self, event: RunEvent) -> None:
        if event.is_call:
            self.calls.append(event)
            self._news.set()

    def copies(self, since: int = 0) -> list[int]:
        """Return the ticks at which copies were sent, from a call on."""
        takes = (call for call in self.calls[since:] if call.type is EventType.TAKE)
        return [call.tick for call in takes if b"SEE {" in call.data]

    async def until_copied(self) -> None:
        """Wait until copies are sent."""
        since = len(self.calls)
        while not self.copies(since):
            self._news.clear()
            await self._news.wait()

    async def until_quiet(self) -> None:
        """Wait until no copies have been sent for long, though a robot is there."""
        while self.calls[-1].tick < max(self.copies(), default=0) + QUIET:
            self._news.clear()
            await self._news.wait()


@pytest.fixture
async def wire(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Wire, tuple[str, int]]]:
    """A server with a robot of another client, and what it sends."""
    monkeypatch.setattr("radarsim.addons.web.commander.LINGER", 0.1)
    wire = Wire(empty_room)
    server = Server(wire.host)
    await server.start(port=0)
    async with await AsyncClient.connect(*server.address) as other:
        await other.spawn("P3AT_Compare", name="Other", pose=Pose2(2.0, 0.0))
        yield wire, server.address
    await server.stop()


@asynccontextmanager
async def looking(commander: Any) -> AsyncIterator[Page]:
    """Open a page that sees the robot of the other client."""
    async with open_page(commander) as page:
        await page.see(lambda frame: frame.robot("Other").get("scans"))
        yield page


async def test_a_commander_that_nobody_looks_at_receives_nothing(
    wire: tuple[Wire, tuple[str, int]],
) -> None:
    seen, address = wire
    with run_commander(address):
        await seen.until_quiet()
        assert seen.copies() == []


async def test_it_receives_nothing_any_more_when_the_last_page_is_hidden_or_gone(
    wire: tuple[Wire, tuple[str, int]],
) -> None:
    seen, address = wire
    with run_commander(address) as commander:
        async with looking(commander) as page:
            async with looking(commander):
                await page.send("look", on=False)
                await seen.until_copied()  # another page is still there
            await seen.until_quiet()
            frames = page.frames
            await page.send("look", on=True)
            await page.see(lambda _: page.frames > frames)
            await page.see(lambda frame: frame.robot("Other").get("scans"))
        await seen.until_quiet()
        async with looking(commander):
            pass


async def test_robots_and_settings_are_known_again_when_somebody_looks(
    wire: tuple[Wire, tuple[str, int]],
) -> None:
    seen, address = wire
    with run_commander(address) as commander:
        async with looking(commander) as page:
            await page.spawn(name="Own")
            setting = {"scanner": "lms200", "key": "max_range", "value": 7}
            await page.send("setting", robot="Own", **setting)
            await page.see(lambda f: f.robot("Own")["scans"][0]["max"] == 7)
        await seen.until_quiet()
        async with looking(commander) as page:
            own = (await page.see(lambda frame: frame.robot("Own"))).robot("Own")
            assert own["mine"]
            await page.send("select", robot="Own")  # only its settings are sent
            frame = await page.see(lambda f: f.robot("Own")["scans"][0]["settings"])
            settings = frame.robot("Own")["scans"][0]["settings"]
            assert settings["max_range"] == 7


async def test_a_map_grows_on_while_nobody_looks(
    wire: tuple[Wire, tuple[str, int]],
) -> None:
    seen, address = wire
    with run_commander(address) as commander:
        async with looking(commander) as page:
            await page.send("map", robot="Other", on=True)
            await page.hear("map")
        await asyncio.sleep(0.5)  # longer than it lingers
        await seen.until_copied()
        async with looking(commander) as page:
            assert (await page.hear("map"))["png"]
