"""Bug1 and Bug2: to the goal in a straight line, and along what is in the way.

A ``Bug`` is asked at every scan how to move. It goes for the goal until the bumper in
that direction is pressed, turns until the boundary is abeam, and follows it as long as
``circling`` says. What is beyond the goal is not in the way.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from radarsim.geometry import Pose2
from radarsim.navigation.boundary_policy import (
    BoundaryPolicy,
    Bug1Policy,
    Bug2Policy,
    Decision,
    Landmark,
    Step,
)
from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.control import (
    STAND,
    SpeedLimits,
    Twist,
    bearing_of,
    distance,
    moved,
)
from radarsim.navigation.observation import Observation
from radarsim.navigation.options import Algorithm, GiveUp
from radarsim.navigation.wall_following import FollowMode, WallFollower

TOLERANCE = 0.1  # m; as near as that is there
GRAZE = 0.1  # m beyond the safety distance; what is nearer beside the way is in it
NOISE = 0.1  # m that a goal may seem nearer to a wall than the safety distance
_LOST = 1.5  # circles without a boundary after which it is taken to be gone

Point = tuple[float, float]


class Activity(StrEnum):
    """What a bug is at."""

    GOING = "going"
    ALIGNING = "aligning"
    FOLLOWING = "following"
    RETURNING = "returning"
    REACHED = "reached"
    NO_PATH = "no_path"


@dataclass(frozen=True, slots=True, kw_only=True)
class BugSettings:
    """How a bug goes about it.

    Attributes:
        algorithm: Bug1 or Bug2.
        bumpers: What it senses by.
        speed_limits: How fast it goes.
        wall_on_left: Whether it keeps boundaries on its left hand.
        give_up: When Bug2 says that there is no path.
        tolerance: How near the goal is there, m.
    """

    algorithm: Algorithm
    bumpers: Bumpers
    speed_limits: SpeedLimits = field(default_factory=SpeedLimits)
    wall_on_left: bool = True
    give_up: GiveUp = GiveUp.HIT_POINT
    tolerance: float = TOLERANCE


class Bug:
    """Goes to one goal after the other.

    Attributes:
        activity: What it is at; after ``REACHED`` and ``NO_PATH`` it stands.
        goals: Those that are left, the next one first.
        hit_points: Where it met obstacles.
        leave_points: Where it left them.
        circuits: How often it went all round an obstacle.
    """

    def __init__(self, goals: Sequence[Point], settings: BugSettings) -> None:
        if not goals:
            raise ValueError("no goals, expected at least one")
        self.activity = Activity.GOING
        self.goals = list(goals)
        self.hit_points: list[Point] = []
        self.leave_points: list[Point] = []
        self.circuits = 0
        self._settings = settings
        self._follower = WallFollower(settings.bumpers, settings.speed_limits)
        self._first_way = FollowMode(wall_on_left=settings.wall_on_left)
        self._way = self._first_way
        self._circling: BoundaryPolicy | None = None
        self._start: Pose2 | None = None
        self._before: Pose2 | None = None
        self._lost = 0.0
        self._best_leave = math.inf
        self._leaving = False  # whether it is still beside what it has left
        self._seen_from = math.inf  # m; how near the goal was when last seen

    @property
    def is_done(self) -> bool:
        """Whether it has reached its last goal, or given up."""
        return self.activity in (Activity.REACHED, Activity.NO_PATH)

    def step(self, observation: Observation) -> Twist:
        """Take in a scan and decide how to move until the next."""
        step = 0.0 if self._before is None else moved(self._before, observation.pose)
        self._before = observation.pose
        if self._start is None:
            self._start = observation.pose
        while not self.is_done and self._is_there(observation.pose):
            self._reach(observation.pose)
        if self.is_done:
            return STAND
        if self._circling is None:
            if self._is_free(observation) and not self._is_grazed(observation):
                return self._go(observation)
            self._hit(observation)
        if self.activity is Activity.ALIGNING:
            return self._align(observation)
        return self._follow(observation, step)

    def _is_there(self, pose: Pose2) -> bool:
        return distance(pose, *self.goals[0]) <= self._settings.tolerance

    def _reach(self, pose: Pose2) -> None:
        self.goals.pop(0)
        self._start, self._circling = pose, None
        self._best_leave = self._seen_from = math.inf
        self.activity = Activity.GOING if self.goals else Activity.REACHED

    def _is_free(self, observation: Observation) -> bool:
        """Tell whether nothing before the goal is in the way to it."""
        bumpers, pose = self._settings.bumpers, observation.pose
        ahead = bumpers.towards(observation, bearing_of(pose, *self.goals[0]))
        return not ahead.blocked or self._is_beyond(observation, ahead.distance)

    def _is_faced(self, observation: Observation) -> bool:
        """Tell whether the boundary that is followed is before the goal."""
        goal = bearing_of(observation.pose, *self.goals[0])
        ahead = self._settings.bumpers.towards(observation, goal)
        if self._is_beyond(observation, ahead.distance):
            return False
        return self._follower.faces(observation, self._way, goal)

    def _is_beyond(self, observation: Observation, obstacle: float) -> bool:
        """Tell whether the goal comes before an obstacle in its direction."""
        goal = distance(observation.pose, *self.goals[0])
        return goal + self._settings.bumpers.safety_distance - NOISE <= obstacle

    def _is_grazed(self, observation: Observation) -> bool:
        """Tell whether something beside the way is too near to go on."""
        bumpers, pose = self._settings.bumpers, observation.pose
        goal = bearing_of(pose, *self.goals[0])
        sides = (goal - bumpers.width, goal + bumpers.width)
        near = min(bumpers.towards(observation, side).distance for side in sides)
        self._leaving &= near < bumpers.safety_distance + GRAZE
        # who has followed a boundary into a gap may go on in it
        return near < bumpers.safety_distance + (0.0 if self._leaving else GRAZE)

    def _go(self, observation: Observation) -> Twist:
        left = distance(observation.pose, *self.goals[0])
        bearing = bearing_of(observation.pose, *self.goals[0])
        return self._settings.speed_limits.towards(bearing, most=0.05 + 0.8 * left)

    def _hit(self, observation: Observation) -> None:
        pose = observation.pose
        self.hit_points.append((pose.x, pose.y))
        self.activity, self._way, self._lost = Activity.ALIGNING, self._first_way, 0.0
        reach = self._follower.wanted
        obstacle = bearing_of(pose, *self.goals[0])
        direction = self._follower.direction(observation, self._way, obstacle)
        hit = Landmark(pose, direction, reach=reach)
        if self._settings.algorithm == Algorithm.BUG1:
            self._circling = Bug1Policy(hit, self.goals[0], reach)
        else:
            assert self._start is not None
            line = (self._start, self.goals[0])
            self._circling = Bug2Policy(hit, line, self._settings.give_up, reach)

    def _align(self, observation: Observation) -> Twist:
        obstacle = bearing_of(observation.pose, *self.goals[0])
        twist, aligned = self._follower.align(observation, self._way, obstacle)
        self.activity = Activity.FOLLOWING if aligned else Activity.ALIGNING
        return twist

    def _follow(self, observation: Observation, step: float) -> Twist:
        assert self._circling is not None
        if self._sees_goal(observation):
            self._seen_from = distance(observation.pose, *self.goals[0])
            return self._leave(observation)
        direction = self._follower.tangent(observation, self._way)
        before = self._circling.circuits
        free = not self._is_faced(observation)
        verdict = self._circling.step(Step(observation.pose, step, direction, free))
        self.circuits += self._circling.circuits - before
        if verdict is Decision.NO_PATH or (
            verdict is Decision.LEAVE
            and not self._circling.missed
            and self._is_no_nearer(observation.pose)
        ):
            self.activity = Activity.NO_PATH
            return STAND
        if verdict is Decision.LEAVE:
            return self._leave(observation)
        if verdict is Decision.BACK:
            self._way = self._way.reversed
        if self._circling.circuits:
            self.activity = Activity.RETURNING
        return self._along(observation, step)

    def _along(self, observation: Observation, step: float) -> Twist:
        twist, found = self._follower.step(observation, self._way)
        self._lost = 0.0 if found else self._lost + step
        if self._lost > _LOST * 2 * math.pi * self._follower.wanted:
            return self._leave(observation)
        return twist

    def _sees_goal(self, observation: Observation) -> bool:
        """Tell whether the goal is so near that no boundary is needed any more.

        Who has hit something again on the way there has to come nearer before the next
        try, or it would try for ever where the goal is too near to something.
        """
        bumpers = self._settings.bumpers
        near = distance(observation.pose, *self.goals[0])
        if near > min(bumpers.pressed_below, self._seen_from - bumpers.band / 2):
            return False
        return self._is_free(observation) and not self._is_grazed(observation)

    def _is_no_nearer(self, pose: Pose2) -> bool:
        """Tell whether a whole circuit of Bug1 has brought it no nearer to the goal."""
        near = distance(pose, *self.goals[0])
        stays = near > self._best_leave - self._settings.tolerance
        self._best_leave = min(self._best_leave, near)
        return stays and self._settings.algorithm == Algorithm.BUG1

    def _leave(self, observation: Observation) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self.activity, self._circling, self._leaving = Activity.GOING, None, True
        return self._go(observation)
