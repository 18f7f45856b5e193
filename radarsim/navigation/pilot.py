"""A client that drives a robot by what a bug decides, and stops it when in doubt.

Every scan of one scanner, together with the newest pose, is shown to the bug; what it
wants goes out as a DRIVE command. Where scans stay away the robot is stopped first, and
given up a little later with a word on what was missing.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from radarsim.client import Client, RobotFacts, ScannerFacts, beam_angles
from radarsim.client.facts import same_name
from radarsim.errors import ClientError, ClientTimeout
from radarsim.geometry import Pose2
from radarsim.navigation.bug import Bug, Doing, Point
from radarsim.navigation.bumpers import Bumpers, pressed_names
from radarsim.navigation.choices import PoseSource
from radarsim.navigation.following import moved
from radarsim.navigation.motion import STAND, Motion
from radarsim.navigation.pushing import Push
from radarsim.navigation.sensed import Sensed, from_centre
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)

STOP_AFTER = 0.5  # s without a scan after which the robot is stopped


@dataclass(frozen=True, slots=True)
class Moment:
    """One scan, and what the bug made of it.

    Attributes:
        sensed: What was known.
        doing: What the bug is at.
        motion: What it wants.
        pressed: The names of the bumpers that are pressed or too near.
        goal: The next one; None once there is none.
    """

    sensed: Sensed
    doing: Doing
    motion: Motion
    pressed: tuple[str, ...]
    goal: Point | None


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended, by what the robot itself knows.

    Attributes:
        outcome: ``reached``, ``no_path``, or ``failed`` when the time was up.
        path_length: m, by the poses that it was steered by.
        time: s of the server, from the first scan to the last; of the link if by its
            clock more has passed, since some servers' time stamps stand still.
        hits: Hit points, map frame, m.
        leaves: Leave points.
        circuits: How often it went all round an obstacle.
        nearest: The smallest range from the robot's centre, m; ``inf`` for none.
        goals_left: How many goals it has not reached.
        safety_distance: That was kept, m.
    """

    outcome: str
    path_length: float
    time: float
    hits: tuple[Point, ...]
    leaves: tuple[Point, ...]
    circuits: int
    nearest: float
    goals_left: int
    safety_distance: float


class Eyes:
    """Puts scans and poses together as they come in."""

    def __init__(
        self, scanner: ScannerFacts, source: PoseSource, clock: Callable[[], float]
    ) -> None:
        """Begin.

        Args:
            scanner: Whose scans are wanted.
            source: Where poses come from.
            clock: Gives s; times all scans if the first one has no time stamp.
        """
        self._scanner = scanner
        self._source = source
        self._clock = clock
        self._is_stamped: bool | None = None
        self._pose: Pose2 | None = None
        self._spawned: Pose2 | None = None
        self.missing = f"pose from {source.value}"

    def take(self, report: Report) -> Sensed | None:
        """Take in a report; give what is known if it completes that.

        Raises:
            ClientError: If a scan has so few beams that some bumper may see nothing.
        """
        if isinstance(report, RangeScan):
            if self._pose is None or not same_name(report.name, self._scanner.name):
                return None
            return self._sensed(report, self._pose)
        self._take_pose(report)
        return None

    def _take_pose(self, report: Report) -> None:
        pose: Pose2 | None = None
        if isinstance(report, Ins | GroundTruth):
            level = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
            self._spawned = self._spawned or level
            wanted = Ins if self._source == PoseSource.INS else GroundTruth
            pose = level if isinstance(report, wanted) else None
        elif isinstance(report, Odometry) and self._spawned is not None:
            pose = _after(self._spawned, report.pose)
        if pose is None or isinstance(report, Odometry) != self._by_wheels:
            return
        self._pose = pose
        self.missing = f"scan of {self._scanner.name!r}"

    @property
    def _by_wheels(self) -> bool:
        return self._source == PoseSource.ODOMETRY

    def _sensed(self, report: RangeScan, pose: Pose2) -> Sensed:
        scanner, count = self._scanner, len(report.ranges)
        if count < scanner.beams / 2:
            text = f"scan of {count} ranges from {scanner.name[:80]!r}"
            raise ClientError(f"{text}, expected {scanner.beams}")
        bearings, ranges = from_centre(
            report.ranges, beam_angles(report), scanner.mount, scanner.max_range
        )
        return Sensed(self._time_of(report), pose, bearings, ranges)

    def _time_of(self, scan: RangeScan) -> float:
        if self._is_stamped is None:
            self._is_stamped = math.isfinite(scan.time)
        return scan.time if self._is_stamped else self._clock()


