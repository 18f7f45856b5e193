"""Connects the robots of a server with ROS, until the connection is lost.

A watcher of the server receives the lines of all robots, which ``LiveTopics`` converts
into topics. The bridge can spawn a robot that executes velocity commands, and stops
when no more commands arrive (``Driver``). It can map one robot in a thread
(``publish_map``). A ``RosSide`` publishes the topics and receives the commands.
"""

import asyncio
import io
import math
import struct
from collections.abc import Callable, Iterable
from contextlib import AsyncExitStack
from typing import Final, Protocol, TypeAlias

from PIL import Image

from radarsim import __version__
from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.call_converter import (
    TO_CLIENT,
    TO_SERVER,
    CallConverter,
)
from radarsim.addons.recording.messages import (
    CLOCK,
    TopicMessage,
    clock,
    occupancy_grid,
)
from radarsim.addons.recording.recorders import EventType, RunEvent, WatchRecorder
from radarsim.addons.recording.robot_topics import (
    below,
    sensed_map,
    topic_name,
)
from radarsim.addons.ros.cli import TopicOptions
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.watching import RobotWatcher, WatchMapper
from radarsim.client import AsyncClient, RobotInfo
from radarsim.client.robot_info import same_name
from radarsim.errors import ClientError, describe_os_error
from radarsim.listening import first_of, in_daemon_thread
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.images import ImageType
from radarsim.protocol.reports import ClockTick, CommandError, Report

# Topics of recordings that the bridge does not publish: the bytes of connections are
# needed only to repeat a run, and the converter's clock is replaced by the server's
# time of every tick.
UNPUBLISHED: Final = frozenset({TO_CLIENT, TO_SERVER, CLOCK})
TWIST: Final = "geometry_msgs/msg/Twist"  # type of ``cmd_vel``
MAP_INTERVAL: Final = 1.0  # s of simulated time between two maps
MAP_RESOLUTION: Final = 0.05  # m; side of a cell
DEAD_MAN: Final = 0.5  # s; the robot stops if no command arrives for this long
CHECK_INTERVAL: Final = 0.05  # s between two checks for a new command
SPAWN_TIMEOUT: Final = 120.0  # s; the server may be busy
LARGEST_PICTURE: Final = 2**26  # bytes
QUALITY: Final = 75  # percent; JPEG quality of pictures

# A function that is called with a forward speed, m/s, and a turn rate, rad/s.
DriveCallback: TypeAlias = Callable[[float, float], None]


class RosSide(Protocol):
    """Publishes topics to ROS programs, and receives their velocity commands."""

    def publish(self, message: TopicMessage) -> None:
        """Publish a message on its topic without waiting."""

    def subscribe(self, topic: str, take: DriveCallback) -> None:
        """Call a function with each velocity command that a topic receives."""

    async def run(self) -> None:
        """Serve ROS programs until cancelled."""


class LiveTopics:
    """Publishes all robots of a server as topics, named as in recordings."""

    def __init__(
        self,
        publish: Callable[[TopicMessage], None],
        drive_unit: DriveUnit,
        options: TopicOptions,
    ) -> None:
        """Create topics for the robots that will join.

        Args:
            publish: Called with each message.
            drive_unit: Unit of wheel speeds in drive commands.
            options: The topics to publish, and their names.
        """
        self._publish = publish
        info = RecordingInfo(
            version=__version__,
            drive_unit=drive_unit,
            own_localization=options.own_localization,
            no_namespace=options.no_namespace or "",
        )
        self._converter = CallConverter(info)
        self._robots = WatchRecorder(self._convert)

    def take(self, reports: Iterable[Report]) -> bytes:
        """Publish the reports of a watcher as topics; return queries for the server."""
        asked = b""
        for report in reports:
            if isinstance(report, ClockTick):
                self._publish(clock(report.time))
            asked += self._robots.take(report)
        return asked

    def take_picture(self, jpeg: bytes) -> None:
        """Publish a picture of the camera on the first robot."""
        first, tick = next(iter(self._robots.numbers.values()), None), self._robots.tick
        if first is not None and tick:
            self._convert(RunEvent(EventType.PICTURE, tick, first, jpeg))

    def _convert(self, event: RunEvent) -> None:
        for _, message in self._converter.convert(event):
            if message.topic not in UNPUBLISHED:
                self._publish(message)


