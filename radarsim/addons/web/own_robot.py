"""A robot that the commander spawned, on a connection of its own.

Whoever drives it says so again and again. When nothing is heard for a while, as when a
browser is closed, a key is stuck in a hidden tab or the network is down, it stops.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from typing import Final, NoReturn, Self

from radarsim.addons.web.offers import FIRST_CLASS
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.client import AsyncClient, ClientTimeout, RobotInfo
from radarsim.client.session import RANGE_SCANNER
from radarsim.errors import ClientError
from radarsim.geometry import Pose2
from radarsim.protocol.dialect import DriveUnit
from radarsim.protocol.reports import Report


def find_hindrance(robot: RobotInfo) -> str | None:
    """Return why a robot cannot drive to a goal or explore; None if it can.

    Args:
        robot: Its properties; it steers by its first scanner.
    """
    try:
        scanner = robot.scanner()
    except ClientError:
        return "it has no range scanner"
    if Bumpers(safety_distance=1.0).blind(scanner.angles + scanner.mount.yaw):
        seen = f"{scanner.name} sees {math.degrees(scanner.fov):.0f}\N{DEGREE SIGN}"
        return f"{seen}, not all around as that of a {FIRST_CLASS}"
    return None


DEAD_MAN: Final = 0.4  # s after the last command to drive
ANSWER: Final = 5.0  # s that a server has to answer
SPAWN_TIMEOUT: Final = 120.0  # s; a server may have to compile first
SILENCE: Final = 60.0  # s that one call waits for reports


class OwnRobot:
    """One robot and its connection.

    Attributes:
        name: Name that was asked for.
        class_name: Name of its class.
        info: Dimensions, limits and scanners.
        hindrance: Why it can do nothing by itself; None if it can.
        driver: Name of the viewer that drives it; None for none.
        listeners: Called with the reports that arrive, at once.
        on_expiry: Called when it was stopped because nobody drove it any more.
    """

    def __init__(
        self, client: AsyncClient, name: str, class_name: str, info: RobotInfo
    ) -> None:
        """Take a connection whose robot is spawned.

        Args:
            client: The connection, which the robot closes.
            name: Name of the robot.
            class_name: Name of its class.
            info: Its properties.
        """
        self.name = name
        self.class_name = class_name
        self.info = info
        self.hindrance = find_hindrance(info)
        self.driver: str | None = None
        self.listeners: list[Callable[[Sequence[Report]], None]] = []
        self.on_expiry: Callable[[], None] = lambda: None
        self._client = client
        self._loop = asyncio.get_running_loop()
        self._dead_man: asyncio.TimerHandle | None = None
        self._wheels = (0.0, 0.0)
        self._outbox: dict[object, Callable[[], Awaitable[None]]] = {}
        self._wake = asyncio.Event()

    @classmethod
    async def spawn(
        cls,
        address: tuple[str, int],
        class_name: str,
        name: str,
        place: str | Pose2 | None,
        drive_unit: DriveUnit,
    ) -> Self:
        """Connect, and spawn a robot.

        Args:
            address: Host and port of the server.
            class_name: Name of the class.
            name: Name of the robot.
            place: Name of a start, a pose in the map frame, or None.
            drive_unit: Unit of the server's wheel speeds.

        Raises:
            ClientError: If the server is not there, or no robot comes.
            ValueError: If a text cannot be written on a line.
        """
        client = await AsyncClient.connect(*address, timeout=ANSWER)
        try:
            start = place if isinstance(place, str) else None
            pose = place if isinstance(place, Pose2) else None
            await client.spawn(
                class_name, name=name, start=start, pose=pose, timeout=SPAWN_TIMEOUT
            )
            info = await client.robot_info(drive_unit=drive_unit)
        except BaseException:
            await client.close()
            raise
        return cls(client, name, class_name, info)

    async def run(self) -> None:
        """Pass on reports, and send commands, until the connection ends.

        Raises:
            ClientError: If the server ends it, or reads no more.
        """
        tasks = {
            asyncio.ensure_future(self._read()),
            asyncio.ensure_future(self._send()),
        }
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
        for task in done:
            task.result()

    async def close(self) -> None:
        """Stop the robot and close the connection, upon which the server removes it."""
        self.release()
        await self._client.close()

    def drive(self, driver: str, ahead: float, left: float) -> None:
        """Drive for ``DEAD_MAN`` seconds.

        Args:
            driver: Name of the viewer that drives.
            ahead: Share of the top speed, -1 to 1.
            left: Share of the top turn rate to the left, -1 to 1.
        """
        if not ahead and not left:
            self.release()
            return
        self.release(stops=False)
        self.driver = driver
        self._dead_man = self._loop.call_later(DEAD_MAN, self._expire)
        top = self.info.max_wheel_speed
        turn = 2 * top / self.info.wheel_separation
        self.set_wheels(*self.info.wheel_speeds(ahead * top, left * turn))

    def release(self, *, stops: bool = True) -> None:
        """End driving, and stop unless another command follows at once."""
        if self._dead_man is not None:
            self._dead_man.cancel()
            self._dead_man = None
        self.driver = None
        if stops:
            self.set_wheels(0.0, 0.0)

    def set_wheels(self, left: float, right: float) -> None:
        """Set wheel speeds in the server's unit; sent if they differ, or are 0."""
        if (left, right) != self._wheels or not (left or right):
            self._wheels = (left, right)
            self._post("wheels", lambda: self._client.drive(left, right))

    def change_setting(self, scanner: str, key: str, value: str) -> None:
        """Change a setting of a scanner from its next scan on."""
        order = RANGE_SCANNER, scanner, "SETTING", f"{key}={value}"
        self._post((scanner, key), lambda: self._client.set_item(*order))

    def switch_echoes(self, scanner: str, on: bool) -> None:
        """Ask for the echoes of a scanner on this connection, or no more."""
        self._post((scanner, ""), lambda: self._client.echoes(scanner, on))

    def _expire(self) -> None:
        self.release()
        self.on_expiry()

    def _post(self, subject: object, send: Callable[[], Awaitable[None]]) -> None:
        """Send a command soon; one of the same subject that still waits is dropped."""
        self._outbox.pop(subject, None)
        self._outbox[subject] = send
        self._wake.set()

    async def _read(self) -> NoReturn:
        while True:
            with suppress(ClientTimeout):  # a server may pause
                reports = await self._client.read(SILENCE)
                for listener in tuple(self.listeners):
                    listener(reports)

    async def _send(self) -> NoReturn:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._outbox:
                await self._outbox.pop(next(iter(self._outbox)))()
