"""Bug1 and Bug2: straight towards the goal, and along the boundaries of obstacles.

A ``Bug`` decides at every scan how to move. It heads for the goal until the bumper in
that direction is pressed, turns until the boundary is abeam, and follows it as long as
its boundary policy says. What is beyond the goal is no obstacle.
"""

import math
from collections.abc import Sequence

from radarsim.autonomy.navigation.boundary_memory import (
    FollowedBoundary,
)
from radarsim.autonomy.navigation.boundary_policy import (
    BoundaryPolicy,
    Bug1Policy,
    Bug2Policy,
    Decision,
    Landmark,
)
from radarsim.autonomy.navigation.control import (
    STOP,
    Twist,
)
from radarsim.autonomy.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import (
    BumperWallFollower,
    WallFollower,
)
from radarsim.autonomy.plans import Algorithm, Rule
from radarsim.geometry import Point, Pose2

GRAZE = 0.1  # m beyond the safety distance at which something beside blocks the path
NOISE = 0.1  # m that a goal may seem nearer to a wall than the safety distance
MOST_OTHERS = 3  # circuits around another obstacle, before it gives up nevertheless
_MOST_MISSES = 3  # leave points that are not found again, likewise
_LOST = 1.5  # circles without a boundary after which the boundary is given up
_MOST_REVERSALS = 3  # of the turn until a boundary is abeam


