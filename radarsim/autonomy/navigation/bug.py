"""Bug1 and Bug2: straight towards the goal, and along the boundaries of obstacles.

A ``Bug`` decides at every scan how to move. It heads for the goal until the bumper in
that direction is pressed, turns until the boundary is abeam, and follows it as long as
its boundary policy says. What is beyond the goal is no obstacle.
"""

import math
from collections.abc import Sequence

from radarsim.autonomy.navigation.algorithms import Algorithm, Rule
from radarsim.autonomy.navigation.boundary_memory import (
    FollowedObstacle,
    StandingObstacle,
)
from radarsim.autonomy.navigation.boundary_policy import (
    BoundaryPolicy,
    Bug1Policy,
    Bug2Policy,
    Decision,
    Landmark,
    Step,
)
from radarsim.autonomy.navigation.control import (
    STOP,
    Twist,
    bearing_of,
    distance,
)
from radarsim.autonomy.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import (
    BumperWallFollower,
    FollowMode,
    WallFollower,
)
from radarsim.geometry import Point, Pose2

GRAZE = 0.1  # m beyond the safety distance at which something beside blocks the path
NOISE = 0.1  # m that a goal may seem nearer to a wall than the safety distance
_MOST_GONE = 20  # obstacles that go away, before it gives up nevertheless
_MOST_OTHERS = 3  # circuits around another obstacle, likewise
_MOST_MISSES = 3  # leave points that are not found again, likewise
_LOST = 1.5  # circles without a boundary after which the boundary is given up


