"""Bug1 and Bug2: drive straight to the goal, and around obstacles in the way.

A ``Bug`` decides at every scan how to move. It heads for the goal until the bumper in
that direction is pressed, turns until the boundary is at its side, and follows the
boundary until its policy decides to leave. Obstacles beyond the goal are ignored.

Theory of operation
===================
Bug1 drives all the way around an obstacle, stores the point nearest to the goal, and
returns to that point the shorter way round. If the direction of the goal leads into the
obstacle there, no path exists. Bug2 leaves the boundary where it meets the line from
start to goal again, nearer to the goal than at the hit point, unless the line leads
into the obstacle there.

The user chooses when Bug2 gives up. According to Choset and others, it gives up when it
meets its hit point or another point of its path again. According to the thesis, it
gives up as soon as it meets the line at a point that is no nearer to the goal than the
hit point, even on some maps that have a path.

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

AT_LINE = 0.1  # m from the line to the goal, within which the robot is on it
LEAST_GAIN = 0.1  # m; smaller decreases of the goal distance do not count
GRAZE = 0.1  # m beyond the safety distance, within which obstacles block the path
NOISE = 0.1  # m by which noise may move a wall near the goal towards the robot
MOST_OTHERS = 3  # circuits around obstacles that were not hit, before giving up
_MOST_MISSES = 3  # missed leave points after which the side is kept
_LOST = 1.5  # circles without seeing the boundary before the robot leaves it
_MOST_REVERSALS = 3  # changes of the turning direction before the alignment ends


class Decision(Enum):
    """The next action of a robot that follows the boundary of an obstacle."""

    ONWARD = auto()
    BACK = auto()  # along the same boundary, in the opposite direction
    LEAVE = auto()
    LEAVE_UNSURE = auto()  # the robot did not find its leave point again
    NO_PATH = auto()


class Bug1Policy:
    """Bug1 at one obstacle: circle it, then return to the point nearest to the goal.

    Attributes:
        boundary: The boundary.
        circuits: Number of complete circuits.
    """

    def __init__(self, boundary: FollowedBoundary, goal: Point) -> None:
        """Create the policy where the robot has hit an obstacle.

        Args:
            boundary: The boundary that was hit, with a landmark there.
            goal: Position of the goal, m, map frame.
        """
        self.boundary, self.circuits, self._goal = boundary, 0, goal
        # distance to the goal, path length, pose and direction at every step
        self._steps: list[tuple[float, float, Pose2, float]] = []
        self._leave: Landmark
        # length of the circuit, length of the path back to the leave point, and path
        # length at which the robot turned back, m
        self._perimeter = self._return_length = self._turned_at = math.nan
        self._onward = True
        self._turned_back = False

    def step(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        """Return what the robot does next at the boundary.

        Args:
            pose: Pose of the robot.
            direction: Direction of the boundary, rad, map frame.
            free: False if the boundary is between the robot and the goal; other
            obstacles are ignored.
        """
        if self.circuits:
            return self._return(pose, free=free)
        travelled = self.boundary.travelled
        goal_distance = distance(pose, *self._goal)
        self._steps.append((goal_distance, travelled, pose, direction))
        if not self.boundary.closes_circuit(pose, direction):
            return Decision.ONWARD
        self.circuits, began = 1, self.boundary.circuit_start
        # Steps before the circuit began are left out,
        # since they may not be next to the boundary.
        _, at, nearest, direction = min(
            (each for each in self._steps if each[1] >= began), key=lambda each: each[0]
        )
        reach = self.boundary.follower.target_distance
        self._leave = Landmark(nearest, direction, max_offset=reach)
        self._leave.observe(pose)  # store on which side of the point the robot is now
        self._perimeter = travelled - began
        back = travelled - at
        self._onward = at - began <= back
        self._return_length, self._turned_at = min(at - began, back), travelled
        return Decision.ONWARD if self._onward else Decision.BACK

    def _return(self, pose: Pose2, *, free: bool) -> Decision:
        passed = self._leave.observe(pose, onward=self._onward)
        travelled = self.boundary.travelled
        returned = travelled - self._turned_at
        # Poses drift, so the measured lengths of the paths out and back may differ.
        slack = max(1.0, 0.2 * self._return_length)
        close = distance(pose, self._leave.x, self._leave.y) < LEAST_GAIN
        # Before it has driven this far, the robot may pass
        # the landmark on another side of the obstacle.
        due = self._turned_back or returned >= self._return_length - slack
        if due and (passed or close):
            # A robot that missed its leave point cannot
            # tell which obstacle hides the goal.
            if self._turned_back:
                return Decision.LEAVE_UNSURE
            return Decision.LEAVE if free else Decision.NO_PATH
        if returned > self._return_length + 2 * slack:
            # The robot turns back only once. If it misses the leave point for another
            # whole circuit, it leaves the boundary at its present position.
            if self._turned_back:
                return Decision.LEAVE_UNSURE
            self._turned_back = True
            self._onward = not self._onward
            self._return_length, self._turned_at = self._perimeter, travelled
            return Decision.BACK
        return Decision.ONWARD


class Bug2Policy:
    """Bug2 at one obstacle: leave it on the line from the start to the goal.

    The attributes are those of ``Bug1Policy``.
    """

    def __init__(
        self,
        boundary: FollowedBoundary,
        goal: Point,
        hit: Pose2,
        starts: Sequence[Pose2],
        give_up: GiveUp,
    ) -> None:
        """Create the policy where the robot has hit an obstacle.

        Args:
            boundary: The boundary that was hit, with a landmark at the hit point.
            goal: Position of the goal, m, map frame.
            hit: Pose of the robot at the hit point.
            starts: Start poses of the lines to the goal; the robot may leave at any of
                them, and gives up only at the last one. At least one.
            give_up: When to conclude that no path exists.
        """
        self.boundary, self.circuits, self._goal = boundary, 0, goal
        self._lines = [_Line(start, goal) for start in starts]
        self._hit, self._give_up = hit, give_up

    def step(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        """Return what the robot does next; for the arguments see ``Bug1Policy``."""
        # Every line has to process every pose, since
        # the line stores on which side the robot was.
        met = [line.meets(pose) for line in self._lines]
        at_line, crossed = any(at for at, _ in met), met[-1][1]
        hit_distance = distance(self._hit, *self._goal)
        nearer = distance(pose, *self._goal) < hit_distance - LEAST_GAIN
        # The landmarks need every pose, so they are updated before any decision.
        closes_circuit = self.boundary.closes_circuit(pose, direction)
        if at_line and nearer and free:
            return Decision.LEAVE
        if closes_circuit:
            self.circuits += 1
            return Decision.NO_PATH
        # The robot is also on the line at its hit
        # point, so crossings near it do not count.
        is_away = pose.distance(self._hit) > LEAST_CIRCUIT / 2
        gives_up = crossed and not nearer and self._give_up == GiveUp.LINE
        return Decision.NO_PATH if gives_up and is_away else Decision.ONWARD


class _Line:
    """The line from a start to the goal, on which Bug2 leaves an obstacle."""

    def __init__(self, start: Pose2, goal: Point) -> None:
        self._start, self._goal = start, goal
        self._side: float | None = None

    def meets(self, pose: Pose2) -> tuple[bool, bool]:
        """Return whether the robot is at the line, and whether it crosses the line.

        The line ends at the goal, since leaving beyond the goal gives no shorter path.
        A crossing of the line's extension counts as a crossing, too.
        """
        goal_x, goal_y = self._goal
        dx, dy = goal_x - self._start.x, goal_y - self._start.y
        length = math.hypot(dx, dy)
        x, y = pose.x - self._start.x, pose.y - self._start.y
        # ``side`` and ``along`` are multiplied by the length of the line, since a
        # division would fail for a length of 0.
        side, along = dx * y - dy * x, dx * x + dy * y
        before, self._side = self._side, side
        crossed = before is not None and before * side <= 0
        is_beside = -AT_LINE * length <= along <= length * (length + AT_LINE)
        at_line = is_beside and (crossed or abs(side) <= AT_LINE * length)
        return at_line, crossed


class BoundaryController(Controller):
    """Base class of the algorithms that follow the boundaries of obstacles."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._boundary: FollowedBoundary  # the current boundary; unset while going
        # hit points of obstacles that have moved away since, m, map frame
        self._gone: list[Point] = []
        self._others = 0  # number of circuits around obstacles that were not hit

    def _begin_goal(self, pose: Pose2) -> None:  # noqa: ARG002 - subclasses need it
        self._gone, self._others = [], 0

    def _begin_boundary(
        self, kind: type[WallFollower] = WallFollower, *, wall_on_left: bool
    ) -> None:
        """Start to align the robot with the boundary of the obstacle that blocks it."""
        limits, self.activity = self._settings.speed_limits, Activity.ALIGNING
        follower = kind(self._settings.bumpers, limits, wall_on_left=wall_on_left)
        self._boundary = FollowedBoundary(follower)

    def _conclude(self, observation: Observation) -> Twist:
        """Give up after a circuit, unless the circled obstacle is not in the way.

        The obstacle may have driven away, or the robot may have hit another obstacle.
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
        """Leave the circled obstacle, which does not block the path to the goal.

        Args:
            observation: The newest scan.
            is_other: Whether the robot circled another obstacle than it hit.
        """


class Bug(BoundaryController):
    """The algorithms Bug1 and Bug2; the attributes are those of ``Controller``."""

    def __init__(self, settings: ControllerSettings) -> None:
        super().__init__(settings)
        self._wall_on_left = settings.mission.side == "left"  # at the next boundary
        self._policy: Bug1Policy | Bug2Policy  # policy for the current boundary
        self._starts: list[Pose2] = []  # starts of the lines on which Bug2 leaves
        self._lost = 0.0  # m driven without a boundary in sight
        self._turn = 0.0  # rad/s; turn rate of the last alignment step
        self._reversals = 0  # changes of the turning direction while aligning
        self._best_leave = math.inf  # m; least distance to the goal at a leave point
        self._leaving = False  # whether the boundary just left is still near
        self._seen_from = math.inf  # m; goal distance when the goal was last seen
        self._misses = 0  # number of leave points that were not found again

    def _begin_goal(self, pose: Pose2) -> None:
        super()._begin_goal(pose)
        self._starts, self._misses = [pose], 0
        self._wall_on_left = self._settings.mission.side == "left"
        self._best_leave = self._seen_from = math.inf

    def _decide(self, observation: Observation, driven: float) -> Twist:
        # The line to the first goal starts at the pose of the first scan. The line to
        # each later goal starts where the previous goal was reached.
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
            # Next to a mirror, the nearest point may jump from side to side, so the
            # robot would turn back and forth forever.
            self._reversals += twist.turn * self._turn < 0
            self._turn = twist.turn
            if aligned or self._reversals >= _MOST_REVERSALS:
                self.activity = Activity.FOLLOWING
            return twist
        return self._follow(observation, driven)

    def _is_open(self, observation: Observation) -> bool:
        """Return whether the path to the goal is free, with some room on both sides."""
        bumpers, bearing = self._settings.bumpers, self._goal_bearing(observation.pose)
        ahead = bumpers.towards(observation, bearing)
        if ahead.blocked and not self._is_beyond(observation, ahead.distance):
            return False
        # In a narrow gap, a robot that has just left a boundary may drive on with less
        # room.
        graze = 0.0 if self._leaving else GRAZE
        return self._side_distance(observation) >= bumpers.safety_distance + graze

    def _is_hidden(self, observation: Observation, part: Observation) -> bool:
        """Return whether the followed obstacle is between the robot and the goal."""
        goal = self._goal_bearing(observation.pose)
        ahead = self._settings.bumpers.towards(observation, goal)
        if self._is_beyond(observation, ahead.distance):
            return False
        return self._boundary.follower.leads_into_boundary(part, goal)

    def _is_beyond(self, observation: Observation, obstacle: float) -> bool:
        """Return whether an obstacle at a distance, m, is farther than the goal."""
        goal = self._goal_distance(observation.pose)
        return goal + self._settings.bumpers.safety_distance - NOISE <= obstacle

    def _side_distance(self, observation: Observation) -> float:
        """Return the distance, m, of the nearest obstacle beside the path."""
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
        # Only beams on the followed boundary count. Otherwise the robot would switch to
        # another obstacle at the same distance.
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
                # The robot may already have circled the obstacle that it hits next, so
                # it follows that boundary on the other side.
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
        # The robot has driven around the expected boundary without seeing it.
        if self._lost > _LOST * 2 * math.pi * follower.target_distance:
            return self._leave(observation)
        return twist

    def _leave_or_conclude(self, observation: Observation) -> Twist:
        """Leave the boundary, or give up if Bug1 has come no nearer to the goal."""
        near, mission = self._goal_distance(observation.pose), self._settings.mission
        is_no_nearer = near > self._best_leave - mission.tolerance
        self._best_leave = min(self._best_leave, near)
        if is_no_nearer and mission.algorithm is Algorithm.BUG1:
            return self._conclude(observation)
        return self._leave(observation)

    def _go_on(self, observation: Observation, *, is_other: bool) -> Twist:
        if is_other:
            # The other obstacle is across or behind a gap. The robot would return to
            # that obstacle if it kept the wall on the same side.
            self._change_hand()
        self._best_leave = math.inf
        # In a gap, the robot may circle an obstacle that never meets the line from the
        # start, as on random maps 108, 357 and 458. So a line from this pose is added.
        self._starts.append(observation.pose)
        return self._leave(observation)

    def _change_hand(self) -> None:
        """Follow the next boundaries on the other side, and reset the best leave point.

        Noise may make a gap look closed in one direction and open in the other. With
        the wall on the same side, the robot would return to the gap.
        """
        self._wall_on_left = not self._wall_on_left
        self._best_leave = math.inf

    def _sees_goal(self, observation: Observation) -> bool:
        """Return whether the goal is near and no obstacle is in between.

        After another hit, the robot has to come nearer to the goal before it leaves
        again. Otherwise it would try forever if the goal is too close to an obstacle.
        """
        bumpers = self._settings.bumpers
        near = self._goal_distance(observation.pose)
        most = min(bumpers.pressed_below, self._seen_from - BAND / 2)
        return near <= most and self._is_open(observation)

    def _leave(self, observation: Observation) -> Twist:
        self.leave_points.append((observation.pose.x, observation.pose.y))
        self.activity, self._leaving = Activity.GOING, True
        return self._towards(observation.pose, self.goals[0])