class Bug(Controller):
    """Bug1 or Bug2; attributes are those of ``Controller``."""

    def __init__(self, goals: Sequence[Point], settings: ControllerSettings) -> None:
        super().__init__(goals, settings)
        self._wall_on_left = settings.wall_on_left  # of the next boundary
        # of the boundary that it is at, unless it is going
        self._boundary: FollowedBoundary
        self._policy: BoundaryPolicy
        self._starts: list[Pose2] = []  # of the lines of which Bug2 has to meet one
        self._lost = 0.0  # m driven without a boundary
        self._turn = 0.0  # rad/s; of the last step of aligning
        self._reversals = 0  # of that turn
        self._best_leave = math.inf  # m from the goal
        self._leaving = False  # whether it is still beside the boundary it has left
        self._seen_from = math.inf  # m; goal distance when the goal was last seen
        # where it hit obstacles that had gone when they were looked at, m, map frame
        self._gone: list[Point] = []
        self._misses = 0  # number of leave points that it did not find again
        self._others = 0  # number of times that another obstacle was circled

    def _begin_goal(self, pose: Pose2) -> None:
        self._starts = [pose]
        self._gone, self._misses, self._others = [], 0, 0
        self._wall_on_left = self._settings.wall_on_left
        self._best_leave = self._seen_from = math.inf

    def _decide(self, observation: Observation, driven: float) -> Twist:
        # The first goal begins at the first scan, each other where one was reached.
        if not self._starts:
            self._starts = [observation.pose]
        if self.activity is Activity.GOING:
            if self._is_open(observation):
                near = self._settings.bumpers.safety_distance + GRAZE
                is_beside = self._side_distance(observation) < near
                self._leaving = self._leaving and is_beside
                return self._towards(observation.pose, self.goals[0])
            self._hit(observation)
        if self.activity is Activity.ALIGNING:
            bearing = self._goal_bearing(observation.pose)
            twist, aligned = self._boundary.follower.align(observation, bearing)
            # Before a mirror what is nearest may change to and fro with each turn.
            self._reversals += twist.turn * self._turn < 0
            self._turn = twist.turn
            if aligned or self._reversals >= _MOST_REVERSALS:
                self.activity = Activity.FOLLOWING
            return twist
        return self._follow(observation, driven)

    def _is_open(self, observation: Observation) -> bool:
        """Return whether nothing is in the way to the goal, nor too near beside it."""
        bumpers, bearing = self._settings.bumpers, self._goal_bearing(observation.pose)
        ahead = bumpers.towards(observation, bearing)
        if ahead.blocked and not self._is_beyond(observation, ahead.distance):
            return False
        # a robot that has followed a boundary into a gap may go on in it
        graze = 0.0 if self._leaving else GRAZE
        return self._side_distance(observation) >= bumpers.safety_distance + graze

    def _is_hidden(self, observation: Observation, part: Observation) -> bool:
        """Return whether the followed boundary is between the robot and the goal."""
        goal = self._goal_bearing(observation.pose)
        ahead = self._settings.bumpers.towards(observation, goal)
        if self._is_beyond(observation, ahead.distance):
            return False
        return self._boundary.follower.leads_into_boundary(part, goal)

    def _is_beyond(self, observation: Observation, obstacle: float) -> bool:
        """Return whether an obstacle at a distance, m, is beyond the goal."""
        goal = self._goal_distance(observation.pose)
        return goal + self._settings.bumpers.safety_distance - NOISE <= obstacle

    def _side_distance(self, observation: Observation) -> float:
        """Return the distance, m, of what is nearest beside the path to the goal."""
        bumpers, goal = self._settings.bumpers, self._goal_bearing(observation.pose)
        sides = (goal - bumpers.width, goal + bumpers.width)
        return min(bumpers.towards(observation, side).distance for side in sides)

    def _hit(self, observation: Observation) -> None:
        pose, goal = observation.pose, self.goals[0]
        self.hit_points.append((pose.x, pose.y))
        self.activity, self._lost = Activity.ALIGNING, 0.0
        self._turn, self._reversals = 0.0, 0
        settings = self._settings
        is_literal = settings.bumpers.rule is Rule.THESIS
        follower = (BumperWallFollower if is_literal else WallFollower)(
            settings.bumpers, settings.speed_limits, wall_on_left=self._wall_on_left
        )
        self._boundary = FollowedBoundary(follower)
        obstacle = self._goal_bearing(pose)
        self._boundary.reach(observation, obstacle, goal)
        direction = follower.direction(observation, obstacle)
        max_offset = follower.target_distance
        hit = Landmark(pose, direction, max_offset=max_offset)
        if settings.algorithm == Algorithm.BUG1:
            self._policy = Bug1Policy(hit, goal, max_offset)
            return
        self._policy = Bug2Policy(
            hit, goal, max_offset, starts=self._starts, give_up=settings.give_up
        )

    def _follow(self, observation: Observation, step: float) -> Twist:
        if self._sees_goal(observation):
            self._seen_from = self._goal_distance(observation.pose)
            return self._leave(observation)
        boundary, policy = self._boundary, self._policy
        follower = boundary.follower
        # By the part of the scan that shows it: where another obstacle is as near, the
        # robot would change to that.
        part = boundary.look(observation, self.goals[0])
        boundary.remember(part.pose.yaw, step)
        direction = follower.tangent(part)
        circuits_before = policy.circuits
        free = not self._is_hidden(observation, part)
        decision = policy.step(observation.pose, step, direction, free=free)
        self.circuits += policy.circuits - circuits_before
        if decision is Decision.LEAVE:
            return self._leave_or_conclude(observation)
        if decision is Decision.NO_PATH:
            return self._conclude(observation)
        if decision is Decision.BACK:
            follower.forward = not follower.forward
        if policy.circuits:
            self.activity = Activity.RETURNING
        twist, found = follower.step(observation, part)
        self._lost = 0.0 if found else self._lost + step
        # It has driven around where the boundary should be, and nothing is there.
        if self._lost > _LOST * 2 * math.pi * follower.target_distance:
            return self._leave(observation)
        return twist

    def _leave_or_conclude(self, observation: Observation) -> Twist:
        """Leave, unless a circuit of Bug1 has brought it no nearer to the goal."""
        if self._policy.missed:
            if self._misses < _MOST_MISSES:
                # what it hits next it may have circled before
                self._misses += 1
                self._change_hand()
            return self._leave(observation)
        near = self._goal_distance(observation.pose)
        is_no_nearer = near > self._best_leave - self._settings.tolerance
        self._best_leave = min(self._best_leave, near)
        if is_no_nearer and self._settings.algorithm == Algorithm.BUG1:
            return self._conclude(observation)
        return self._leave(observation)

    def _conclude(self, observation: Observation) -> Twist:
        # There is no path, unless what was circled has driven away meanwhile, or is
        # another obstacle than the one that was hit.
        has_gone = self._boundary.has_gone(observation, self._gone)
        start = self._policy.circuit_start
        is_hit = self._boundary.is_what_was_hit(start)
        is_other = self._others < MOST_OTHERS and not is_hit
        if has_gone or is_other:
            self._others += is_other
            if is_other:
                # The other side of a gap, or what is behind it: on the same hand the
                # robot would come back there.
                self._change_hand()
            self._best_leave = math.inf
            # A robot in a gap may circle what the first line to the goal never meets,
            # as on the random maps 108, 357 and 458: the line from here counts, too.
            self._starts.append(observation.pose)
            return self._leave(observation)
        self.activity = Activity.NO_PATH
        return STOP

    def _change_hand(self) -> None:
        """Follow the next boundaries on the other hand, and forget where it has left.

        A gap may be wide enough in one direction and closed in the other, by noise. On
        the same hand the robot would come back to it.
        """
        self._wall_on_left = not self._wall_on_left
        self._best_leave = math.inf

    def _sees_goal(self, observation: Observation) -> bool:
        """Return whether the goal is so near that no boundary is needed any more.

        After another hit on the way there the robot has to come nearer before the next
        attempt, or it would try for ever where the goal is too near to something.
        """
        bumpers = self._settings.bumpers
        near = self._goal_distance(observation.pose)
        most = min(bumpers.pressed_below, self._seen_from - bumpers.band / 2)
        return near <= most and self._is_open(observation)

    def _leave(self, observation: Observation) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self.activity, self._leaving = Activity.GOING, True
        return self._towards(observation.pose, self.goals[0])