class Bug(Controller):
    """Bug1 or Bug2; attributes are those of ``Controller``."""

    def __init__(self, goals: Sequence[Point], settings: ControllerSettings) -> None:
        super().__init__(goals, settings)
        self._follower = WallFollower(settings.bumpers, settings.speed_limits)
        self._steering = _steering(settings.bumpers.rule, self._follower)
        self._first_mode = FollowMode(wall_on_left=settings.wall_on_left)
        self._mode = self._first_mode
        self._policy: BoundaryPolicy | None = None  # None away from boundaries
        self._starts: list[Pose2] = []  # of the lines of which Bug2 has to meet one
        self._lost = 0.0  # m driven without a boundary
        self._best_leave = math.inf  # m from the goal
        self._leaving = False  # whether it is still beside the boundary it has left
        self._seen_from = math.inf  # m; goal distance when the goal was last seen
        self._obstacle: FollowedObstacle | None = None
        self._circled = StandingObstacle()  # points of the boundary that is followed
        self._followed = 0.0  # m along it
        self._gone = 0  # number of obstacles that had gone when they were looked at
        self._hit_place: Point = (math.nan, math.nan)  # on the obstacle, m
        self._misses = 0  # number of leave points that it did not find again
        self._others = 0  # number of times that another obstacle was circled

    def _begin_goal(self, pose: Pose2) -> None:
        self._starts, self._policy = [pose], None
        self._gone = self._misses = self._others = 0
        self._first_mode = FollowMode(wall_on_left=self._settings.wall_on_left)
        self._best_leave = self._seen_from = math.inf

    def _decide(self, observation: Observation, driven: float) -> Twist:
        if not self._starts:
            self._starts = [observation.pose]
        if self._policy is None:
            if self._is_free(observation) and not self._is_grazed(observation):
                return self._go(observation)
            self._hit(observation)
        if self.activity is Activity.ALIGNING:
            return self._align(observation)
        return self._follow(observation, driven)

    def _is_free(self, observation: Observation) -> bool:
        """Return whether no obstacle is between the robot and the goal."""
        bumpers, pose = self._settings.bumpers, observation.pose
        ahead = bumpers.towards(observation, bearing_of(pose, *self.goals[0]))
        return not ahead.blocked or self._is_beyond(observation, ahead.distance)

    def _is_hidden(self, observation: Observation, obstacle: Observation) -> bool:
        """Return whether the followed boundary is between the robot and the goal."""
        goal = bearing_of(observation.pose, *self.goals[0])
        ahead = self._settings.bumpers.towards(observation, goal)
        if self._is_beyond(observation, ahead.distance):
            return False
        return self._follower.leads_into_boundary(obstacle, self._mode, goal)

    def _is_beyond(self, observation: Observation, obstacle: float) -> bool:
        """Return whether an obstacle at a distance, m, is beyond the goal."""
        goal = distance(observation.pose, *self.goals[0])
        return goal + self._settings.bumpers.safety_distance - NOISE <= obstacle

    def _is_grazed(self, observation: Observation) -> bool:
        """Return whether something beside the path to the goal is too near."""
        bumpers, pose = self._settings.bumpers, observation.pose
        goal = bearing_of(pose, *self.goals[0])
        sides = (goal - bumpers.width, goal + bumpers.width)
        near = min(bumpers.towards(observation, side).distance for side in sides)
        self._leaving &= near < bumpers.safety_distance + GRAZE
        # a robot that has followed a boundary into a gap may go on in it
        return near < bumpers.safety_distance + (0.0 if self._leaving else GRAZE)

    def _go(self, observation: Observation) -> Twist:
        left = distance(observation.pose, *self.goals[0])
        bearing = bearing_of(observation.pose, *self.goals[0])
        return self._settings.speed_limits.towards(bearing, most=0.05 + 0.8 * left)

    def _hit(self, observation: Observation) -> None:
        pose = observation.pose
        self.hit_points.append((pose.x, pose.y))
        self.activity, self._mode, self._lost = Activity.ALIGNING, self._first_mode, 0.0
        self._circled, self._followed = StandingObstacle(), 0.0
        max_offset = self._follower.target_distance
        obstacle = bearing_of(pose, *self.goals[0])
        point = self._follower.hit_point(observation, self._mode, obstacle)
        self._hit_place = point.point_from(pose)
        self._obstacle = FollowedObstacle(self._hit_place, self._follower)
        direction = self._follower.direction(observation, self._mode, obstacle)
        hit = Landmark(pose, direction, max_offset=max_offset)
        if self._settings.algorithm == Algorithm.BUG1:
            self._policy = Bug1Policy(hit, self.goals[0], max_offset)
        else:
            goal, give_up = self.goals[0], self._settings.give_up
            self._policy = Bug2Policy(hit, self._starts, goal, give_up, max_offset)

    def _align(self, observation: Observation) -> Twist:
        obstacle = bearing_of(observation.pose, *self.goals[0])
        twist, aligned = self._steering.align(observation, self._mode, obstacle)
        self.activity = Activity.FOLLOWING if aligned else Activity.ALIGNING
        return twist

    def _follow(self, observation: Observation, step: float) -> Twist:
        policy = self._policy
        assert policy is not None
        self._followed += step
        if self._sees_goal(observation):
            self._seen_from = distance(observation.pose, *self.goals[0])
            return self._leave(observation)
        assert self._obstacle is not None
        obstacle = self._obstacle.part_of(observation, self._mode)
        if boundary := self._follower.boundary(obstacle, self._mode):
            point = boundary.point_from(observation.pose)
            self._circled.add(point, observation.pose.yaw, self._followed)
        direction = self._follower.tangent(obstacle, self._mode)
        circuits_before = policy.circuits
        free = not self._is_hidden(observation, obstacle)
        decision = policy.step(Step(observation.pose, step, direction, free))
        self.circuits += policy.circuits - circuits_before
        if decision is Decision.NO_PATH or (
            decision is Decision.LEAVE
            and not policy.missed
            and self._is_no_nearer(observation.pose)
        ):
            return self._conclude(observation)
        if decision is Decision.LEAVE:
            if policy.missed and self._misses < _MOST_MISSES:
                # what it hits next it may have circled before
                self._misses += 1
                self._change_hand()
            return self._leave(observation)
        if decision is Decision.BACK:
            self._mode = self._mode.reversed
        if policy.circuits:
            self.activity = Activity.RETURNING
        return self._follow_boundary(observation, obstacle, step)

    def _conclude(self, observation: Observation) -> Twist:
        """Conclude that there is no path, unless what was circled has gone.

        Or unless it is not what was hit: where the robot hits something in a gap, what
        it follows may be the other side of the gap; and in a gap that it follows it may
        get to another obstacle, and not back.
        """
        has_gone = self._gone < _MOST_GONE and self._circled.has_gone(observation)
        is_other = self._others < _MOST_OTHERS and not self._has_circled_what_it_hit()
        if has_gone or is_other:
            self._gone += has_gone
            self._others += is_other
            if is_other:
                self._change_hand()
            self._best_leave = math.inf
            self._starts.append(observation.pose)
            return self._leave(observation)
        self.activity = Activity.NO_PATH
        return STOP

    def _has_circled_what_it_hit(self) -> bool:
        assert self._policy is not None
        hit, start = self._hit_place, self._policy.circuit_start
        return self._circled.begins_at(hit) and self._circled.passes(hit, start)

    def _change_hand(self) -> None:
        """Follow the next boundaries on the other hand, and forget where it has left.

        A gap may be wide enough in one direction and closed in the other, by noise. On
        the same hand the robot would come back to it.
        """
        self._first_mode = FollowMode(wall_on_left=not self._first_mode.wall_on_left)
        self._best_leave = math.inf

    def _follow_boundary(
        self, observation: Observation, obstacle: Observation, step: float
    ) -> Twist:
        twist, found = self._steering.step(observation, self._mode, obstacle)
        self._lost = 0.0 if found else self._lost + step
        if self._lost > _LOST * 2 * math.pi * self._follower.target_distance:
            return self._leave(observation)
        return twist

    def _sees_goal(self, observation: Observation) -> bool:
        """Return whether the goal is so near that no boundary is needed any more.

        After another hit on the way there the robot has to come nearer before the next
        attempt, or it would try for ever where the goal is too near to something.
        """
        bumpers = self._settings.bumpers
        near = distance(observation.pose, *self.goals[0])
        if near > min(bumpers.pressed_below, self._seen_from - bumpers.band / 2):
            return False
        return self._is_free(observation) and not self._is_grazed(observation)

    def _is_no_nearer(self, pose: Pose2) -> bool:
        """Return whether a circuit of Bug1 has brought it no nearer to the goal."""
        near = distance(pose, *self.goals[0])
        no_nearer = near > self._best_leave - self._settings.tolerance
        self._best_leave = min(self._best_leave, near)
        return no_nearer and self._settings.algorithm == Algorithm.BUG1

    def _leave(self, observation: Observation) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self.activity, self._policy, self._leaving = Activity.GOING, None, True
        return self._go(observation)


def _steering(rule: Rule, follower: WallFollower) -> WallFollower | BumperWallFollower:
    return BumperWallFollower(follower) if rule is Rule.THESIS else follower