async def publish_map(
    server: tuple[str, int],
    robot: str,
    publish: Callable[[TopicMessage], None],
    *,
    echoes: bool,
) -> None:
    """Publish a map from a robot's first scanner, a new map whenever the robot joins.

    Args:
        server: Host and port of the server.
        robot: Name of the robot, which may join later.
        publish: Called with each message, in the thread of this coroutine.
        echoes: Whether the robot's scanners send their echoes.

    Raises:
        ClientError: If the connection is lost.
        ValueError: If the name cannot be sent.
    """
    loop = asyncio.get_running_loop()
    plan = ExplorationPlan(resolution=MAP_RESOLUTION, echoes=echoes)
    while True:
        # A robot that joins again may be at any position, so a new map is started.
        follower = WatchMapper(plan)
        due = -math.inf

        def publish_now(follower: WatchMapper = follower) -> None:
            nonlocal due
            mapper = follower.mapper
            assert mapper is not None  # a scan was mapped
            time = mapper.trajectory.times[-1]
            if time >= due:
                due = time + MAP_INTERVAL
                # This runs in the mapping thread, but messages must be published in the
                # event loop.
                message = occupancy_grid(time, *sensed_map(mapper.grid))
                loop.call_soon_threadsafe(publish, message)

        follower.on_scan = publish_now
        watcher = RobotWatcher(server, robot, echoes=echoes)
        # A daemon thread does not prevent the bridge from ending.
        if await in_daemon_thread(follower.watch, watcher):
            raise ClientError(follower.error)


