"""Pause, step and speed from the page, for all browsers; recordings are played."""

import asyncio
import math
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest
import recorded_runs
from served_page import Served, run_commander, serve
from web_pages import Page, open_page

from radarsim.addons.web.own_robot import TaskClock
from radarsim.client import AsyncClient
from radarsim.scene.scene import Scene


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with serve("foliage_room") as served:
        yield served


@pytest.fixture(scope="module")
def recording(foliage_room: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 3 s, in which the first robot gets going after 0.3 s."""
    folder = tmp_path_factory.mktemp("recording") / "run"
    run = recorded_runs.run_two_clients(foliage_room, ticks=300)
    recorded_runs.write_run(run, folder)
    return folder


@pytest.fixture
async def player(recording: Path) -> AsyncIterator[Page]:
    """Open the page of a commander that plays the recording."""
    with run_commander(recording, map_="foliage_room") as commander:
        async with open_page(commander) as page:
            yield page


async def newest_time(page: Page) -> float:
    """Return the time of the newest frame, after those that were on their way."""
    assert page.frame is not None
    for _ in range(2):
        await asyncio.sleep(0.1)
        await page.send("stop", robot="none")
        await page.hear("error")
    time: float = page.frame.header["t"]
    return time


async def test_time_is_paused_stepped_and_resumed_for_all_browsers(
    served: Served,
) -> None:
    async with (
        open_page(served) as page,
        open_page(served) as other,
        await AsyncClient.connect(*served.server) as client,
    ):
        assert (await page.hear("time"))["refusal"] == ""
        await client.spawn("P3AT", name="T1")
        await page.see(lambda frame: frame.robot("T1"))
        await page.send("pace", paused=True)
        await other.hear("time", paused=True)
        await page.hear("time", paused=True)
        stands = await newest_time(page)
        assert await newest_time(page) == stands
        # The protocol is answered as at any time.
        assert (await client.robot_info()).name == "P3AT"
        await page.send("pace", step=0.5)
        await page.see(lambda frame: frame.header["t"] >= round(stands + 0.4, 2))
        assert await newest_time(page) <= stands + 0.5 + 1e-6
        await other.send("pace", paused=False)
        await page.hear("time", paused=False)
        await page.see(lambda frame: frame.header["t"] > stands + 1)


@pytest.mark.parametrize("keys", [{"speed": 0}, {"speed": 1e9}, {"step": -1}])
async def test_what_makes_no_sense_is_refused(
    served: Served, keys: dict[str, Any]
) -> None:
    async with open_page(served) as page:
        await page.send("pace", **keys)
        (key,) = keys
        assert key in (await page.hear("error"))["text"]


async def test_a_foreign_server_cannot_be_paused_and_the_page_says_why(
    page: Page,
) -> None:
    time = await page.hear("time")
    assert "did not start the server" in time["refusal"]
    assert (time["paused"], time["speed"], time["end"]) == (False, 1.0, None)
    await page.send("pace", paused=True)
    assert "cannot be changed" in (await page.hear("error"))["text"]
    await page.send("seek", t=1)
    assert "only a recording" in (await page.hear("error"))["text"]


def test_tasks_wait_by_simulated_time() -> None:
    clock = TaskClock()
    clock.set_rate(0.0)
    stands = clock.time()
    assert clock.time() == stands
    clock.set_rate(1e6)
    assert clock.time() > stands


async def test_a_recording_is_played_paused_stepped_and_sought(player: Page) -> None:
    assert player.hello["played"]
    time = await player.hear("time")
    assert time["paused"]
    assert (time["start"], time["end"]) == (0, 3.01)
    shown = await player.see(lambda frame: frame.robot("R 1").get("scans"))
    assert shown.header["t"] == pytest.approx(0.2)
    assert {s["kind"] for s in shown.robot("R 1")["scans"]} == {"radar", "laser"}
    start = shown.robot("R 1")["x"]
    await player.send("pace", step=0.5)
    shown = await player.see(lambda frame: frame.header["t"] > 0.6)
    assert shown.header["t"] == pytest.approx(0.7)
    assert shown.robot("R 1")["x"] > start
    await player.send("pace", paused=False, speed=2)
    await player.see(lambda frame: frame.header["t"] == 3.01)
    end = await player.hear("time", paused=True, speed=2, t=3.01)
    assert end["t"] == end["end"]
    await player.send("seek", t=0.2)
    shown = await player.see(lambda frame: frame.header["t"] == 0.2)
    assert shown.robot("R 1")["x"] == start
    assert not shown.robot("R_1")  # it joined later


async def test_the_echoes_of_a_recording_are_shown(player: Page) -> None:
    await player.send("select", robot="R 1")
    await player.send("seek", t=1.5)
    shown = await player.see(lambda frame: frame.header["t"] == 1.5)
    echoes = {e["scanner"]: e["objects"] for e in shown.robot("R 1")["echoes"]}
    assert echoes["lms200"]


async def test_in_a_recording_nothing_is_driven_added_or_recorded(player: Page) -> None:
    await player.see(lambda frame: frame.robot("R 1"))
    for op, keys in (
        ("spawn", {"class": "P3AT"}),
        ("drive", {"robot": "R 1", "v": 1, "w": 0}),
        ("record", {"on": True}),
        ("seek", {"t": 1e6}),
        ("seek", {"t": None}),
    ):
        await player.send(op, **keys)
        assert (await player.hear("error"))["text"]


async def test_many_seeks_show_the_last_one(player: Page) -> None:
    for step in range(15):
        await player.send("seek", t=0.05 * step + 0.5)
    shown = await player.see(lambda frame: frame.header["t"] == 0.05 * 14 + 0.5)
    assert math.isfinite(shown.robot("R 1")["x"])
