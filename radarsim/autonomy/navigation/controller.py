"""Base class of the navigation algorithms: drive to goals in order, scan by scan.

A ``Controller`` returns for each scan the robot's motion until the next scan. Each
algorithm is a subclass.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import (
    STOP,
    SpeedLimits,
    Twist,
    bearing_of,
    distance,
)
from radarsim.autonomy.navigation.footprint_planning import Footprint
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.open_directions import leads_too_near
from radarsim.autonomy.plans import Mission
from radarsim.geometry import Floats, Point, Pose2, wrap_angle

HEADING_TOLERANCE: Final = 0.05  # rad of heading error that counts as aligned


class Activity(StrEnum):
    """What a controller currently does."""

    GOING = "going"
    ALIGNING = "aligning"
    FOLLOWING = "following"
    RETURNING = "returning"
    TURNING = "turning"  # to the requested heading at the last goal
    REACHED = "reached"
    NO_PATH = "no_path"


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """The settings of a navigation algorithm.

    Attributes:
        mission: The mission, with at least one goal.
        bumpers: The bumpers that the controller steers by.
        speed_limits: Highest speeds.
        footprint: The footprint that planned paths have to fit where the safety
            distance is not kept; None to keep the safety distance everywhere.
    """

    mission: Mission
    bumpers: Bumpers
    speed_limits: SpeedLimits = field(default_factory=SpeedLimits)
    footprint: Footprint | None = None


class Controller(ABC):
    """Base class of algorithms that drive a robot to its goals, one after the other.

    Attributes:
        activity: Current activity; in ``REACHED`` and ``NO_PATH`` the robot stands.
        goals: The remaining goals, the next one first, m, map frame.
        hit_points: Positions where the robot turned to boundaries, m, map frame.
        leave_points: Positions where the robot left boundaries, m, map frame.
        circuits: Number of complete circuits around obstacles.
    """

    def __init__(self, settings: ControllerSettings) -> None:
        """Create the controller; call this before the first scan."""
        self.activity = Activity.GOING
        self.goals = list(settings.mission.goals)
        if not self.goals:
            raise ValueError("no goals, expected at least one")
        self.hit_points: list[Point] = []
        self.leave_points: list[Point] = []
        self.circuits = 0
        self._settings = settings
        self._previous: Pose2 | None = None

    @property
    def goal(self) -> Point | None:
        """The next goal, m, map frame; None if no goal is left."""
        return self.goals[0] if self.goals else None

    @property
    def is_done(self) -> bool:
        """Whether the robot has reached its last goal, or has given up."""
        return self.activity in (Activity.REACHED, Activity.NO_PATH)

    def step(self, observation: Observation) -> Twist:
        """Return the motion of the robot until the next scan."""
        pose = observation.pose
        driven = 0.0 if self._previous is None else pose.distance(self._previous)
        self._previous = pose
        # One pose may be within the tolerance of several goals.
        while not self.is_done and self._is_at_goal(pose):
            if turn := self._turn_to_go(pose):
                self.activity = Activity.TURNING
                return self._settings.speed_limits.towards(turn, most=0.0)
            self.goals.pop(0)
            self._begin_goal(pose)
            self.activity = Activity.GOING if self.goals else Activity.REACHED
        return STOP if self.is_done else self._decide(observation, driven)

    def reconsider(self, pose: Pose2, _: Callable[[Observation], Observation]) -> None:
        """Search for the goal again, since some obstacles that were seen do not exist.

        Args:
            pose: Pose of the robot.
            _: Corrects the pose of an earlier scan, for controllers that store scans.
        """
        if self.is_done:
            return
        if self.activity not in (Activity.GOING, Activity.TURNING):
            self.leave_points.append((pose.x, pose.y))
        self._begin_goal(pose)
        self.activity = Activity.GOING

    def avoid(self, places: Floats) -> bool:  # noqa: ARG002 - planners need it
        """Drive around an approaching object; return False if the controller cannot.

        If it returns False, the robot waits.

        Args:
            places: Positions of the object now and soon, (M, 2) m, map frame; M is 0
                if nothing approaches.
        """
        return False

    def _is_at_goal(self, pose: Pose2) -> bool:
        # A turn at the goal is completed even if the estimated position drifts away.
        if self.activity is Activity.TURNING:
            return True
        return self._goal_distance(pose) <= self._settings.mission.tolerance

    def _turn_to_go(self, pose: Pose2) -> float:
        """Return the angle, rad, that the robot still has to turn at the last goal."""
        heading = self._settings.mission.heading
        if heading is None or len(self.goals) > 1:
            return 0.0
        error = wrap_angle(heading - pose.yaw)
        return error if abs(error) > HEADING_TOLERANCE else 0.0

    def _goal_distance(self, pose: Pose2) -> float:
        return distance(pose, *self.goals[0])

    def _goal_bearing(self, pose: Pose2) -> float:
        return bearing_of(pose, *self.goals[0])

    def _towards(self, pose: Pose2, point: Point) -> Twist:
        """Return the twist towards a point, m; it is slower near the goal."""
        # At the goal the speed limit is 5 cm/s: with a
        # limit of 0 the robot would never get there.
        most = 0.05 + 0.8 * self._goal_distance(pose)
        return self._settings.speed_limits.towards(bearing_of(pose, *point), most=most)

    def _head_for(self, observation: Observation, point: Point) -> Twist:
        """Return the twist towards a point; the speed is 0 if an obstacle is near."""
        twist = self._towards(observation.pose, point)
        safety_distance = self._settings.bumpers.safety_distance
        is_near = leads_too_near(observation, safety_distance)
        return Twist(0.0, twist.turn) if is_near else twist

    @abstractmethod
    def _begin_goal(self, pose: Pose2) -> None:
        """Reset the state of the algorithm before the robot heads for the next goal."""

    @abstractmethod
    def _decide(self, observation: Observation, driven: float) -> Twist:
        """Return the motion of the robot until the next scan.

        Args:
            observation: The newest scan; the next goal is not reached.
            driven: Distance from the pose of the previous scan, m.
        """
