"""Bug1 and Bug2: straight towards the goal, and along the boundaries of obstacles.

A ``Bug`` decides at every scan how to move. It heads for the goal until the bumper in
that direction is pressed, turns until the boundary is abeam, and follows it as long as
its boundary policy says. Things beyond the goal are no obstacles.

Theory of operation
===================
Bug1 drives all the way around, notes where it is nearest to the goal, and drives back
there the shorter way round. If the goal's direction leads into the obstacle there,
there is no path. Bug2 leaves where it meets the line from start to goal again, nearer
to the goal than at the hit point, unless the line leads into the obstacle there.

When Bug2 gives up is an option. Choset and others: when it meets its hit point, here
or another point of its own path, again. The thesis: already when it meets the line
and is no nearer to the goal there, which gives up on maps that have a path.

Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2; a
thesis on navigation with a radar in USARSim, section 5.1.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from enum import Enum, auto

from radarsim.autonomy.navigation.boundary_memory import (
    LEAST_CIRCUIT,
    FollowedBoundary,
    Landmark,
)
from radarsim.autonomy.navigation.bumpers import BAND
from radarsim.autonomy.navigation.control import STOP, Twist, distance
from radarsim.autonomy.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.wall_following import BumperWallFollower, WallFollower
from radarsim.autonomy.plans import Algorithm, GiveUp, Rule
from radarsim.geometry import Point, Pose2

AT_LINE = 0.1  # m from the line to the goal that still count as on it
LEAST_GAIN = 0.1  # m nearer to the goal that count as nearer
GRAZE = (
    0.1  # m beyond the safety distance at which something at the side blocks the path
)
NOISE = 0.1  # m that a goal may seem nearer to a wall than the safety distance
MOST_OTHERS = 3  # circuits around another obstacle, before it gives up nevertheless
_MOST_MISSES = 3  # leave points that are not found again, likewise
_LOST = 1.5  # circles without a boundary after which the boundary is given up
_MOST_REVERSALS = 3  # of the turn until a boundary is abeam


class Decision(Enum):
    """What to do next at a boundary."""

    ONWARD = auto()
    BACK = auto()  # along the same boundary, in the other direction
    LEAVE = auto()
    LEAVE_UNSURE = auto()  # as the leave point was not found again
    NO_PATH = auto()


class Bug1Policy:
    """Bug1 at one boundary: all the way around, then to the point nearest to the goal.

    Attributes:
        boundary: The boundary.
        circuits: Number of complete circuits.
    """

    def __init__(self, boundary: FollowedBoundary, goal: Point) -> None:
        """Create the policy at a hit point.

        Args:
            boundary: The boundary that was hit, with a landmark there.
            goal: m, map frame.
        """
        self.boundary, self.circuits, self._goal = boundary, 0, goal
        # goal distance, path length, pose and direction of every step
        self._steps: list[tuple[float, float, Pose2, float]] = []
        self._leave: Landmark
        # lengths of the circuit and of the way back to the leave point, and where along
        # the path that way began, m
        self._perimeter = self._return_length = self._turned_at = math.nan
        self._onward = True
        self._turned_back = False

    def step(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        """Decide what to do next.

        Args:
            pose: Of the robot.
            direction: Of the boundary, rad, map frame.
            free: Whether the boundary is not between the robot and the goal; another
                obstacle may be.
        """
        if self.circuits:
            return self._return(pose, free=free)
        travelled = self.boundary.travelled
        goal_distance = distance(pose, *self._goal)
        self._steps.append((goal_distance, travelled, pose, direction))
        if not self.boundary.closes_circuit(pose, direction):
            return Decision.ONWARD
        self.circuits, began = 1, self.boundary.circuit_start
        # Only steps of the circuit: the way to where it began may not be part of it.
        _, at, nearest, direction = min(
            (each for each in self._steps if each[1] >= began), key=lambda each: each[0]
        )
        reach = self.boundary.follower.target_distance
        self._leave = Landmark(nearest, direction, max_offset=reach)
        self._leave.observe(pose)  # from here on it knows on which side it is
        self._perimeter = travelled - began
        back = travelled - at
        self._onward = at - began <= back
        self._return_length, self._turned_at = min(at - began, back), travelled
        return Decision.ONWARD if self._onward else Decision.BACK

    def _return(self, pose: Pose2, *, free: bool) -> Decision:
        passed = self._leave.observe(pose, onward=self._onward)
        travelled = self.boundary.travelled
        returned = travelled - self._turned_at
        # Poses drift, so the way back may measure shorter or longer than the way there.
        slack = max(1.0, 0.2 * self._return_length)
        close = distance(pose, self._leave.x, self._leave.y) < LEAST_GAIN
        # Before that the robot may pass the landmark on another side of the obstacle.
        due = self._turned_back or returned >= self._return_length - slack
        if due and (passed or close):
            # A robot that lost its path cannot tell which obstacle hides the goal here
            if self._turned_back:
                return Decision.LEAVE_UNSURE
            return Decision.LEAVE if free else Decision.NO_PATH
        if returned > self._return_length + 2 * slack:
            # It turns back once, for up to a whole circuit; then it leaves anywhere.
            if self._turned_back:
                return Decision.LEAVE_UNSURE
            self._turned_back = True
            self._onward = not self._onward
            self._return_length, self._turned_at = self._perimeter, travelled
            return Decision.BACK
        return Decision.ONWARD


class Bug2Policy:
    """Bug2 at one boundary: until the line to the goal is met, nearer to the goal.

    Attributes are those of ``Bug1Policy``.
    """

    def __init__(
        self,
        boundary: FollowedBoundary,
        goal: Point,
        hit: Pose2,
        starts: Sequence[Pose2],
        give_up: GiveUp,
    ) -> None:
        """Create the policy at a hit point.

        Args:
            boundary: See ``Bug1Policy``.
            goal: Likewise.
            hit: The pose at the hit point.
            starts: Starts of the lines to the goal; it leaves at any of them. At least
                one. Where it gives up at a line, that is the last one.
            give_up: When to conclude that there is no path.
        """
        self.boundary, self.circuits, self._goal = boundary, 0, goal
        self._lines = [_Line(start, goal) for start in starts]
        self._hit, self._give_up = hit, give_up

    def step(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        """See ``Bug1Policy.step``."""
        # All lines are asked, since each remembers on which side the robot was.
        met = [line.meets(pose) for line in self._lines]
        at_line, crossed = any(at for at, _ in met), met[-1][1]
        hit_distance = distance(self._hit, *self._goal)
        nearer = distance(pose, *self._goal) < hit_distance - LEAST_GAIN
        # Before anything is decided: the landmarks have to see every step, too.
        closes_circuit = self.boundary.closes_circuit(pose, direction)
        if at_line and nearer and free:
            return Decision.LEAVE
        if closes_circuit:
            self.circuits += 1
            return Decision.NO_PATH
        # At its hit point the robot is at the line as well.
        is_away = pose.distance(self._hit) > LEAST_CIRCUIT / 2
        gives_up = crossed and not nearer and self._give_up == GiveUp.LINE
        return Decision.NO_PATH if gives_up and is_away else Decision.ONWARD


class _Line:
    """The line from a start to the goal, which Bug2 has to meet."""

    def __init__(self, start: Pose2, goal: Point) -> None:
        self._start, self._goal = start, goal
        self._side: float | None = None

    def meets(self, pose: Pose2) -> tuple[bool, bool]:
        """Return whether the robot is at the line, and whether it just crossed it.

        The line ends at the goal, since there is no shorter way beyond; that a path
        crosses it counts before the start, too.
        """
        goal_x, goal_y = self._goal
        dx, dy = goal_x - self._start.x, goal_y - self._start.y
        length = math.hypot(dx, dy)
        x, y = pose.x - self._start.x, pose.y - self._start.y
        # Times the length of the line, by which nothing is divided, as it may be 0.
        side, along = dx * y - dy * x, dx * x + dy * y
        before, self._side = self._side, side
        crossed = before is not None and before * side <= 0
        is_beside = -AT_LINE * length <= along <= length * (length + AT_LINE)
        at_line = is_beside and (crossed or abs(side) <= AT_LINE * length)
        return at_line, crossed


class BoundaryController(Controller):
    """What algorithms have in common that follow boundaries."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._boundary: FollowedBoundary  # that it is at, unless it is going
        # where it hit obstacles that had gone when they were looked at, m, map frame
        self._gone: list[Point] = []
        self._others = 0  # number of times that another obstacle was circled

    def _begin_goal(self, pose: Pose2) -> None:  # noqa: ARG002 - subclasses need it
        self._gone, self._others = [], 0

    def _begin_boundary(
        self, kind: type[WallFollower] = WallFollower, *, wall_on_left: bool
    ) -> None:
        """Turn to the boundary of the obstacle ahead, to keep it on one side."""
        limits, self.activity = self._settings.speed_limits, Activity.ALIGNING
        follower = kind(self._settings.bumpers, limits, wall_on_left=wall_on_left)
        self._boundary = FollowedBoundary(follower)

    def _conclude(self, observation: Observation) -> Twist:
        """Give up after a circuit, unless what was circled does not close the way.

        It may have driven away meanwhile, or be another obstacle than was hit.
        """
        has_gone = self._boundary.has_gone(observation, self._gone)
        is_hit = self._boundary.is_what_was_hit()
        is_other = self._others < MOST_OTHERS and not is_hit
        if has_gone or is_other:
            self._others += is_other
            return self._go_on(observation, is_other=is_other)
        self.activity = Activity.NO_PATH
        return STOP

    @abstractmethod
    def _go_on(self, observation: Observation, *, is_other: bool) -> Twist:
        """Leave what was circled, which does not close the way to the goal.

        Args:
            observation: The newest scan.
            is_other: Whether it is another obstacle than was hit.
        """


