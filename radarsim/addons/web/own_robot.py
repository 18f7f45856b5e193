"""A robot that the commander spawned, and its connection to the server.

A browser that drives the robot repeats its command. The robot stops if no command
arrives for ``DEAD_MAN`` seconds, such as when the browser is closed, a key is stuck in
a hidden tab or the network is down.

Navigators and explorers expect a blocking ``Client``, and run in threads.
``RobotClient`` is such a client for a robot that is spawned already: it receives the
robot's reports, and passes commands to the robot's connection.
"""

import asyncio
import math
import queue
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Final, NoReturn, TypeAlias

from radarsim.addons.web.requests import FIRST_CLASS
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.client import AsyncClient, Client, ClientTimeout, DriveUnit, RobotInfo
from radarsim.client import session as questions
from radarsim.errors import ClientError
from radarsim.listening import first_of
from radarsim.protocol.reports import Report

DEAD_MAN: Final = 0.4  # s; the robot stops if no drive command arrives for this long
SENSORS: Final = ("SEN ",)  # start of sensor lines
MOST_WAITING: Final = 1000  # batches of reports; beyond it the oldest are dropped


class OwnRobot:
    """One robot and its connection.

    Attributes:
        name: Name under which the robot was spawned.
        info: Dimensions, limits and scanners.
        refusal: Why the robot cannot drive to a goal or explore; None if it can.
        driver: Name of the viewer that drives the robot; None for none.
    """

    def __init__(
        self,
        client: AsyncClient,
        name: str,
        info: RobotInfo,
        on_driver: Callable[["OwnRobot"], None],
        on_reports: Callable[["OwnRobot", Sequence[Report]], None],
    ) -> None:
        """Take over the connection of a robot that is spawned already.

        Args:
            client: The connection; ``close`` closes it.
            name: Name of the robot.
            info: Properties of the robot.
            on_driver: Called when ``driver`` has changed.
            on_reports: Called with reports as soon as they arrive. It gets no sensor
                reports after ``leave_sensors(True)``.
        """
        self.name = name
        self.info = info
        self.refusal = find_refusal(info)
        self.driver: str | None = None
        self._on_driver, self._on_reports = on_driver, on_reports
        self._are_sensors_left = False
        self._reader: Callable[[Sequence[Report]], None] | None = None
        self._client = client
        self._loop = asyncio.get_running_loop()
        self._dead_man: asyncio.TimerHandle | None = None
        self._wheels = (0.0, 0.0)
        self._outbox: dict[object, Callable[[], Awaitable[None]]] = {}
        self._wake = asyncio.Event()

    async def run(self) -> None:
        """Forward reports and send commands until the connection ends.

        Raises:
            ClientError: If the server closes the connection, or stops reading.
        """
        # ``_send`` fails if the server stops reading, and ``_read`` if the server is
        # gone.
        await first_of(self._read(), self._send())

    def leave_sensors(self, on: bool) -> None:
        """If ``on``, ignore sensor lines while no task reads them; else read all."""
        # While all robots are watched, each line arrives twice; parsing both copies
        # would take most of the commander's time.
        self._are_sensors_left = on
        self._choose_lines()

    def read_by(self, take: Callable[[Sequence[Report]], None] | None) -> None:
        """Pass all reports, even of sensors, to ``take``; stop if ``take`` is None."""
        self._reader = take
        self._choose_lines()

    def _choose_lines(self) -> None:
        leaves = self._are_sensors_left and self._reader is None
        self._client.session.ignored = SENSORS if leaves else ()

    async def close(self) -> None:
        """Stop the robot and close the connection; the server removes the robot."""
        self._cancel_dead_man()
        self.set_wheels(0.0, 0.0)
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
        self._cancel_dead_man()
        # The page repeats the command, and the robot stops when the repetitions end.
        self._dead_man = self._loop.call_later(DEAD_MAN, self.release)
        top = self.info.max_wheel_speed
        turn = 2 * top / self.info.wheel_separation
        self.set_wheels(*self.info.wheel_speeds(ahead * top, left * turn))
        self._set_driver(driver)

    def release(self) -> None:
        """Stop the robot; no viewer drives it any more."""
        self._cancel_dead_man()
        self.set_wheels(0.0, 0.0)
        self._set_driver(None)

    def set_wheels(self, left: float, right: float) -> None:
        """Set wheel speeds, and send the speeds if they are new or if both are 0."""
        # For safety, a stop is sent even if the speeds are 0 already.
        if (left, right) != self._wheels or not (left or right):
            self._wheels = (left, right)
            self._post("wheels", lambda: self._client.drive(left, right))

    def change_setting(self, scanner: str, key: str, value: object) -> None:
        """Change a setting of a scanner from its next scan on."""
        # The call does not wait for an answer, because a refusal arrives with the
        # reports.
        data = questions.change_settings(scanner, {key: value})
        self._post((scanner, key), lambda: self._client.send(data))

    def switch_echoes(self, scanner: str, on: bool) -> None:
        """Switch the echo lines of a scanner on this connection on or off."""
        self._post((scanner, ""), lambda: self._client.echoes(scanner, on))

    def _cancel_dead_man(self) -> None:
        if self._dead_man is not None:
            self._dead_man.cancel()
            self._dead_man = None

    def _set_driver(self, driver: str | None) -> None:
        if driver != self.driver:
            self.driver = driver
            self._on_driver(self)

    def _post(self, subject: object, send: Callable[[], Awaitable[None]]) -> None:
        """Queue a command; it replaces a waiting command with the same subject."""
        # A new command replaces a waiting one, so a server that reads slowly gets only
        # the newest command.
        self._outbox.pop(subject, None)
        self._outbox[subject] = send
        self._wake.set()

    async def _read(self) -> NoReturn:
        while True:
            reports = await self._client.read(math.inf)  # servers may pause
            self._on_reports(self, reports)
            if self._reader is not None:
                self._reader(reports)

    async def _send(self) -> NoReturn:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._outbox:
                await self._outbox.pop(next(iter(self._outbox)))()


