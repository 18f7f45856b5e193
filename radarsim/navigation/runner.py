"""Drive a robot by the decisions of a bug, and stop it when in doubt.

Every scan of one scanner, together with the newest pose, is passed to the bug; the
motion that it decides on is sent as a DRIVE command.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

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
from radarsim.navigation.echo_ranges import (
    ECHO_WAIT,
    EchoCollector,
    blocked_ranges,
)
from radarsim.navigation.observation import Observation, ScanClock, from_centre
from radarsim.navigation.options import PoseSource
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)

POSE_REPORTS: Final[dict[PoseSource, type[Report]]] = {
    PoseSource.INS: Ins,
    PoseSource.ODOMETRY: Odometry,
    PoseSource.GROUND_TRUTH: GroundTruth,
}


class TripMeter:
    """Measures time and path length of a run, scan by scan.

    Attributes:
        start: Pose at the first scan; None before it.
        time: Time from the first scan to the last, s.
        length: Length of the estimated path, m.
    """

    def __init__(self, *, noise: float = 0.0) -> None:
        """Start at zero.

        Args:
            noise: Distance up to which a robot counts as not having moved, m.
        """
        self.start: Pose2 | None = None
        self.time = 0.0
        self.length = 0.0
        self._noise = noise
        self._start_time = 0.0
        self._last = Pose2(0.0, 0.0)

    def add(self, observation: Observation) -> None:
        """Add a scan."""
        if self.start is None:
            self.start = self._last = observation.pose
            self._start_time = observation.time
        self.time = observation.time - self._start_time
        step = moved(self._last, observation.pose)
        if step > self._noise:
            self.length += step
            self._last = observation.pose


@dataclass(frozen=True, slots=True)
class NavigationStep:
    """One scan, and what the bug decided by it.

    Attributes:
        observation: The scan and the pose.
        activity: What the bug is doing.
        twist: The motion that it decided on.
        pressed: Names of the bumpers that are pressed or too near.
        goal: The next goal; None once there is none.
    """

    observation: Observation
    activity: Activity
    twist: Twist
    pressed: tuple[str, ...]
    goal: Point | None


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended, by the robot's own measurements.

    Attributes:
        outcome: ``reached``, ``no_path``, or ``failed`` when the time was up.
        path_length: Length of the estimated path, m.
        time: Server time from the first scan to the last, s; by the transport's clock
            where the server's time stamps do not advance.
        hit_points: Hit points, m, map frame.
        leave_points: Leave points, m, map frame.
        circuits: Number of complete circuits around obstacles.
        nearest: Smallest range from the robot's centre, m; ``inf`` for none.
        goals_left: Number of goals that were not reached.
        safety_distance: The safety distance of the robot, m.
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
    """Combines scans and poses to observations as their reports arrive.

    Attributes:
        missing: The report that it waits for, for messages.
    """

    def __init__(
        self,
        scanner: ScannerInfo,
        pose_source: PoseSource,
        clock: Callable[[], float],
        *,
        echo_wait: float = 0.0,
    ) -> None:
        """Create a builder.

        Args:
            scanner: The scanner to use.
            pose_source: The sensor that poses are taken from.
            clock: Returns the time in s; used where time stamps do not advance.
            echo_wait: How long scans without echoes are left out, since their echoes
                may still come, s; 0 if the server was not asked for echoes.
        """
        self._scanner = scanner
        self._pose_report = POSE_REPORTS[pose_source]
        self._scan_clock = ScanClock(clock)
        self._pose: Pose2 | None = None
        self._start: Pose2 | None = None
        self._others: set[PoseSource] = set()  # other sources that sent poses
        self._echoes = EchoCollector()
        self._echo_wait = echo_wait
        self._echoes_due = math.nan  # until when scans wait for their echoes, s
        self.missing = f"pose from {pose_source.value}"

    @property
    def cure(self) -> str:
        """The other sources of poses, if the wanted one has sent none."""
        names = [source.value for source in PoseSource if source in self._others]
        if self._pose is not None or not names:
            return ""
        return f"expected poses from {' or '.join(names)}"

    def take(self, report: Report) -> Observation | None:
        """Process a report; return the observation that it completes, if any.

        Raises:
            ClientError: If a scan has so few beams that some bumper may see nothing.
        """
        if isinstance(report, EchoLine):
            if same_name(report.name, self._scanner.name):
                self._echoes.take(report)
            return None
        if isinstance(report, RangeScan):
            if self._pose is None or not same_name(report.name, self._scanner.name):
                return None
            return self._observation(report, self._pose)
        self._update_pose(report)
        return None

    def _update_pose(self, report: Report) -> None:
        """Update the pose; odometry counts from the first pose of any other sensor."""
        pose: Pose2 | None = None
        if isinstance(report, Ins | GroundTruth):
            pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
            self._start = self._start or pose
        elif isinstance(report, Odometry) and self._start is not None:
            pose = self._start.compose(report.pose)
        if not isinstance(report, self._pose_report):
            self._others |= {s for s, t in POSE_REPORTS.items() if type(report) is t}
        elif pose is not None:
            self._pose = pose
            self.missing = f"scan of {self._scanner.name!r}"

    def _observation(self, report: RangeScan, pose: Pose2) -> Observation | None:
        scanner = self._scanner
        check_beams(len(report.ranges), scanner)
        time = self._scan_clock.time_of(report.time)
        echoes = self._echoes.of(report)
        if echoes is not None or math.isnan(self._echoes_due):
            self._echoes_due = time + self._echo_wait
        if echoes is None and time < self._echoes_due:
            return None
        known = report.ranges
        if echoes is not None:
            known = blocked_ranges(known, echoes)
        bearings, ranges = from_centre(
            known, beam_angles(report), scanner.mount, scanner.max_range
        )
        return Observation(time, pose, bearings, ranges)


class Navigator:
    """Drives one robot."""

    def __init__(
        self,
        client: Client,
        robot_info: RobotInfo,
        scanner: ScannerInfo,
        *,
        pose_source: PoseSource = PoseSource.INS,
        timeout: float = 2.0,
        echoes: bool = True,
    ) -> None:
        """Create a navigator.

        Args:
            client: The connection; its robot is spawned.
            robot_info: Properties of the robot.
            scanner: The scanner to steer by.
            pose_source: The sensor that poses are taken from.
            timeout: Time without a scan after which the run is given up, s.
            echoes: Whether to ask the server for echoes, and to use them.
        """
        self._client = client
        if echoes:
            client.echoes(scanner.name)
        source = ObservationBuilder(
            scanner,
            pose_source,
            client.transport.time,
            echo_wait=ECHO_WAIT if echoes else 0.0,
        )
        self._loop = ControlLoop(client, robot_info, source, timeout=timeout)

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
            bug: Decides how to move.
            bumpers: The bumpers whose state the observer receives.
            time_limit: Longest run, s, by the result's time.
            observe: Called at every scan, after the robot was commanded.

        Raises:
            ClientError: If the server stops sending what is needed; the robot has been
                stopped if the connection was still open.
            NavigationError: If the robot does not move though it is commanded to.
        """
        trip, stuck_detector, nearest = TripMeter(), StuckDetector(), math.inf
        try:
            for observation in self._loop.scans():
                twist = bug.step(observation)
                trip.add(observation)
                nearest = min(nearest, float(observation.ranges.min(initial=math.inf)))
                goal = bug.goals[0] if bug.goals else None
                pressed = pressed_names(bumpers.read(observation))
                is_over = bug.is_done or trip.time > time_limit
                if not is_over:
                    self._loop.drive(twist)  # at once: who observes may take long
                observe(NavigationStep(observation, bug.activity, twist, pressed, goal))
                if is_over:
                    break
                stuck_detector.check(observation, twist)
        finally:
            self._client.stop()
        return Result(
            outcome=bug.activity.value if bug.is_done else "failed",
            path_length=trip.length,
            time=trip.time,
            hit_points=tuple(bug.hit_points),
            leave_points=tuple(bug.leave_points),
            circuits=bug.circuits,
            nearest=nearest,
            goals_left=len(bug.goals),
            safety_distance=bumpers.safety_distance,
        )
