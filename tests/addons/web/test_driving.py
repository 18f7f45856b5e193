"""Robots that the commander spawns: seen, driven, stopped and removed."""

import asyncio
from contextlib import suppress
from typing import Any

import pytest
from web_pages import Frame, Page, open_page

from radarsim.protocol.reports import Report, decode_report


def stands(robot: str) -> Any:
    return lambda frame: frame.robot(robot).get("speeds") == [0.0, 0.0]


async def test_robot_is_seen_with_its_scans_and_echoes(page: Page) -> None:
    name = await page.spawn()
    await page.send("select", robot=name)

    def has_echoes(frame: Frame) -> bool:
        echoes = frame.robot(name).get("echoes") or [{"objects": []}]
        return bool(echoes[0]["objects"])

    frame = await page.see(has_echoes)
    robot = frame.robot(name)
    assert robot["mine"]
    assert robot["driver"] is None
    assert (robot["x"], robot["y"]) == pytest.approx((-8.0, 0.0), abs=0.01)
    (scan,) = robot["scans"]
    assert (scan["kind"], scan["count"]) == ("radar", 181)
    assert scan["z"] == pytest.approx(0.346, abs=0.01)
    assert scan["settings"]["side_offset_uu"] == 25
    ranges = frame.scan(name, "lms200")
    assert ranges.min() > 10
    objects = {each["name"]: each for each in robot["echoes"][0]["objects"]}
    beam, reading, kind, *_ = objects["south_wall"]["echoes"][0]
    assert (beam, kind) == (0, "hit")
    assert reading == pytest.approx(ranges[0] / 100, abs=0.02)


async def test_robot_drives_and_stops_when_nothing_more_is_heard(page: Page) -> None:
    name = await page.spawn()
    await page.send("drive", robot=name, v=0.5, w=0)
    reported = await page.hear("viewer", robot=name)
    assert reported["driver"] == "viewer 1"
    await page.see(lambda frame: frame.robot(name).get("x", -8) > -7.95)
    await page.hear("viewer", robot=name, driver=None)  # nobody drives any more
    frame = await page.see(stands(name))
    assert frame.robot(name)["x"] < -7.0  # .4 m/s for .4 s, and time to stop


async def test_robot_stops_when_its_driver_is_gone(commander: Any, page: Page) -> None:
    async with open_page(commander) as driver:
        name = await driver.spawn()
        await driver.send("drive", robot=name, v=1, w=0)
        await page.hear("viewer", driver="viewer 2")
    await page.hear("viewer", driver=None)
    await page.see(stands(name))


async def test_sensors_of_a_robot_are_read_once(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds: set[str] = set()

    def decode(line: str, *, reads_copies: bool) -> Report | None:
        kinds.add(line.split(maxsplit=1)[0])
        return decode_report(line, reads_copies=reads_copies)

    await page.send("spawn", **{"class": "P3AT", "name": "R1"})
    frame = await page.see(lambda frame: frame.robot("R1").get("scans"))
    await page.see(lambda frame: frame.robot("R1")["mine"])
    monkeypatch.setattr("radarsim.client.session.decode_report", decode)
    end = frame.header["t"] + 1.0
    await page.see(lambda frame: frame.header["t"] > end)
    assert kinds == {"SEE", "STA"}


async def test_only_one_browser_drives_a_robot(commander: Any) -> None:
    async with open_page(commander) as one, open_page(commander) as other:
        name = await one.spawn()

        async def insist(page: Page) -> str:
            """Drive again and again until that is refused, and return why."""
            while True:
                await page.send("drive", robot=name, v=0, w=0.1)
                await page.see(lambda _: True)
                with suppress(TimeoutError):
                    async with asyncio.timeout(0.1):
                        text: str = (await page.hear("error"))["text"]
                        return text

        tasks = {asyncio.create_task(insist(page)) for page in (one, other)}
        done, waiting = await asyncio.wait(
            tasks, return_when=asyncio.FIRST_COMPLETED, timeout=240
        )
        for task in waiting:
            task.cancel()
        assert "drives" in done.pop().result()


async def test_anybody_may_stop_everything(commander: Any) -> None:
    async with open_page(commander) as page, open_page(commander) as driver:
        name = await driver.spawn()
        await driver.send("drive", robot=name, v=0, w=1)
        await page.hear("viewer", robot=name, driver="viewer 2")
        await page.send("stop")
        await page.hear("viewer", robot=name, driver=None)


async def test_robots_get_names_and_starts_of_their_own(page: Page) -> None:
    assert await page.spawn() == "R1"
    assert await page.spawn(name="<b>") == "<b>"
    frame = await page.see(lambda frame: frame.robot("<b>"))
    first, second = frame.robot("R1"), frame.robot("<b>")
    assert abs(first["x"] - second["x"]) + abs(first["y"] - second["y"]) > 1
    await page.send("spawn", **{"class": "P3AT", "name": "r1"})
    assert "'r1'" in (await page.hear("error"))["text"]


async def test_robot_is_spawned_where_one_clicks_and_removed(page: Page) -> None:
    name = await page.spawn(pose=[-6.0, 1.0, 1.5])
    frame = await page.see(lambda frame: frame.robot(name))
    robot = frame.robot(name)
    assert (robot["x"], robot["y"], robot["yaw"]) == pytest.approx(
        (-6.0, 1.0, 1.5), abs=0.01
    )
    await page.send("remove", robot=name)
    await page.see(lambda frame: not frame.robot(name))


async def test_browser_learns_why_a_robot_does_not_come(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.addons.web.robots.LONG_WAIT", 0.1)
    monkeypatch.setattr("radarsim.addons.web.robots.SPAWN_TIMEOUT", 1.0)
    await page.send("spawn", **{"class": "Tank", "name": "T1"})
    notice = await page.hear("notice")
    assert "T1" in notice["text"]
    error = await page.hear("error")
    assert "'Tank' within 1 s" in error["text"]
