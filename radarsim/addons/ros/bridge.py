"""Connects the robots of a server with a side of ROS, until the end.

A robot that follows velocity commands, and stops when none come any more.

The topic ``/map``: a map of one robot, made in a thread while it drives.
"""

import asyncio
import math
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from typing import Final, Protocol

from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.recording.robot_topics import (
    map_message,
    map_snapshot,
    topic_name,
)
from radarsim.addons.ros.live_topics import DriveCallback, LiveTopics
from radarsim.autonomy.proxy.traffic_mapper import TrafficMapper
from radarsim.client import AsyncClient, ClientTimeout, RobotInfo
from radarsim.errors import ClientError
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import CommandError

INTERVAL: Final = 1.0  # s between messages
RESOLUTION: Final = 0.05  # m, side of a cell


async def publish_map(
    server: tuple[str, int],
    robot: str,
    publish: Callable[[TopicMessage], None],
    *,
    echoes: bool,
) -> None:
    """Map a robot of radarsim with its first scanner, and begin anew if it leaves.

    Args:
        server: Host and port of the server.
        robot: Name of the robot; it may come later.
        publish: Called with each message, in the thread of this coroutine.
        echoes: Whether its scanners shall list their echoes.

    Raises:
        ClientError: If the connection is lost.
        ValueError: If the name cannot be sent.
    """
    loop = asyncio.get_running_loop()
    while True:
        # A robot that comes again can stand anywhere: it gets a new map.
        mapper = TrafficMapper(motion_source="ins", resolution=RESOLUTION)
        mapper.on_scan = _MapPublisher(
            mapper, lambda message: loop.call_soon_threadsafe(publish, message)
        )
        await mapper.follow(server, robot, echoes=echoes)


class _MapPublisher:
    """Publishes a growing map, at most once in ``INTERVAL`` of simulated time."""

    def __init__(
        self, traffic: TrafficMapper, publish: Callable[[TopicMessage], object]
    ) -> None:
        self._traffic, self._publish = traffic, publish
        self._due = -math.inf

    def __call__(self) -> None:
        mapper = self._traffic.mapper
        assert mapper is not None  # it has taken in a scan
        time = mapper.trajectory.times[-1]
        if time >= self._due:
            self._due = time + INTERVAL
            self._publish(map_message(map_snapshot(mapper.grid, time)))


DEAD_MAN: Final = 0.5  # s after the last command
CHECK_INTERVAL: Final = 0.05  # s


class Driver:
    """The robot of a bridge.

    Attributes:
        name: Name of the robot.
    """

    def __init__(self, client: AsyncClient, robot: RobotInfo, name: str) -> None:
        """Take over a robot.

        Args:
            client: The client of the robot.
            robot: Its properties.
            name: Its name.
        """
        self.name = name
        self._client = client
        self._robot = robot
        self._wanted: tuple[float, float] | None = None  # not sent yet
        self._moves = False
        self._last = -math.inf  # time of the last command

    def take(self, speed: float, turn: float) -> None:
        """Drive.

        Args:
            speed: Forward speed, m/s; 0 if it is not finite.
            turn: Counter-clockwise turn rate, rad/s; likewise.
        """
        speed, turn = (v if math.isfinite(v) else 0.0 for v in (speed, turn))
        self._wanted = speed, turn
        self._last = asyncio.get_running_loop().time()

    async def run(self) -> None:
        """Drive until the connection is lost.

        Raises:
            ClientError: When it is lost.
        """
        reading = asyncio.ensure_future(self._read())
        try:
            while not reading.done():
                await self._drive()
                await asyncio.wait({reading}, timeout=CHECK_INTERVAL)
            reading.result()
        finally:
            reading.cancel()

    async def _drive(self) -> None:
        # Who has lost the connection sends no stop: silence is one.
        late = asyncio.get_running_loop().time() - self._last > DEAD_MAN
        if self._moves and late:
            self._wanted = 0.0, 0.0
        if self._wanted is not None:
            speed, turn = self._wanted
            # Commands come faster than robots can use them: only the newest is sent.
            self._wanted, self._moves = None, (speed, turn) != (0.0, 0.0)
            await self._client.drive(*self._robot.wheel_speeds(speed, turn))

    async def _read(self) -> None:
        """Read what the robot senses, which its watcher publishes."""
        while True:
            with suppress(ClientTimeout):
                await self._client.read()


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
