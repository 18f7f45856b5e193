"""A robot that follows velocity commands, and stops when none come any more."""

import asyncio
import math
from contextlib import suppress
from typing import Final

from radarsim.client import AsyncClient, ClientTimeout, RobotInfo

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
        late = asyncio.get_running_loop().time() - self._last > DEAD_MAN
        if self._moves and late:
            self._wanted = 0.0, 0.0
        if self._wanted is not None:
            speed, turn = self._wanted
            self._wanted, self._moves = None, (speed, turn) != (0.0, 0.0)
            await self._client.drive(*self._robot.wheel_speeds(speed, turn))

    async def _read(self) -> None:
        """Read what the robot senses, which its watcher publishes."""
        while True:
            with suppress(ClientTimeout):
                await self._client.read()
