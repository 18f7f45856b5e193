"""Places on a boundary that a robot recognises when it comes by again.

Poses drift, so the very point is never met again. But a robot that follows the same
boundary in the same direction crosses the line that stands upright on its way there,
and does so not far from the point.
"""

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

from radarsim.geometry import Pose2
from radarsim.navigation.control import distance
from radarsim.navigation.options import GiveUp


class Landmark:
    """A point of a way, and the direction that the way has there.

    Attributes:
        x: m, map frame.
        y: m.
        direction: rad, map frame.
    """

    def __init__(self, pose: Pose2, direction: float, *, reach: float) -> None:
        """Remember a place.

        Args:
            pose: Where.
            direction: Of the way, rad, map frame.
            reach: How far beside the point a way still counts, m.
        """
        self.x, self.y = pose.x, pose.y
        self.direction = direction
        self._reach = reach
        self._ahead = 0.0

    def passed(self, pose: Pose2, *, onward: bool = True) -> bool:
        """Tell whether the last step went past it; to be asked at every step.

        Args:
            pose: Where the robot is now.
            onward: Whether to be passed in its direction, or against it.
        """
        dx, dy = pose.x - self.x, pose.y - self.y
        c, s = math.cos(self.direction), math.sin(self.direction)
        before, self._ahead = self._ahead, c * dx + s * dy
        beside = abs(c * dy - s * dx)
        if beside > self._reach:
            return False
        return before < 0 <= self._ahead if onward else before > 0 >= self._ahead


# Section from navigation.circling.
# What Bug1 and Bug2 do at a boundary: how long to follow it, and where to leave.
#
# Bug1 goes all the way round, notes where it is nearest to the goal, and goes back
# there
# the shorter way. If the goal's direction leads into the obstacle there, there is no
# path. Bug2 leaves where it meets the line from start to goal again, nearer to the
# goal
# than at the hit point, unless the line leads into the obstacle there.
#
# When Bug2 gives up is a matter of choice. Choset and others: when it meets its hit
# point, here also its own way, again. The thesis: already when it meets the line and
# is
# not nearer to the goal there, which gives up on maps that have a path.
#
# Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2; a
# thesis on navigation with a radar in USARSim, section 5.1.

LEAST_CIRCUIT = 1.5  # m; none is shorter, and so near its beginning is no end
SPACING = 2.0  # m between marks on a boundary
AT_LINE = 0.1  # m beside the line to the goal that are still on it
LEAST_GAIN = 0.1  # m nearer to the goal that count as nearer


class Decision(Enum):
    """What to do next at a boundary."""

    ONWARD = auto()
    BACK = auto()  # the same boundary, the other way along
    LEAVE = auto()
    NO_PATH = auto()


@dataclass(frozen=True, slots=True)
class Step:
    """One step along a boundary.

    Attributes:
        pose: Where the robot is.
        moved: Way since the step before, m.
        direction: Of the boundary, rad, map frame.
        free: Whether the goal is not behind the boundary; what else is before it is
            another obstacle.
    """

    pose: Pose2
    moved: float
    direction: float
    free: bool


class BoundaryPolicy(Protocol):
    """Decides, step by step, how long to follow one boundary.

    Attributes:
        circuits: How often it was gone round.
        missed: Whether it leaves because the place to leave was not found again.
    """

    circuits: int
    missed: bool

    def step(self, step: Step) -> Decision:
        """Decide what to do next."""
        ...


class Trail:
    """Marks along a boundary, the hit point first, that end a circuit when met again.

    The hit point itself may lie where only a robot gets that goes straight. Then the
    circuit is closed by the first mark that lies on it.
    """

    def __init__(self, hit: Landmark, reach: float) -> None:
        self._marks = [(0.0, hit)]
        self._reach = reach

    def closes(self, step: Step, travelled: float) -> float | None:
        """Give after which way, m, the mark was left that is met again, or None.

        Args:
            step: To be told every one.
            travelled: Way since the hit point, m.
        """
        met = [at for at, mark in self._marks if mark.passed(step.pose)]
        if travelled - self._marks[-1][0] >= SPACING:
            mark = Landmark(step.pose, step.direction, reach=self._reach)
            self._marks.append((travelled, mark))
        closing = [at for at in met if travelled - at >= LEAST_CIRCUIT]
        return closing[0] if closing else None


