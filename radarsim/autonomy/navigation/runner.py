"""Drive a robot by the decisions of a controller, and stop it after errors.

Every scan of one scanner is passed to the controller together with the newest pose. The
motion that the controller returns is sent as a DRIVE command.

The navigator raises an error if the start or a goal is within the safety distance of an
obstacle.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.autonomy.navigation.bumpers import Bumpers, pressed_names
from radarsim.autonomy.navigation.control import (
    STOP,
    ControlLoop,
    StuckDetector,
    Twist,
    distance,
)
from radarsim.autonomy.navigation.controller import Activity, Controller
from radarsim.autonomy.navigation.hidden_obstacles import (
    TouchMemory,
    TransientObstacles,
)
from radarsim.autonomy.navigation.moving_things import Waiting
from radarsim.autonomy.navigation.observation import Observation, ObservationBuilder
from radarsim.autonomy.plans import Mission
from radarsim.client import Client, RobotInfo
from radarsim.errors import TooNearError
from radarsim.geometry import Point, Pose2

START_NOISE: Final = 0.05  # m; noise of the distance of obstacles at the start
GOAL_NOISE: Final = 0.1  # m; noise of the distance of obstacles at the goal
DRIFT: Final = 0.005  # m of goal position error for each m of path
GOAL_IN_SIGHT: Final = 1.5  # m; goals within this distance are checked
STANDING_AFTER: Final = 4.0  # s; an obstacle stands if it stays this long
_PLACE: Final = 0.15  # m between two sightings of the same obstacle


def least_clearance(safety_distance: float, travelled: float = 0.0) -> float:
    """Return the distance of a goal from obstacles, m, below which the robot gives up.

    Args:
        safety_distance: m.
        travelled: Length of the path to the goal so far, m.
    """
    # Noise and drift make the goal's distance from obstacles uncertain.
    unsure = min(GOAL_NOISE + DRIFT * travelled, safety_distance / 2)
    return safety_distance - unsure


class TripMeter:
    """Measures the time and the path length of a run, scan by scan.

    Attributes:
        start: Pose at the first scan; None before it.
        time: Time from the first scan to the last, s.
        length: Length of the estimated path, m.
    """

    def __init__(self, *, noise: float = 0.0) -> None:
        """Create a meter at time 0 and path length 0.

        Args:
            noise: Distance within which a robot counts as standing, m.
        """
        self.start: Pose2 | None = None
        self.time = 0.0
        self.length = 0.0
        self._noise = noise
        self._start_time = 0.0
        self._last = Pose2(0.0, 0.0)

    def add(self, observation: Observation) -> None:
        """Add a scan to the time and the path length."""
        if self.start is None:
            self.start = self._last = observation.pose
            self._start_time = observation.time
        self.time = observation.time - self._start_time
        step = observation.pose.distance(self._last)
        # Small steps are ignored, since noise would
        # lengthen the path of a standing robot.
        if step > self._noise:
            self.length += step
            self._last = observation.pose


class ClearanceCheck:
    """Checks that no obstacle is too close to the start or to the next goal.

    Attributes:
        trip: Time and path length so far.
    """

    def __init__(self, bumpers: Bumpers) -> None:
        self.trip = TripMeter()
        self._bumpers = bumpers
        self._place = (math.inf, math.inf)  # obstacle near the goal, m, map frame
        self._since = 0.0  # s; when the obstacle was first seen there

    def check(self, observation: Observation, goal: Point | None) -> None:
        """Check one scan for obstacles at the start or at the next goal.

        Args:
            observation: The scan.
            goal: The next goal, m, map frame; None without one.

        Raises:
            TooNearError: If an obstacle is closer to the start than the safety
                distance, or stands that close to the goal.
        """
        is_first = self.trip.start is None
        self.trip.add(observation)
        if is_first:
            nearest = min(each.distance for each in self._bumpers.read(observation))
            if nearest < self._bumpers.safety_distance - START_NOISE:
                place = (observation.pose.x, observation.pose.y)
                self._raise("start", place, nearest)
        # An obstacle that is seen only from far away may be an image in a mirror.
        if goal is not None and distance(observation.pose, *goal) <= GOAL_IN_SIGHT:
            self._check_goal(observation, goal)

    def _check_goal(self, observation: Observation, goal: Point) -> None:
        points = observation.points()
        distances = np.hypot(*(points - goal).T)
        safety_distance = self._bumpers.safety_distance
        near = distances < least_clearance(safety_distance, self.trip.length)
        if not near.any():
            self._place = (math.inf, math.inf)
            return
        # The nearest obstacle has moved or is another one, so the time starts again.
        if np.hypot(*(points[near] - self._place).T).min() > _PLACE:
            x, y = points[distances.argmin()].tolist()
            self._place, self._since = (x, y), observation.time
        if observation.time - self._since >= STANDING_AFTER:
            self._raise("goal", goal, float(distances.min()))

    def _raise(self, what: str, place: Point, distance: float) -> None:
        least = self._bumpers.safety_distance
        raise TooNearError(
            f"{what} {place[0]:.2f} {place[1]:.2f} is {distance:.2f} m from an"
            f" obstacle, expected at least the safety distance, {least:g} m"
        )


@dataclass(frozen=True, slots=True)
class NavigationStep:
    """One scan of a run, and what the controller decided to do.

    Attributes:
        observation: The scan and the pose.
        activity: Current activity of the controller.
        twist: The motion that the controller decided on.
        pressed: Names of the bumpers that are pressed or too near.
        goal: The next goal; None after the last one.
    """

    observation: Observation
    activity: Activity
    twist: Twist
    pressed: tuple[str, ...]
    goal: Point | None


@dataclass(frozen=True, slots=True)
class Result:
    """The outcome of a run, as the robot itself has measured it.

    Attributes:
        outcome: ``reached``, ``no_path``, or ``failed`` after the time limit.
        path_length: Length of the estimated path, m.
        time: Server time from the first scan to the last, s; by the transport's clock
            if the server's time stamps do not advance.
        circuits: Number of complete circuits around obstacles.
        goals_left: Number of goals that were not reached.
        safety_distance: The safety distance of the robot, m.
    """

    outcome: str
    path_length: float
    time: float
    circuits: int
    goals_left: int
    safety_distance: float


class Navigator:
    """Drives one robot as a controller decides."""

    def __init__(
        self,
        client: Client,
        robot_info: RobotInfo,
        source: ObservationBuilder,
        controller: Controller,
        bumpers: Bumpers,
    ) -> None:
        """Create a navigator.

        Args:
            client: The connection, with a spawned robot.
            robot_info: Properties of the robot.
            source: Turns the reports of the robot into observations.
            controller: Decides how the robot moves.
            bumpers: The bumpers whose state the observer receives.
        """
        self._client = client
        self._robot = robot_info
        self._source = source
        self._controller = controller
        self._bumpers = bumpers
        self._twist = STOP
        self._clearance = ClearanceCheck(bumpers)
        self._waiting = Waiting(bumpers, robot_info.clearance)
        self._transient = TransientObstacles()
        self._touches = TouchMemory(
            robot_info.length, robot_info.width, bumpers.safety_distance
        )

    def run(
        self, mission: Mission, observe: Callable[[NavigationStep], None]
    ) -> Result:
        """Drive until the controller is done, and stop the robot.

        Args:
            mission: The mission, with its time limits and whether to return to the
                start.
            observe: Called at every scan, after the motion command.

        Raises:
            ClientError: If the server stops sending required reports; the robot has
                been stopped if the connection was still open.
            NavigationError: If the robot does not move although it is commanded to, or
                if the start or a goal is within the safety distance of an obstacle.
        """
        loop = ControlLoop(
            self._client, self._robot, self._source, timeout=mission.timeout
        )
        controller, bumpers = self._controller, self._bumpers
        trip, stuck_detector = self._clearance.trip, StuckDetector()
        try:
            for scan in loop.scans():
                if mission.return_to_start and trip.start is None:
                    controller.goals.append((scan.pose.x, scan.pose.y))
                observation = self._decide(scan)
                is_over = controller.is_done or trip.time > mission.time_limit
                if not is_over:
                    loop.drive(self._twist)  # first, since ``observe`` may be slow
                pressed = pressed_names(bumpers.read(observation))
                activity, goal = controller.activity, controller.goal
                observe(
                    NavigationStep(observation, activity, self._twist, pressed, goal)
                )
                if is_over:
                    break
                stuck_detector.check(observation, self._twist)
        finally:
            # Robots keep their wheel speeds until the next
            # command, so an error must stop the robot, too.
            self._client.stop()
        return Result(
            outcome=controller.activity.value if controller.is_done else "failed",
            path_length=trip.length,
            time=trip.time,
            circuits=controller.circuits,
            goals_left=len(controller.goals),
            safety_distance=bumpers.safety_distance,
        )

    def _decide(self, scan: Observation) -> Observation:
        """Decide how to move until the next scan; return the scan that was used."""
        controller, touches, waiting = self._controller, self._touches, self._waiting
        has_jumped = self._source.pop_jump()
        if touches.notice(scan, self._twist) or has_jumped:
            controller.reconsider(scan.pose, self._corrected)
        observation = touches.places.hide(self._transient.add_to(scan))
        self._clearance.check(observation, controller.goal)
        # ``has_to_wait`` compares successive scans, so it is called at every scan.
        has_to_wait = waiting.has_to_wait(
            observation, self._twist, observation.ranges < scan.ranges
        )
        goes_round = controller.avoid(waiting.meeting(observation))
        waits = has_to_wait and not goes_round
        # A motion away from a touched obstacle overrides the path to the goal.
        away = touches.retreat(observation) or waiting.back_off(observation)
        if away is not None:
            self._twist = away
        elif waits:
            # The controller is not called, so it does
            # not treat a passing object as an obstacle.
            self._twist = STOP
        else:
            self._twist = touches.keep_off(observation, controller.step(observation))
        is_own = away is None and not waits
        touches.note_decision(scan, self._twist if is_own else None)
        return observation

    def _corrected(self, earlier: Observation) -> Observation:
        return self._touches.places.hide(self._source.corrected(earlier))
