"""A client for algorithms that drive a robot of the commander, each in a thread.

Navigators and explorers are written for a blocking ``Client``. This one is handed the
reports of a robot that is there already, and passes commands to its connection.
"""

import asyncio
import queue
import time
from collections.abc import Sequence
from typing import Final, NoReturn

from radarsim.addons.web.own_robot import OwnRobot
from radarsim.client import Client, ClientError, ClientTimeout, DriveUnit, RobotInfo
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import Report

MOST_WAITING: Final = 1000  # times that reports arrive; beyond it the oldest are lost


class RobotClient(Client):
    """A client whose robot is spawned, and which can be cancelled.

    Only the methods that algorithms use exist.
    """

    def __init__(self, robot: OwnRobot) -> None:
        """Listen to a robot; to be called in the event loop.

        Args:
            robot: The robot.
        """
        super().__init__(_Clock())
        self._robot = robot
        self._loop = asyncio.get_running_loop()
        self._reports: queue.Queue[Sequence[Report]] = queue.Queue()
        self._is_cancelled = False
        robot.listeners.append(self._take)

    def cancel(self) -> None:
        """Let every call raise, also one that waits; in the event loop."""
        self._is_cancelled = True
        self._reports.put(())
        if self._take in self._robot.listeners:
            self._robot.listeners.remove(self._take)

    def spawn(
        self,
        class_name: str,
        *,
        name: str | None = None,
        start: str | None = None,
        pose: Pose2 | Pose3 | None = None,
        timeout: float | None = None,
    ) -> None:
        """Take the robot that is there, where it is."""

    def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:  # noqa: ARG002
        """Return the properties of the robot."""
        return self._robot.info

    def echoes(self, scanner: str, on: bool = True) -> None:
        """See ``Client.echoes``."""
        self._call(self._robot.switch_echoes, scanner, on)

    def drive(self, left: float, right: float) -> None:
        """See ``Client.drive``."""
        self._check()
        self._call(self._set_wheels, left, right)

    def stop(self) -> bool:
        """See ``Client.stop``; who has cancelled it has stopped the robot as well."""
        self._call(self._set_wheels, 0.0, 0.0)
        return True

    def read(self, timeout: float | None = None) -> list[Report]:
        """See ``Client.read``."""
        reports: list[Report] = []
        try:
            reports += self._reports.get(timeout=timeout)
            while not self._reports.empty():
                reports += self._reports.get_nowait()
        except queue.Empty:
            raise ClientTimeout(f"no report within {timeout:g} s") from None
        self._check()
        return reports

    def _take(self, reports: Sequence[Report]) -> None:
        if self._reports.qsize() >= MOST_WAITING:
            self._reports.get()
        self._reports.put(reports)

    def _set_wheels(self, left: float, right: float) -> None:
        """Set speeds in the event loop, unless it was cancelled meanwhile."""
        if not self._is_cancelled:
            self._robot.set_wheels(left, right)

    def _check(self) -> None:
        if self._is_cancelled:
            raise ClientError("cancelled")

    def _call(self, function: object, *arguments: object) -> None:
        self._loop.call_soon_threadsafe(function, *arguments)  # type: ignore[arg-type]


class _Clock:
    """A transport that has nothing but a clock."""

    def send(self, data: bytes) -> NoReturn:
        raise ConnectionError(f"{data[:80]!r} cannot be sent here")

    def receive(self, timeout: float) -> NoReturn:
        raise ConnectionError(f"nothing comes here, nor within {timeout:g} s")

    def time(self) -> float:
        return time.monotonic()

    def close(self) -> None:
        pass
