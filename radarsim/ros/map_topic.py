"""The topic ``/map``: a map of one robot, made in a thread while it drives."""

import asyncio
import math
from collections.abc import Callable
from typing import Final

from radarsim.proxy.traffic_mapper import TrafficMapper
from radarsim.recording.map_message import map_message
from radarsim.recording.robot_topics import TopicMessage

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
            self._publish(map_message(mapper.grid, time))
