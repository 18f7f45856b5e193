"""What a navigator wants of the wheels."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Protocol

from radarsim.client import Client, RobotInfo, ScannerInfo
from radarsim.errors import ClientError, ClientTimeout, NavigationError
from radarsim.geometry import Pose2, wrap_angle
from radarsim.navigation.observation import Observation
from radarsim.protocol.reports import Report

HEADING_GAIN = 2.5  # 1/s: rad/s of turning for each rad of heading error


@dataclass(frozen=True, slots=True)
class Twist:
    """Speed forward in m/s and turn counter-clockwise in rad/s."""

    speed: float
    turn: float


STAND = Twist(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """How fast a navigator wants to be: m/s, and rad/s on the spot."""

    speed: float = 0.3
    turn: float = 0.8

    def __post_init__(self) -> None:
        for name, value in (("speed", self.speed), ("turn", self.turn)):
            if not 0 < value < math.inf:
                raise ValueError(f"{name} {value!r}, expected above 0 and finite")

    def towards(self, bearing: float, *, most: float = math.inf) -> Twist:
        """Turn to a bearing, and go the faster the better the robot faces it.

        Args:
            bearing: rad from the robot's front.
            most: Upper limit of the speed, m/s.
        """
        turn = max(-self.turn, min(self.turn, HEADING_GAIN * bearing))
        facing = max(0.0, math.cos(bearing))
        return Twist(min(self.speed, most) * facing**4, turn)


def bearing_of(pose: Pose2, x: float, y: float) -> float:
    """Give the direction of a point as seen from a pose, rad from its front."""
    return wrap_angle(math.atan2(y - pose.y, x - pose.x) - pose.yaw)


def distance(pose: Pose2, x: float, y: float) -> float:
    """Give how far a point is from a pose, m."""
    return math.hypot(x - pose.x, y - pose.y)


def moved(start: Pose2, end: Pose2) -> float:
    """Give the way from one pose to another, m."""
    return math.hypot(end.x - start.x, end.y - start.y)


# Section from navigation.pushing.
# When a robot gets nowhere: it pushes against what it does not see, or just stands.

STUCK_AFTER = 3.0  # m that a robot was told to go while it stayed where it is
_STAYS = 0.1  # m
_TURNS = 0.3  # rad
STOOD_FOR: Final = 60.0  # s


class StuckDetector:
    """Compares where a robot is with how far it was told to go."""

    def __init__(self) -> None:
        self._since: Observation | None = None
        self._last = 0.0
        self._told = 0.0

    def check(self, observation: Observation, twist: Twist) -> None:
        """Take in a scan, and what was decided by it.

        Raises:
            NavigationError: If it stays where it is.
        """
        passed, self._last = observation.time - self._last, observation.time
        if self._since is None or moved(self._since.pose, observation.pose) > _STAYS:
            self._since, self._told = observation, 0.0
        else:
            self._told += abs(twist.speed) * passed
        if self._told > STUCK_AFTER:
            pose = self._since.pose
            raise NavigationError(
                f"the robot stays at {pose.x:.2f} {pose.y:.2f}, told to go"
                f" {STUCK_AFTER:g} m; perhaps something is nearer than it is seen,"
                " and the safety distance too small"
            )


class StandstillDetector:
    """Notices that a robot neither goes nor turns any more, whatever the reason."""

    def __init__(self) -> None:
        self._since: Observation | None = None

    def check(self, observation: Observation) -> None:
        """Take in a scan.

        Raises:
            NavigationError: If it has stood for a minute.
        """
        since = self._since
        if since is None or _has_moved(since.pose, observation.pose):
            self._since = observation
        elif observation.time - since.time > STOOD_FOR:
            pose = observation.pose
            raise NavigationError(
                f"the robot has stood at {pose.x:.2f} {pose.y:.2f} for {STOOD_FOR:g} s:"
                " on all sides something is nearer than the safety distance"
            )


def _has_moved(before: Pose2, now: Pose2) -> bool:
    turned = abs(wrap_angle(now.yaw - before.yaw))
    return moved(before, now) > _STAYS or turned > _TURNS


# Section from navigation.helm.
# Scans in, wheel speeds out, and a robot that is stopped when in doubt.
#
# Where scans stay away the robot is stopped first, and given up a little later with a
# word on what was missing.

STOP_AFTER = 0.5  # s without a scan after which the robot is stopped


def check_beams(count: int, scanner: ScannerInfo) -> None:
    """Refuse a scan of so few beams that some bumper may see nothing.

    Args:
        count: How many it has.
        scanner: That it is of.

    Raises:
        ClientError: If it has less than half of what the server told.
    """
    if count < scanner.beams / 2:
        text = f"scan of {count} ranges from {scanner.name[:80]!r}"
        raise ClientError(f"{text}, expected {scanner.beams}")


class ObservationSource(Protocol):
    """Puts reports together to what is known of the surroundings."""

    @property
    def missing(self) -> str:
        """What it waits for."""

    def take(self, report: Report) -> Observation | None:
        """Take in a report; give what is known if it completes that."""


class ControlLoop:
    """Steers one robot by what a lookout sees."""

    def __init__(
        self,
        client: Client,
        facts: RobotInfo,
        lookout: ObservationSource,
        *,
        timeout: float,
    ) -> None:
        """Get ready.

        Args:
            client: The connection; its robot is spawned.
            facts: Of the robot.
            lookout: Is shown every report.
            timeout: After so many s without a scan the run is given up.
        """
        self._client = client
        self._facts = facts
        self._lookout = lookout
        self._timeout = timeout

    def drive(self, twist: Twist) -> None:
        """Set the wheels to a motion."""
        self._client.drive(*self._facts.wheel_speeds(twist.speed, twist.turn))

    def scans(self) -> Iterator[Observation]:
        """Give what is known at every scan; stops the robot while none comes.

        Raises:
            ClientError: If none comes any more.
        """
        while True:
            yield self._next()

    def _next(self) -> Observation:
        clock = self._client.transport.time
        began, stopped = clock(), False
        came: set[str] = set()
        while (waited := clock() - began) < self._timeout:
            if waited >= STOP_AFTER and not stopped:
                self.drive(STAND)
                stopped = True
            reports = self._read((self._timeout if stopped else STOP_AFTER) - waited)
            newest = None
            for report in reports:
                newest = self._lookout.take(report) or newest
                came.add(type(report).__name__)
            if newest is not None:
                return newest
        told = f"what came: {', '.join(sorted(came))}" if came else "nothing came"
        missing = f"no {self._lookout.missing} within {self._timeout:g} s"
        raise ClientError(f"{missing}, {told}; the robot was told to stop")

    def _read(self, timeout: float) -> list[Report]:
        try:
            return self._client.read(max(timeout, 0.001))
        except ClientTimeout:
            return []