def find_refusal(robot: RobotInfo) -> str | None:
    """Return why a robot cannot drive to a goal or explore; None if it can.

    Args:
        robot: Properties of the robot, which navigates by its first scanner.
    """
    try:
        scanner = robot.scanner()
    except ClientError:
        return "it has no range scanner"
    if Bumpers(safety_distance=1.0).blind(scanner.angles + scanner.mount.yaw):
        seen = f"{scanner.name} sees {math.degrees(scanner.fov):.0f}\N{DEGREE SIGN}"
        return f"{seen}, expected a full circle as on a {FIRST_CLASS}"
    return None


class TaskClock:
    """The clock of tasks, in simulated time.

    The clock stops while the simulation is paused, so that waiting for a scan does not
    time out. Any thread may read the clock.
    """

    def __init__(self) -> None:
        """Start at 0 s, at the speed of the wall clock."""
        self._since = (time.monotonic(), 0.0, 1.0)  # wall time, s; task time, s; rate

    def time(self) -> float:
        """Return the simulated time of the task, s."""
        wall, began, rate = self._since
        return began + rate * (time.monotonic() - wall)

    def set_rate(self, rate: float) -> None:
        """Set how many seconds of task time pass per second of the wall clock."""
        self._since = (time.monotonic(), self.time(), rate)


class RobotClient(Client):
    """A blocking client for the thread of a task, which can be cancelled.

    The class supports only the methods of ``Client`` that algorithms use.

    Attributes:
        robot: The robot, which is spawned already.
        kind: Kind of the task: ``goto`` or ``explore``.
        number: Number of the task.
    """

    def __init__(
        self, robot: OwnRobot, kind: str, number: int, clock: TaskClock
    ) -> None:
        """Receive the robot's reports from now on; call it in the event loop.

        Args:
            robot: The robot.
            kind: Kind of the task.
            number: Number of the task.
            clock: Clock for timeouts.
        """
        # In this class, ``Client`` uses nothing of its connection but the clock, so the
        # clock is passed as the connection.
        super().__init__(clock)  # type: ignore[arg-type]
        self.robot, self.kind, self.number = robot, kind, number
        self._loop = asyncio.get_running_loop()
        self._reports: queue.Queue[Sequence[Report]] = queue.Queue()
        self._is_cancelled = False
        robot.read_by(self._take)

    def cancel(self) -> None:
        """Make all calls raise, even a call that waits; run this in the event loop."""
        self._is_cancelled = True
        self._reports.put(())  # wakes up the thread
        self.robot.read_by(None)

    def spawn(self, *_: object, **__: object) -> None:
        """Do nothing: the robot is spawned already."""

    def robot_info(self, *, drive_unit: DriveUnit = "rad_per_s") -> RobotInfo:  # noqa: ARG002
        """Return the properties of the robot."""
        return self.robot.info

    def echoes(self, scanner: str, on: bool = True) -> None:
        """See ``Client.echoes``."""
        self._call(self.robot.switch_echoes, scanner, on)

    def drive(self, left: float, right: float) -> None:
        """See ``Client.drive``."""
        self._check()
        self._call(self._set_wheels, left, right)

    def stop(self) -> bool:
        """See ``Client.stop``; a cancelled client does nothing."""
        # A cancelled algorithm calls ``stop`` while it ends, so ``stop`` does not
        # raise.
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
            # A slow algorithm needs only the newest reports, so the oldest are dropped.
            self._reports.get()
        self._reports.put(reports)

    def _set_wheels(self, left: float, right: float) -> None:
        """Set wheel speeds, unless the task is cancelled; runs in the event loop."""
        if not self._is_cancelled:
            # A viewer may have started to drive while this call waited in the event
            # loop.
            self.robot.set_wheels(left, right)

    def _check(self) -> None:
        if self._is_cancelled:
            raise ClientError("cancelled")

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        self._loop.call_soon_threadsafe(function, *arguments)


Send: TypeAlias = Callable[[dict[str, Any]], None]  # sends a message to all browsers
# The function of a task returns its result as a text, and raises an error if it fails.
Work: TypeAlias = Callable[[RobotClient, Send], str]
