"""Motion commands, the loop that sends them, and detectors of stuck robots.

The loop turns scans into wheel speeds. It stops the robot while no scan arrives, and
raises an error that names the missing report when the timeout is over.
"""

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from radarsim.autonomy.navigation.observation import Observation, ScanReader
from radarsim.client import Client, RobotInfo
from radarsim.errors import ClientTimeout, NavigationError
from radarsim.geometry import Pose2, wrap_angle
from radarsim.protocol.reports import Report

HEADING_GAIN = 2.5  # 1/s: turn rate in rad/s for each rad of heading error
STOP_AFTER = 0.5  # s without a scan before the robot is stopped
STUCK_AFTER = 3.0  # m of commanded distance without motion
STUCK_AFTER_TURN: Final = 2 * math.tau  # rad of commanded turn without turning
STANDSTILL_LIMIT: Final = 60.0  # s without motion before an error is raised
_LONGEST_STEP: Final = 1.0  # s; upper limit of the time between two scans
MOVED: Final = (0.1, 0.3)  # m and rad; a smaller change of the pose is noise


@dataclass(frozen=True, slots=True)
class Twist:
    """A motion: forward speed, m/s, and counter-clockwise turn rate, rad/s."""

    speed: float
    turn: float


STOP = Twist(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """Highest forward speed, m/s, and highest turn rate on the spot, rad/s."""

    speed: float = 0.3
    turn: float = 0.8

    def __post_init__(self) -> None:
        for name, value in (("speed", self.speed), ("turn", self.turn)):
            if not 0 < value < math.inf:
                raise ValueError(f"{name} {value!r}, expected a finite number above 0")

    def towards(self, bearing: float, *, most: float = math.inf) -> Twist:
        """Return a twist that turns to a bearing, and drives when facing it.

        Args:
            bearing: Bearing in rad from the robot's front.
            most: Upper limit of the speed, m/s.
        """
        turn = max(-self.turn, min(self.turn, HEADING_GAIN * bearing))
        facing = max(0.0, math.cos(bearing))
        # With the fourth power, the robot drives at a quarter of its speed when it is
        # 45 degrees off, so it turns before it drives.
        return Twist(min(self.speed, most) * facing**4, turn)


def bearing_of(pose: Pose2, x: float, y: float) -> float:
    """Return the bearing of a point, rad from the front of a robot at a pose."""
    return wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)


def distance(pose: Pose2, x: float, y: float) -> float:
    """Return the distance between a pose and a point, m."""
    return math.hypot(x - pose.x, y - pose.y)


class StuckDetector:
    """Detects a robot that neither moves nor turns although motions are commanded."""

    def __init__(self) -> None:
        self._last_time = 0.0
        self._place: Pose2 | None = None  # pose at the start of the distance
        self._distance = 0.0  # commanded distance, m
        self._heading: Pose2 | None = None  # pose at the start of the turn
        self._turn = 0.0  # commanded turn, rad

    def check(self, observation: Observation, twist: Twist) -> None:
        """Compare a scan, and the twist chosen for it, with earlier scans and twists.

        Raises:
            NavigationError: If the commanded robot does not move.
        """
        # During a long gap between scans, the loop stopped the robot or could not
        # command the robot. So only the first part of the gap counts.
        elapsed = min(observation.time - self._last_time, _LONGEST_STEP)
        self._last_time = observation.time
        pose, command = observation.pose, ""
        # Commanded motion is counted instead of time, so a waiting robot is not stuck.
        if self._place is None or pose.distance(self._place) > MOVED[0]:
            self._place, self._distance = pose, 0.0
        else:
            self._distance += abs(twist.speed) * elapsed
            if self._distance > STUCK_AFTER:
                pose, command = self._place, f"go {STUCK_AFTER:g} m"
        if self._heading is None or observation.pose.is_apart(self._heading, *MOVED):
            self._heading, self._turn = observation.pose, 0.0
        else:
            self._turn += abs(twist.turn) * elapsed
            if self._turn > STUCK_AFTER_TURN and not command:
                degrees = math.degrees(STUCK_AFTER_TURN)
                pose, command = self._heading, f"turn {degrees:.0f}°"
        if command:
            raise NavigationError(
                f"the robot stays at {pose.x:.2f} {pose.y:.2f} although commanded to"
                f" {command}; perhaps an obstacle is nearer than sensed, and a larger"
                " safety distance helps"
            )


class StandstillDetector:
    """Detects a robot that has not moved or turned for a minute, for any reason."""

    def __init__(self) -> None:
        self._reference: Observation | None = None

    def check(self, observation: Observation) -> None:
        """Compare a scan with earlier scans.

        Raises:
            NavigationError: If the robot has stood for a minute.
        """
        reference = self._reference
        if reference is None or observation.pose.is_apart(reference.pose, *MOVED):
            self._reference = observation
        elif observation.time - reference.time > STANDSTILL_LIMIT:
            pose = observation.pose
            raise NavigationError(
                f"the robot has stood at {pose.x:.2f} {pose.y:.2f} for"
                f" {STANDSTILL_LIMIT:g} s:"
                " obstacles on all sides are nearer than the safety distance"
            )


class ControlLoop:
    """The control loop of one robot: yields observations, and sends wheel speeds."""

    def __init__(
        self,
        client: Client,
        robot_info: RobotInfo,
        source: ScanReader,
        *,
        timeout: float,
    ) -> None:
        """Create the control loop of a robot.

        Args:
            client: The connection, with a spawned robot.
            robot_info: Properties of the robot.
            source: Receives every report.
            timeout: Time without a scan before an error is raised, s.
        """
        self._client = client
        self._robot_info = robot_info
        self._source = source
        self._timeout = timeout

    def drive(self, twist: Twist) -> None:
        """Command the wheel speeds that move the robot as a twist says."""
        self._client.drive(*self._robot_info.wheel_speeds(twist.speed, twist.turn))

    def scans(self) -> Iterator[Observation]:
        """Yield an observation for every scan; stop the robot while no scan arrives.

        Raises:
            ClientTimeout: If no more scans arrive.
        """
        while True:
            yield self._next()

    def _next(self) -> Observation:
        clock = self._client.transport.time
        start, stopped = clock(), False
        received: set[str] = set()
        while (waited := clock() - start) < self._timeout:
            # A robot keeps its last wheel speeds, so
            # without scans it would drive blindly.
            if waited >= STOP_AFTER and not stopped:
                self.drive(STOP)
                stopped = True
            reports: list[Report] = []
            # One read may time out; an error is raised if all reads time out.
            with suppress(ClientTimeout):
                left = (self._timeout if stopped else STOP_AFTER) - waited
                reports = self._client.read(max(left, 0.001))
            newest = None  # only the newest of several scans is used
            for report in reports:
                newest = self._source.take(report) or newest
                received.add(type(report).__name__)
            if newest is not None:
                return newest
        names = ", ".join(sorted(received))
        came = f"received only: {names}" if received else "nothing received"
        missing = f"no {self._source.missing} within {self._timeout:g} s"
        hint = f"; {self._source.hint}" * bool(self._source.hint)
        raise ClientTimeout(f"{missing}, {came}; the robot was commanded to stop{hint}")