class Bug1Policy:
    """Bug1: all the way round, then to the place nearest to the goal."""

    def __init__(self, hit: Landmark, goal: tuple[float, float], reach: float) -> None:
        self.circuits = 0
        self.missed = False
        self._trail = Trail(hit, reach)
        self._goal = goal
        self._reach = reach
        self._travelled = 0.0
        self._seen: list[tuple[float, float, Pose2, float]] = []
        self._leave = hit
        self._length = math.nan
        self._left_to_go = math.nan
        self._onward = True
        self._turned = False

    def step(self, step: Step) -> Decision:
        """Decide what to do next."""
        self._travelled += step.moved
        return self._return(step) if self.circuits else self._circle(step)

    def _circle(self, step: Step) -> Decision:
        near = distance(step.pose, *self._goal)
        self._seen.append((near, self._travelled, step.pose, step.direction))
        began = self._trail.closes(step, self._travelled)
        if began is None:
            return Decision.ONWARD
        self.circuits = 1
        _, at, pose, direction = min(
            (seen for seen in self._seen if seen[1] >= began), key=lambda seen: seen[0]
        )
        self._leave = Landmark(pose, direction, reach=self._reach)
        self._leave.passed(step.pose)
        self._length = self._travelled - began
        back = self._travelled - at
        self._onward = at - began <= back
        self._left_to_go = min(at - began, back)
        self._travelled = 0.0
        return Decision.ONWARD if self._onward else Decision.BACK

    def _return(self, step: Step) -> Decision:
        passed = self._leave.passed(step.pose, onward=self._onward)
        slack = max(1.0, 0.2 * self._left_to_go)
        close = distance(step.pose, self._leave.x, self._leave.y) < LEAST_GAIN
        due = self._turned or self._travelled >= self._left_to_go - slack
        if due and (passed or close):
            # who went astray does not know which obstacle is before the goal here
            self.missed = self._turned
            given_up = not step.free and not self.missed
            return Decision.NO_PATH if given_up else Decision.LEAVE
        if self._travelled > self._left_to_go + 2 * slack:
            return self._missed()
        return Decision.ONWARD

    def _missed(self) -> Decision:
        """Turn back once, all the way if need be; then go on from where it is."""
        if self._turned:
            self.missed = True
            return Decision.LEAVE
        self._turned = True
        self._onward = not self._onward
        self._left_to_go, self._travelled = self._length, 0.0
        return Decision.BACK


class Bug2Policy:
    """Bug2: until the line to the goal is met, nearer to the goal."""

    def __init__(
        self,
        hit: Landmark,
        line: tuple[Pose2, tuple[float, float]],
        give_up: GiveUp,
        reach: float,
    ) -> None:
        """Begin at a hit point.

        Args:
            hit: Where.
            line: Where it starts, and the goal.
            give_up: When to say that there is no path.
            reach: How far beside a mark a way still counts, m.
        """
        self.circuits = 0
        self.missed = False
        self._hit = hit
        self._trail = Trail(hit, reach)
        self._start, self._goal = line
        self._give_up = give_up
        self._travelled = 0.0
        self._from_hit = distance(Pose2(hit.x, hit.y), *self._goal)
        self._side: float | None = None

    def step(self, step: Step) -> Decision:
        """Decide what to do next."""
        self._travelled += step.moved
        met, crossed = self._meets_line(step.pose)
        near = distance(step.pose, *self._goal)
        nearer = near < self._from_hit - LEAST_GAIN
        again = self._trail.closes(step, self._travelled) is not None
        if met and nearer and step.free:
            return Decision.LEAVE
        if again:
            self.circuits += 1
            return Decision.NO_PATH
        if crossed and not nearer and self._give_up == GiveUp.LINE:
            away = distance(step.pose, self._hit.x, self._hit.y)
            return Decision.NO_PATH if away > LEAST_CIRCUIT / 2 else Decision.ONWARD
        return Decision.ONWARD

    def _meets_line(self, pose: Pose2) -> tuple[bool, bool]:
        """Tell whether the robot is at the line, and whether it has just crossed it."""
        goal_x, goal_y = self._goal
        dx, dy = goal_x - self._start.x, goal_y - self._start.y
        side = dx * (pose.y - self._start.y) - dy * (pose.x - self._start.x)
        before, self._side = self._side, side
        crossed = before is not None and before * side <= 0
        return crossed or abs(side) <= AT_LINE * math.hypot(dx, dy), crossed
