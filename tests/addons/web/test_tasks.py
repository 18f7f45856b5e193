"""What robots of the commander do by themselves, and the maps that are made."""

import base64
import io
import math
from typing import Any

import pytest
from PIL import Image
from web_pages import Page, open_page

from radarsim.plotting.palette import FAMILY_COLOURS, Family

FAST = pytest.mark.parametrize("server", [5.0], indirect=True)
BEHIND = [5.7, -0.9]  # m; behind the bushes, more than 2 m from everything


# At the speed of the wall clock: on a busy machine, scans of a faster run come so late
# that the robot turns past the heading.
async def test_robot_reaches_a_goal_and_shows_its_path(commander: Any) -> None:
    async with open_page(commander) as page:
        name = await page.spawn("P3AT_Radar360", pose=[-8.0, 0.0, 0.0])
        goto = {"robot": name, "algorithm": "bug2", "goal": [-7.0, 0.0]}
        await page.send("goto", **goto, heading=math.pi / 2)
        running = await page.hear("task", state="running")
        assert (running["robot"], running["kind"]) == (name, "goto")
        assert running["text"] == "drive to -7.00, 0.00, facing 90\N{DEGREE SIGN}"
        ended = await page.hear("task", id=running["id"])
        assert ended["state"] == "done", ended["text"]
        assert ended["text"].startswith(running["text"])
        frame = await page.see(lambda frame: frame.robot(name)["driver"] is None)
        assert frame.robot(name)["x"] > -7.4
        await page.see(lambda frame: abs(frame.robot(name)["yaw"] - math.pi / 2) < 0.1)
    async with open_page(commander) as page:
        path = await page.hear("path", robot=name)  # a new browser gets it as well
        assert path["goal"] == [-7.0, 0.0]
        assert path["heading"] == pytest.approx(math.pi / 2)
        assert path["points"][0] == pytest.approx([-8.0, 0.0], abs=0.1)
        assert path["points"][-1][0] > -7.4


@FAST
async def test_who_drives_takes_over_from_a_task(page: Page) -> None:
    name = await page.spawn("P3AT_Radar360", pose=[-8.0, 0.0, 0.0])
    await page.send("goto", robot=name, algorithm="bug1", goal=BEHIND)
    task = await page.hear("task", state="running")
    await page.see(lambda frame: frame.robot(name)["driver"] == "task")
    await page.send("drive", robot=name, v=-0.1, w=0)
    assert (await page.hear("task"))["state"] == "cancelled"
    await page.send("goto", robot=name, algorithm="bug1", goal=BEHIND)
    await page.hear("task", state="running")
    await page.send("stop")
    again = await page.hear("task", state="cancelled")
    assert again["id"] > task["id"]
    await page.see(lambda frame: frame.robot(name)["speeds"] == [0.0, 0.0])


async def test_robot_that_does_not_see_all_around_says_that_it_cannot(
    page: Page,
) -> None:
    name = await page.spawn("P3AT", pose=[-8.0, 0.0, 0.0])
    assert page.frame is not None
    assert "180\N{DEGREE SIGN}" in page.frame.robot(name)["hindrance"]
    await page.send("goto", robot=name, algorithm="bug2", goal=[-7.0, 0.0])
    assert "180\N{DEGREE SIGN}" in (await page.hear("error"))["text"]
    await page.send("explore", robot=name, strategy="auto")
    assert "180\N{DEGREE SIGN}" in (await page.hear("error"))["text"]


async def test_robot_of_the_first_class_goes_explores_and_compares(page: Page) -> None:
    first = page.hello["classes"][0]["name"]
    name = await page.spawn(first, pose=[-8.0, 0.0, 0.0])
    assert page.frame is not None
    robot = page.frame.robot(name)
    assert robot["hindrance"] is None
    assert {scan["kind"] for scan in robot["scans"]} == {"radar", "laser"}
    await page.send("goto", robot=name, algorithm="bug9", goal=[-7.0, 0.0])
    assert "'bug9'" in (await page.hear("error"))["text"]
    await page.send("explore", robot=name, strategy="x")
    assert "'x'" in (await page.hear("error"))["text"]
    await page.send("goto", robot=name, algorithm="bug2", goal=[7.0, 0.5])
    assert "0.70 m from 'cabinet'" in (await page.hear("error"))["text"]


@FAST
async def test_exploring_shows_a_map_until_it_is_cancelled(page: Page) -> None:
    name = await page.spawn("P3AT_Radar360", pose=[-8.0, 0.0, 0.0])
    await page.send("explore", robot=name, strategy="frontiers")
    task = await page.hear("task", state="running", kind="explore")
    picture = await page.hear("map", robot=name)
    image = Image.open(io.BytesIO(base64.b64decode(picture["png"])))
    assert image.size == (picture["width"], picture["height"])
    await page.hear("path", robot=name)
    await page.send("cancel", task=task["id"])
    await page.hear("task", state="cancelled")


async def test_map_can_have_the_colours_of_materials(page: Page) -> None:
    name = await page.spawn("P3AT", pose=[-8.0, 0.0, 0.0])
    await page.send("map", robot=name, on=True, colours="material")
    reported = await page.hear("map")
    assert reported["colours"] == "material"
    assert [FAMILY_COLOURS[Family.FOLIAGE], "foliage"] in reported["legend"]
    await page.send("map", robot="x", on=True)
    assert "'x'" in (await page.hear("error"))["text"]
