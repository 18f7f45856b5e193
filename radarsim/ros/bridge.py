"""Connects the robots of a server with a side of ROS, until the end."""

import asyncio
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from typing import Final, Protocol

from radarsim.client import AsyncClient, ClientTimeout
from radarsim.errors import ClientError
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import CommandError
from radarsim.recording.robot_topics import TopicMessage, topic_name
from radarsim.ros.driver import Driver
from radarsim.ros.live_topics import DriveCallback, LiveTopics
from radarsim.ros.map_topic import publish_map

SPAWN_TIMEOUT: Final = 120.0  # s; the server may have to compile
SILENCE: Final = 60.0  # s that one call waits for reports


class RosSide(Protocol):
    """Where topics go, and commands come from."""

    def publish(self, message: TopicMessage) -> None:
        """Publish a message; never waits."""

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """Pass the velocity commands on a topic to a function."""

    async def run(self) -> None:
        """Work until it is cancelled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeSettings:
    """What a bridge does.

    Attributes:
        server: Host and port of the server.
        robot_class: Class of the robot to spawn; None for none, which only watches.
        robot_name: Its name.
        start: Name of its start pose; None lets the server choose.
        echoes: Whether scanners list their echoes.
        mapped: Name of the robot to publish a map of; None for no map.
        drive_unit: Unit in which the server takes wheel speeds.
    """

    server: tuple[str, int]
    robot_class: str | None = None
    robot_name: str = "R1"
    start: str | None = None
    echoes: bool = False
    mapped: str | None = None
    drive_unit: DriveUnit = "rad_per_s"


async def run_bridge(settings: BridgeSettings, side: RosSide) -> None:
    """Bridge until the connection to the server is lost.

    Raises:
        ClientError: When it is lost, or the robot cannot be spawned.
    """
    async with AsyncExitStack() as stack:
        watcher = await AsyncClient.connect(*settings.server)
        await stack.enter_async_context(watcher)
        await watcher.greeting()
        await watcher.watch(echoes=settings.echoes)
        driving = []
        if settings.robot_class is not None:
            client = await AsyncClient.connect(*settings.server)
            await stack.enter_async_context(client)
            driver = await _spawn(client, settings)
            side.subscribe(f"/{topic_name(driver.name)}/cmd_vel", driver.take)
            driving.append(driver.run())
        topics = LiveTopics(side.publish, settings.drive_unit)
        working = [side.run(), _watch(watcher, topics), *driving]
        if settings.mapped is not None:
            where = settings.server, settings.mapped
            working.append(publish_map(*where, side.publish, echoes=settings.echoes))
        tasks = [asyncio.ensure_future(each) for each in working]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
        for task in done:
            task.result()


async def _spawn(client: AsyncClient, settings: BridgeSettings) -> Driver:
    await client.greeting()
    assert settings.robot_class is not None
    await client.spawn(
        settings.robot_class,
        name=settings.robot_name,
        start=settings.start,
        timeout=SPAWN_TIMEOUT,
    )
    info = await client.robot_info(drive_unit=settings.drive_unit)
    return Driver(client, info, settings.robot_name)


async def _watch(client: AsyncClient, topics: LiveTopics) -> None:
    while True:
        with suppress(ClientTimeout):
            reports = await client.read(SILENCE)
            for report in reports:
                if isinstance(report, CommandError):
                    raise ClientError(f"the server says: {report.text}")
            asked = topics.take(reports)
            if asked:
                await client.send(asked)
