"""Drive a robot by the decisions of a bug, and stop it when in doubt.

Every scan of one scanner, together with the newest pose, is passed to the bug; the
motion that it decides on is sent as a DRIVE command.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from radarsim.client import Client, RobotInfo, ScannerInfo
from radarsim.geometry import Pose2
from radarsim.navigation.bumpers import Bumpers, pressed_names
from radarsim.navigation.clearance_check import ClearanceCheck
from radarsim.navigation.control import (
    STOP,
    ControlLoop,
    StuckDetector,
    Twist,
    moved,
)
from radarsim.navigation.controller import Activity, Controller, Point
from radarsim.navigation.echo_ranges import ECHO_WAIT
from radarsim.navigation.moving_things import Waiting
from radarsim.navigation.observation import Observation
from radarsim.navigation.observation_builder import ObservationBuilder
from radarsim.navigation.options import PoseSource


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
        self._robot_clearance = robot_info.clearance
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
        bug: Controller,
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
            NavigationError: If the robot does not move though it is commanded to, or if
                the start or a goal is inside the safety distance of something.
        """
        trip, stuck_detector, nearest = TripMeter(), StuckDetector(), math.inf
        clearance, twist = ClearanceCheck(bumpers), STOP
        waiting = Waiting(bumpers, self._robot_clearance)
        try:
            for observation in self._loop.scans():
                clearance.check(observation, bug.goals[0] if bug.goals else None)
                has_to_wait = waiting.has_to_wait(observation, twist)
                if (away := waiting.back_off(observation)) is not None:
                    twist = away
                else:
                    twist = STOP if has_to_wait else bug.step(observation)
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
