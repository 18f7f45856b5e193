"""How far a robot has come, and for how long."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from radarsim.client import Client, RobotInfo, ScannerInfo, beam_angles
from radarsim.client.robot_info import same_name
from radarsim.geometry import Pose2
from radarsim.navigation.bug import Activity, Bug, Point
from radarsim.navigation.bumpers import Bumpers, pressed_names
from radarsim.navigation.control import (
    ControlLoop,
    StuckDetector,
    Twist,
    check_beams,
    moved,
)
from radarsim.navigation.observation import Observation, ScanClock, from_centre
from radarsim.navigation.options import PoseSource
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)


class TripMeter:
    """Adds up a run, scan by scan.

    Attributes:
        start: Where the robot was at the first scan; None before that.
        time: From the first scan to the last, s.
        length: Of the way, m.
    """

    def __init__(self, *, noise: float = 0.0) -> None:
        """Begin.

        Args:
            noise: m; the robot has not moved as long as it is no farther away.
        """
        self.start: Pose2 | None = None
        self.time = 0.0
        self.length = 0.0
        self._noise = noise
        self._began = 0.0
        self._last = Pose2(0.0, 0.0)

    def add(self, observation: Observation) -> None:
        """Take in a scan."""
        if self.start is None:
            self.start = self._last = observation.pose
            self._began = observation.time
        self.time = observation.time - self._began
        step = moved(self._last, observation.pose)
        if step > self._noise:
            self.length += step
            self._last = observation.pose


# Section from navigation.pilot.
# A client that drives a robot by what a bug decides, and stops it when in doubt.
#
# Every scan of one scanner, together with the newest pose, is shown to the bug; what
# it
# wants goes out as a DRIVE command.


@dataclass(frozen=True, slots=True)
class NavigationStep:
    """One scan, and what the bug made of it.

    Attributes:
        observation: What was known.
        activity: What the bug is at.
        twist: What it wants.
        pressed: The names of the bumpers that are pressed or too near.
        goal: The next one; None once there is none.
    """

    observation: Observation
    activity: Activity
    twist: Twist
    pressed: tuple[str, ...]
    goal: Point | None


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended, by what the robot itself knows.

    Attributes:
        outcome: ``reached``, ``no_path``, or ``failed`` when the time was up.
        path_length: m, by the poses that it was steered by.
        time: s of the server, from the first scan to the last; by the link's clock
            where its time stamps stand still.
        hit_points: Hit points, map frame, m.
        leave_points: Leave points.
        circuits: How often it went all round an obstacle.
        nearest: The smallest range from the robot's centre, m; ``inf`` for none.
        goals_left: How many goals it has not reached.
        safety_distance: That was kept, m.
    """

    outcome: str
    path_length: float
    time: float
    hit_points: tuple[Point, ...]
    leave_points: tuple[Point, ...]
    circuits: int
    nearest: float
    goals_left: int
    safety_distance: float


class ObservationBuilder:
    """Puts scans and poses together as they come in."""

    def __init__(
        self, scanner: ScannerInfo, pose_source: PoseSource, clock: Callable[[], float]
    ) -> None:
        """Begin.

        Args:
            scanner: Whose scans are wanted.
            pose_source: Where poses come from.
            clock: Gives s, where time stamps do not.
        """
        self._scanner = scanner
        self._pose_source = pose_source
        self._stamps = ScanClock(clock)
        self._pose: Pose2 | None = None
        self._spawned: Pose2 | None = None
        self.missing = f"pose from {pose_source.value}"

    def take(self, report: Report) -> Observation | None:
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
            wanted = Ins if self._pose_source == PoseSource.INS else GroundTruth
            pose = level if isinstance(report, wanted) else None
        elif isinstance(report, Odometry) and self._spawned is not None:
            pose = self._spawned.compose(report.pose)
        if pose is None or isinstance(report, Odometry) != self._by_wheels:
            return
        self._pose = pose
        self.missing = f"scan of {self._scanner.name!r}"

    @property
    def _by_wheels(self) -> bool:
        return self._pose_source == PoseSource.ODOMETRY

    def _sensed(self, report: RangeScan, pose: Pose2) -> Observation:
        scanner = self._scanner
        check_beams(len(report.ranges), scanner)
        bearings, ranges = from_centre(
            report.ranges, beam_angles(report), scanner.mount, scanner.max_range
        )
        return Observation(self._stamps.time_of(report.time), pose, bearings, ranges)


class Navigator:
    """Drives one robot.

    Attributes:
        client: The connection; its robot is spawned.
        facts: Of the robot.
    """

    def __init__(
        self,
        client: Client,
        facts: RobotInfo,
        scanner: ScannerInfo,
        *,
        pose_source: PoseSource = PoseSource.INS,
        timeout: float = 2.0,
    ) -> None:
        """Get ready.

        Args:
            client: The connection; its robot is spawned.
            facts: Of the robot.
            scanner: The one to steer by.
            pose_source: Where poses come from.
            timeout: After so many s without a scan the run is given up.
        """
        self.client = client
        self.facts = facts
        eyes = ObservationBuilder(scanner, pose_source, client.transport.time)
        self._helm = ControlLoop(client, facts, eyes, timeout=timeout)

    def run(
        self,
        bug: Bug,
        bumpers: Bumpers,
        *,
        time_limit: float = math.inf,
        observe: Callable[[NavigationStep], None] = lambda _: None,
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
        tally, push = _Tally(), StuckDetector()
        try:
            for observation in self._helm.scans():
                twist = bug.step(observation)
                tally.add(observation)
                goal = bug.goals[0] if bug.goals else None
                pressed = pressed_names(bumpers.read(observation))
                observe(NavigationStep(observation, bug.activity, twist, pressed, goal))
                if bug.is_done or tally.trip.time > time_limit:
                    break
                push.check(observation, twist)
                self._helm.drive(twist)
        finally:
            self.client.stop()
        return tally.result(bug, bumpers)


class _Tally:
    """Adds up what a run tells of itself."""

    def __init__(self) -> None:
        self.trip = TripMeter()
        self.nearest = math.inf

    def add(self, observation: Observation) -> None:
        self.trip.add(observation)
        if len(observation.ranges):
            self.nearest = min(self.nearest, float(observation.ranges.min()))

    def result(self, bug: Bug, bumpers: Bumpers) -> Result:
        return Result(
            outcome=bug.activity.value if bug.is_done else "failed",
            path_length=self.trip.length,
            time=self.trip.time,
            hit_points=tuple(bug.hit_points),
            leave_points=tuple(bug.leave_points),
            circuits=bug.circuits,
            nearest=self.nearest,
            goals_left=len(bug.goals),
            safety_distance=bumpers.safety_distance,
        )
