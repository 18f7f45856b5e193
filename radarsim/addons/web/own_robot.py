"""A robot that the commander spawned, on a connection of its own.

Whoever drives it says so again and again. When nothing is heard for a while, as when a
browser is closed, a key is stuck in a hidden tab or the network is down, it stops.

Navigators and explorers are written for a blocking ``Client``, and run in threads.
``RobotClient`` is one: it is handed the reports of a robot that is there already, and
passes commands to its connection.
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

DEAD_MAN: Final = 0.4  # s after the last command to drive
SENSORS: Final = ("SEN ",)  # how lines of sensors begin
MOST_WAITING: Final = 1000  # times that reports arrive; beyond it the oldest are lost


class OwnRobot:
    """One robot and its connection.

    Attributes:
        name: Name that was asked for.
        info: Dimensions, limits and scanners.
        refusal: Why it can do nothing by itself; None if it can.
        driver: Name of the viewer that drives it; None for none.
    """

    def __init__(
        self,
        client: AsyncClient,
        name: str,
        info: RobotInfo,
        on_driver: Callable[["OwnRobot"], None],
        on_reports: Callable[["OwnRobot", Sequence[Report]], None],
    ) -> None:
        """Take a connection whose robot is spawned.

        Args:
            client: The connection, which the robot closes.
            name: Name of the robot.
            info: Its properties.
            on_driver: Called when another viewer drives it than before, or none.
            on_reports: Called with the reports that arrive, at once; those of sensors
                may be left out, see ``leave_sensors``.
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
        """Pass on reports, and send commands, until the connection ends.

        Raises:
            ClientError: If the server ends it, or reads no more.
        """
        # Who sends notices a server that reads no more, who reads one that is gone.
        await first_of(self._read(), self._send())

    def leave_sensors(self, on: bool) -> None:
        """Read no sensors, since all robots are watched, while it is read by nobody."""
        # To read each line twice would take most of the time of the commander.
        self._are_sensors_left = on
        self._choose_lines()

    def read_by(self, take: Callable[[Sequence[Report]], None] | None) -> None:
        """Pass all reports to a function, also those of sensors; None to end that."""
        self._reader = take
        self._choose_lines()

    def _choose_lines(self) -> None:
        leaves = self._are_sensors_left and self._reader is None
        self._client.session.ignored = SENSORS if leaves else ()

    async def close(self) -> None:
        """Stop the robot and close the connection, upon which the server removes it."""
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
        # The page repeats what it asks for; without a word the robot stops.
        self._dead_man = self._loop.call_later(DEAD_MAN, self.release)
        top = self.info.max_wheel_speed
        turn = 2 * top / self.info.wheel_separation
        self.set_wheels(*self.info.wheel_speeds(ahead * top, left * turn))
        self._set_driver(driver)

    def release(self) -> None:
        """End driving, and stop."""
        self._cancel_dead_man()
        self.set_wheels(0.0, 0.0)
        self._set_driver(None)

    def set_wheels(self, left: float, right: float) -> None:
        """Set wheel speeds in the server's unit; sent if they differ, or are 0."""
        # A stop is sent whatever is believed to be set: a robot must not drive on.
        if (left, right) != self._wheels or not (left or right):
            self._wheels = (left, right)
            self._post("wheels", lambda: self._client.drive(left, right))

    def change_setting(self, scanner: str, key: str, value: object) -> None:
        """Change a setting of a scanner from its next scan on."""
        # Without waiting: what the server has against it comes with the reports.
        data = questions.change_settings(scanner, {key: value})
        self._post((scanner, key), lambda: self._client.send(data))

    def switch_echoes(self, scanner: str, on: bool) -> None:
        """Ask for the echoes of a scanner on this connection, or no more."""
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
        """Send a command soon; one of the same subject that still waits is dropped."""
        # A server that is slow to read gets the newest command, and nothing old.
        self._outbox.pop(subject, None)
        self._outbox[subject] = send
        self._wake.set()

    async def _read(self) -> NoReturn:
        while True:
            reports = await self._client.read(math.inf)  # a server may pause
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
        robot: Its properties; it steers by its first scanner.
    """
    try:
        scanner = robot.scanner()
    except ClientError:
        return "it has no range scanner"
    if Bumpers(safety_distance=1.0).blind(scanner.angles + scanner.mount.yaw):
        seen = f"{scanner.name} sees {math.degrees(scanner.fov):.0f}\N{DEGREE SIGN}"
        return f"{seen}, not a full circle as that of a {FIRST_CLASS}"
    return None


class TaskClock:
    """The clock of what robots do by themselves.

    It follows simulated time, so that nothing that waits for a scan gives up while the
    simulation is paused. Threads may read it at any time.
    """

    def __init__(self) -> None:
        """Begin at 0 s."""
        self._since = (time.monotonic(), 0.0, 1.0)  # s of the wall, own time, and rate

    def time(self) -> float:
        """Return the time, s."""
        wall, began, rate = self._since
        return began + rate * (time.monotonic() - wall)

    def set_rate(self, rate: float) -> None:
        """Change how many seconds pass in one of the wall clock."""
        self._since = (time.monotonic(), self.time(), rate)


class RobotClient(Client):
    """A client for the thread of a task, whose robot is spawned; it can be cancelled.

    Only the methods that algorithms use exist.

    Attributes:
        robot: The robot.
        kind: Of the task: ``goto`` or ``explore``.
        number: Of the task.
    """

    def __init__(
        self, robot: OwnRobot, kind: str, number: int, clock: TaskClock
    ) -> None:
        """Listen to a robot; to be called in the event loop.

        Args:
            robot: The robot.
            kind: As above.
            number: As above.
            clock: By which it waits.
        """
        # Of a connection, only its clock is used.
        super().__init__(clock)  # type: ignore[arg-type]
        self.robot, self.kind, self.number = robot, kind, number
        self._loop = asyncio.get_running_loop()
        self._reports: queue.Queue[Sequence[Report]] = queue.Queue()
        self._is_cancelled = False
        robot.read_by(self._take)

    def cancel(self) -> None:
        """Let every call raise, also one that waits; in the event loop."""
        self._is_cancelled = True
        self._reports.put(())  # wakes up the thread
        self.robot.read_by(None)

    def spawn(self, *_: object, **__: object) -> None:
        """Take the robot that is there, where it is."""

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
        """See ``Client.stop``; who has cancelled it has stopped the robot as well."""
        # Without a check: an algorithm that is cancelled calls it on its way out.
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
            # Who is behind steers by the newest reports, and can do without old ones.
            self._reports.get()
        self._reports.put(reports)

    def _set_wheels(self, left: float, right: float) -> None:
        """Set speeds in the event loop, unless it was cancelled meanwhile."""
        if not self._is_cancelled:
            # It is checked here as well: the call has waited while a viewer took over.
            self.robot.set_wheels(left, right)

    def _check(self) -> None:
        if self._is_cancelled:
            raise ClientError("cancelled")

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        self._loop.call_soon_threadsafe(function, *arguments)


Send: TypeAlias = Callable[[dict[str, Any]], None]  # browsers, with a message
# What a robot does by itself: returns how it went, in words, or raises why it did not.
Work: TypeAlias = Callable[[RobotClient, Send], str]