class Pilot:
    """Drives one robot.

    Attributes:
        client: The connection; its robot is spawned.
        facts: Of the robot.
    """

    def __init__(
        self,
        client: Client,
        facts: RobotFacts,
        scanner: ScannerFacts,
        *,
        source: PoseSource = PoseSource.INS,
        timeout: float = 2.0,
    ) -> None:
        """Get ready.

        Args:
            client: The connection; its robot is spawned.
            facts: Of the robot.
            scanner: The one to steer by.
            source: Where poses come from.
            timeout: After so many s without a scan the run is given up.
        """
        self.client = client
        self.facts = facts
        self._eyes = Eyes(scanner, source, client.link.time)
        self._timeout = timeout

    def run(
        self,
        bug: Bug,
        bumpers: Bumpers,
        *,
        time_limit: float = math.inf,
        observe: Callable[[Moment], None] = lambda _: None,
    ) -> Result:
        """Drive until the bug is done, and leave the robot standing.

        Args:
            bug: What decides.
            bumpers: What the observer is told the state of.
            time_limit: s, as the result's time is counted.
            observe: Called at every scan.

        Raises:
            ClientError: If the server says no more what is needed; the robot has been
                told to stop if the connection still stood.
            NavigationError: If the robot does not move though it is told to.
        """
        clock = self.client.link.time
        tally, push = _Tally(clock), Push(clock)
        try:
            for sensed in self._scans():
                motion = bug.step(sensed)
                tally.add(sensed)
                goal = bug.goals[0] if bug.goals else None
                pressed = pressed_names(bumpers.read(sensed))
                observe(Moment(sensed, bug.doing, motion, pressed, goal))
                if bug.is_done or tally.time > time_limit:
                    break
                push.check(sensed, motion)
                self._drive(motion)
        finally:
            self.client.stop()
        return tally.result(bug, bumpers)

    def _drive(self, motion: Motion) -> None:
        self.client.drive(*self.facts.wheel_speeds(motion.speed, motion.turn))

    def _scans(self) -> Iterator[Sensed]:
        """Give what is known at every scan; stops the robot while none comes."""
        while True:
            yield self._next()

    def _next(self) -> Sensed:
        clock = self.client.link.time
        began, stopped = clock(), False
        came: set[str] = set()
        while (waited := clock() - began) < self._timeout:
            if waited >= STOP_AFTER and not stopped:
                self._drive(STAND)
                stopped = True
            reports = self._read((self._timeout if stopped else STOP_AFTER) - waited)
            newest = None
            for report in reports:
                newest = self._eyes.take(report) or newest
                came.add(type(report).__name__)
            if newest is not None:
                return newest
        told = f"what came: {', '.join(sorted(came))}" if came else "nothing came"
        missing = f"no {self._eyes.missing} within {self._timeout:g} s"
        raise ClientError(f"{missing}, {told}; the robot was told to stop")

    def _read(self, timeout: float) -> list[Report]:
        try:
            return self.client.read(max(timeout, 0.001))
        except ClientTimeout:
            return []


class _Tally:
    """Adds up what a run tells of itself."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.length = 0.0
        self.nearest = math.inf
        self.time = 0.0  # s since the first scan
        self._clock = clock
        self._began = 0.0
        self._first: Sensed | None = None
        self._last: Sensed | None = None

    def add(self, sensed: Sensed) -> None:
        if self._first is None:
            self._first, self._began = sensed, self._clock()
        by_stamps = sensed.time - self._first.time
        self.time = max(self.time, by_stamps, self._clock() - self._began)
        if self._last is not None:
            self.length += moved(self._last.pose, sensed.pose)
        self._last = sensed
        if len(sensed.ranges):
            self.nearest = min(self.nearest, float(sensed.ranges.min()))

    def result(self, bug: Bug, bumpers: Bumpers) -> Result:
        return Result(
            outcome=bug.doing.value if bug.is_done else "failed",
            path_length=self.length,
            time=self.time,
            hits=tuple(bug.hits),
            leaves=tuple(bug.leaves),
            circuits=bug.circuits,
            nearest=self.nearest,
            goals_left=len(bug.goals),
            safety_distance=bumpers.safety_distance,
        )


def _after(start: Pose2, motion: Pose2) -> Pose2:
    """Give where a motion, told from a start, leads on the map."""
    c, s = math.cos(start.yaw), math.sin(start.yaw)
    x = start.x + c * motion.x - s * motion.y
    y = start.y + s * motion.x + c * motion.y
    return Pose2(x, y, start.yaw + motion.yaw)
