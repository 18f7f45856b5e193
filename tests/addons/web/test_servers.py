"""Servers that are lost, have other clients, or are others than usual."""

from typing import Any

import pytest
from served_page import run_commander
from web_pages import Frame, Page, open_page

from radarsim.client import AsyncClient
from radarsim.geometry import Pose2
from radarsim.protocol.dialect import UDK
from radarsim.protocol.reports import Watching
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig

NAME = "<img src=x onerror=alert(1)>"


async def test_robots_of_other_clients_are_seen_but_not_driven(commander: Any) -> None:
    async with (
        open_page(commander) as page,
        await AsyncClient.connect(*commander.server) as other,
    ):
        await other.spawn("P3AT_Compare", name=NAME, pose=Pose2(-8.0, 0.0, 0.0))
        await page.send("select", robot=NAME)

        def has_echoes(frame: Frame) -> bool:
            echoes = frame.robot(NAME).get("echoes", [])
            return any(scan["objects"] for scan in echoes)

        robot = (await page.see(has_echoes)).robot(NAME)
        assert not robot["mine"]
        assert robot["class"] == "P3AT_Compare"
        assert {scan["kind"] for scan in robot["scans"]} == {"radar", "laser"}
        await page.send("drive", robot=NAME, v=1, w=0)
        assert "another client's" in (await page.hear("error"))["text"]
        await other.close()
        await page.see(lambda frame: not frame.robot(NAME))


async def test_lost_server_is_reported_and_found_again(empty_room: Scene) -> None:
    first = Server(Host(empty_room))
    await first.start(port=0)
    with run_commander(first.address) as commander:
        async with open_page(commander) as page:
            name = await page.spawn(pose=[0.0, 0.0, 0.0])
            await page.send("drive", robot=name, v=0.2, w=0)
            await page.hear("viewer", driver=page.hello["viewer"])
            await first.stop()
            assert name in (await page.hear("error"))["text"]  # its driver gets it
            await page.hear("lost")
            await page.see(lambda frame: not frame.header["robots"])
            second = Server(Host(empty_room))
            await second.start(port=first.address[1])
            try:
                await page.hear("found")
                assert await page.spawn(pose=[0.0, 0.0, 0.0]) == name
            finally:
                await second.stop()


async def test_commander_waits_for_its_server() -> None:
    with run_commander(("127.0.0.1", 1)) as commander:
        async with open_page(commander, waits=False) as page:
            assert "no server" in (await page.hear("lost"))["text"]
            await page.send("spawn", **{"class": "P3AT"})
            assert "no server" in (await page.hear("error"))["text"]
            await page.send("triangles")
            assert "--draw" in (await page.hear("error"))["text"]


async def test_commander_asks_again_when_there_were_too_many_watchers(
    empty_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.server.host.watchers.MAX_WATCHERS", 1)
    monkeypatch.setattr("radarsim.addons.web.server_link.ASK_AGAIN", 0.1)
    server = Server(Host(empty_room))
    await server.start(port=0)
    try:
        other = await AsyncClient.connect(*server.address)
        await other.watch()
        await other.wait_for(Watching)
        with run_commander(server.address) as commander:
            async with open_page(commander) as page:
                assert "watcher" in (await page.hear("notice"))["text"]
                name = await page.spawn(pose=[0.0, 0.0, 0.0])
                # Frames have the settings of the robot that is selected alone.
                await page.send("select", robot=name)
                frame = await page.see(lambda f: f.robot(name)["x"] == 0)
                assert not frame.robot(name)["scans"][0]["settings"]
                await other.close()
                await page.hear("hello", watch=True)
                await page.see(lambda f: f.robot(name)["scans"][0]["settings"])
    finally:
        await server.stop()


async def test_robot_that_is_called_all_or_none_is_a_robot_like_any(page: Page) -> None:
    for name in ("All", "None", "true"):
        await page.spawn(name=name)
        await page.send("select", robot=name)
        await page.see(
            lambda frame, name=name: any(
                scan["objects"] for scan in frame.robot(name).get("echoes", [])
            )
        )


async def test_original_dialect_is_understood(empty_room: Scene) -> None:
    config = SimulationConfig(UDK)
    server = Server(Host(empty_room, config=config))
    await server.start(port=0)
    try:
        with run_commander(server.address, config=config) as commander:
            async with open_page(commander) as page:
                assert page.hello["dialect"] == "udk"
                name = await page.spawn(pose=[0.0, 0.0, 0.0])
                await page.send("drive", robot=name, v=0.2, w=0)
                await page.hear("viewer", driver=None)
                frame = await page.see(lambda f: f.robot(name)["x"] > 0.03)
                (scan,) = frame.robot(name)["scans"]
                assert scan["max"] == 20.0
                assert frame.robot(name)["x"] < 0.25  # not 2 pi times as fast
    finally:
        await server.stop()