class Driver:
    """Executes velocity commands with the robot that the bridge has spawned."""

    def __init__(self, client: AsyncClient, robot: RobotInfo) -> None:
        """Create the driver of a robot that has already been spawned.

        Args:
            client: The client of the robot.
            robot: Properties of the robot.
        """
        self._client = client
        self._robot = robot
        self._wanted: tuple[float, float] | None = None  # velocity that is not sent yet
        self._moves = False
        self._last = -math.inf  # time of the last command

    def take(self, speed: float, turn: float) -> None:
        """Set the velocity of the robot; numbers that are not finite count as 0.

        Args:
            speed: Forward speed, m/s.
            turn: Counter-clockwise turn rate, rad/s.
        """
        speed, turn = (v if math.isfinite(v) else 0.0 for v in (speed, turn))
        self._wanted = speed, turn
        self._last = asyncio.get_running_loop().time()

    async def run(self) -> None:
        """Send velocity commands to the server until the connection is lost.

        Raises:
            ClientError: When the connection is lost.
        """
        await first_of(self._read(), self._drive())

    async def _drive(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            # A program that has lost its connection cannot send a stop, so the robot
            # stops if no command arrives in time.
            if self._moves and loop.time() - self._last > DEAD_MAN:
                self._wanted = 0.0, 0.0
            if self._wanted is not None:
                speed, turn = self._wanted
                # Commands may arrive faster than this loop runs, so only the newest one
                # is sent.
                self._wanted, self._moves = None, (speed, turn) != (0.0, 0.0)
                await self._client.drive(*self._robot.wheel_speeds(speed, turn))
            await asyncio.sleep(CHECK_INTERVAL)

    async def _read(self) -> None:
        """Read and discard the robot's reports, which the watcher publishes."""
        while True:
            await self._client.read(math.inf)


def as_jpeg(image_type: int, data: bytes) -> bytes:
    """Return a picture of an image server as JPEG.

    Args:
        image_type: Type of the picture, as in ``ImageType``.
        data: Data of the picture.

    Raises:
        ValueError: If the length of raw data does not match the size of the picture.
    """
    if image_type != ImageType.RAW:
        return data
    try:
        width, height = struct.unpack_from(">2H", data)
        stride = 3 * width + -3 * width % 4  # rows begin at multiples of 4 bytes
        size = (width, height)
        pixels = Image.frombytes("RGB", size, data[4:], "raw", "BGR", stride, 1)
        file = io.BytesIO()
        pixels.save(file, "JPEG", quality=QUALITY)
    except (struct.error, ValueError, OSError) as error:
        raise ValueError(f"raw picture of {len(data)} bytes: {error}") from error
    return file.getvalue()


async def read_pictures(
    server: tuple[str, int], interval: float, take: Callable[[bytes], None]
) -> None:
    """Request pictures from an image server until the connection is lost.

    Args:
        server: Host and port of the image server.
        interval: Time between two pictures, s.
        take: Called with each picture, as JPEG.

    Raises:
        ClientError: If the server cannot be reached, closes the connection, or sends
            no pictures.
    """
    place = f"image port {server[0]}:{server[1]}"
    loop = asyncio.get_running_loop()
    try:
        reader, writer = await asyncio.open_connection(*server)
    except OSError as error:
        text = f"{place}: {describe_os_error(error)}"
        raise ClientError(f"{text}, expected a server with --image-port") from error
    try:
        while True:
            due = loop.time() + interval
            writer.write(b"OK")
            head = await reader.readexactly(5)
            image_type, size = struct.unpack(">BI", head)
            if size > LARGEST_PICTURE:
                raise ClientError(f"{place}: a picture of {size} bytes is too large")
            take(as_jpeg(image_type, await reader.readexactly(size)))
            await asyncio.sleep(due - loop.time())
    except (OSError, asyncio.IncompleteReadError, ValueError) as error:
        raise ClientError(f"{place}: {error}, expected pictures") from error
    finally:
        writer.close()


def load_shown(options: TopicOptions) -> list[TopicMessage]:
    """Return messages that draw the map of the option ``--draw`` in ROS viewers.

    Raises:
        MapError: If the map is wrong.
    """
    if options.draw is None:
        return []
    # These slow imports are only needed to draw a map.
    from radarsim.addons.recording.scene_topics import scene_topics  # noqa: PLC0415
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    return list(scene_topics(load_map(options.draw), with_map=options.true_map))


async def run_bridge(
    server: tuple[str, int],
    side: RosSide,
    *,
    options: TopicOptions,
    robot_class: str | None = None,
    robot_name: str = "R1",
    start: str | None = None,
    drive_unit: DriveUnit = "rad_per_s",
) -> None:
    """Publish topics and execute velocity commands until the connection is lost.

    Args:
        server: Host and port of the server.
        side: Publishes topics, and receives commands.
        options: The topics to publish, and their names.
        robot_class: Class of the robot to spawn; None to spawn none.
        robot_name: Name of the robot to spawn.
        start: Name of its start pose; None for the first free start.
        drive_unit: Unit in which the server takes wheel speeds.

    Raises:
        ClientError: If the connection is lost, or the robot cannot be spawned.
        MapError: If the map to draw is wrong.
    """
    shown = load_shown(options)
    async with AsyncExitStack() as stack:
        watcher = await AsyncClient.connect(*server)
        await stack.enter_async_context(watcher)
        watcher.session.reads_copies = False  # the converter reads them
        await watcher.greeting()
        # Echoes are optional, because they take several times as many bytes as scans.
        await watcher.watch(echoes=options.echoes, clock=True)
        driving = []
        if robot_class is not None:
            client = await AsyncClient.connect(*server)
            await stack.enter_async_context(client)
            await client.greeting()
            await client.spawn(
                robot_class, name=robot_name, start=start, timeout=SPAWN_TIMEOUT
            )
            info = await client.robot_info(drive_unit=drive_unit)
            driver = Driver(client, info)
            has_none = same_name(robot_name, options.no_namespace or "")
            name = "" if has_none else topic_name(robot_name)
            side.subscribe(f"/{below(name, 'cmd_vel')}", driver.take)
            driving.append(driver.run())
        for message in shown:
            side.publish(message)
        topics = LiveTopics(side.publish, drive_unit, options)
        working = [side.run(), _watch(watcher, topics), *driving]
        if options.map is not None:
            working.append(
                publish_map(server, options.map, side.publish, echoes=options.echoes)
            )
        if options.image_port is not None:
            images = server[0], options.image_port
            interval = 1 / options.image_rate
            working.append(read_pictures(images, interval, topics.take_picture))
        # All coroutines have to end before the exit stack closes their connections.
        await first_of(*working)


async def _watch(client: AsyncClient, topics: LiveTopics) -> None:
    while True:
        reports = await client.read(math.inf)
        for report in reports:
            if isinstance(report, CommandError):
                raise ClientError(f"the server reports an error: {report.text}")
        asked = topics.take(reports)
        if asked:
            await client.send(asked)