class Bug(BoundaryController):
    """Bug1 or Bug2; attributes are those of ``Controller``."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._wall_on_left = settings.mission.side == "left"  # of the next boundary
        self._policy: Bug1Policy | Bug2Policy  # for the boundary that it is at
        self._starts: list[Pose2] = []  # of the lines; Bug2 has to meet one
        self._lost = 0.0  # m driven without a boundary
        self._turn = 0.0  # rad/s; of the last step of aligning
        self._reversals = 0  # of that turn
        self._best_leave = math.inf  # m from the goal
        self._leaving = False  # whether it is still at the boundary it has left
        self._seen_from = math.inf  # m; goal distance when the goal was last seen
        self._misses = 0  # number of leave points that it did not find again

    def _begin_goal(self, pose: Pose2) -> None:
        super()._begin_goal(pose)
        self._starts, self._misses = [pose], 0
        self._wall_on_left = self._settings.mission.side == "left"
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
            # Before a mirror the nearest point may change to and fro with each turn.
            self._reversals += twist.turn * self._turn < 0
            self._turn = twist.turn
            if aligned or self._reversals >= _MOST_REVERSALS:
                self.activity = Activity.FOLLOWING
            return twist
        return self._follow(observation, driven)

    def _is_open(self, observation: Observation) -> bool:
        """Return whether nothing is in the way to the goal, nor too near to it."""
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
        """Return the distance, m, of the nearest thing at the sides of the path."""
        bumpers, goal = self._settings.bumpers, self._goal_bearing(observation.pose)
        sides = (goal - bumpers.width, goal + bumpers.width)
        return min(bumpers.towards(observation, side).distance for side in sides)

    def _hit(self, observation: Observation) -> None:
        pose, goal, settings = observation.pose, self.goals[0], self._settings
        self.hit_points.append((pose.x, pose.y))
        self._lost, self._turn, self._reversals = 0.0, 0.0, 0
        is_literal = settings.bumpers.rule is Rule.THESIS
        kind = BumperWallFollower if is_literal else WallFollower
        self._begin_boundary(kind, wall_on_left=self._wall_on_left)
        boundary = self._boundary
        direction = boundary.reach(observation, self._goal_bearing(pose), goal)
        boundary.add_landmark(pose, direction, 0.0)
        if settings.mission.algorithm is Algorithm.BUG1:
            self._policy = Bug1Policy(boundary, goal)
        else:
            give_up = settings.mission.give_up
            self._policy = Bug2Policy(boundary, goal, pose, self._starts, give_up)

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
        decision = policy.step(part.pose, direction, free=free)
        self.circuits += policy.circuits - circuits_before
        if decision is Decision.LEAVE:
            return self._leave_or_conclude(observation)
        if decision is Decision.LEAVE_UNSURE:
            if self._misses < _MOST_MISSES:
                # what it hits next it may have circled before
                self._misses += 1
                self._change_hand()
            return self._leave(observation)
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
        near, mission = self._goal_distance(observation.pose), self._settings.mission
        is_no_nearer = near > self._best_leave - mission.tolerance
        self._best_leave = min(self._best_leave, near)
        if is_no_nearer and mission.algorithm is Algorithm.BUG1:
            return self._conclude(observation)
        return self._leave(observation)

    def _go_on(self, observation: Observation, *, is_other: bool) -> Twist:
        if is_other:
            # The other side of a gap, or a thing behind it: on the same hand the robot
            # would come back there.
            self._change_hand()
        self._best_leave = math.inf
        # A robot in a gap may circle what the first line to the goal never meets, as on
        # the random maps 108, 357 and 458: the line from here counts, too.
        self._starts.append(observation.pose)
        return self._leave(observation)

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
        most = min(bumpers.pressed_below, self._seen_from - BAND / 2)
        return near <= most and self._is_open(observation)

    def _leave(self, observation: Observation) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self.activity, self._leaving = Activity.GOING, True
        return self._towards(observation.pose, self.goals[0])
