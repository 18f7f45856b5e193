"""What Bug1 and Bug2 do at a boundary: how long to follow it, and where to leave.

Bug1 goes all the way round, notes where it is nearest to the goal, and goes back there
the shorter way. If the goal's direction is blocked there, there is no path. Bug2 leaves
where it meets the line from start to goal again, nearer to the goal than at the hit
point and with a free way towards it.

When Bug2 gives up is a matter of choice. Choset and others: when it meets its hit point
again. The thesis: already when it meets the line and is not nearer to the goal there,
which gives up on maps that have a path.

Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2; a
thesis on navigation with a radar in USARSim, section 5.1.
"""

from dataclasses import dataclass
from enum import Enum, StrEnum, auto
from typing import Protocol

from radarsim.geometry import Pose2
from radarsim.navigation.landmark import Landmark
from radarsim.navigation.motion import distance

LEAST_CIRCUIT = 1.5  # m; none is shorter, and so near its beginning is no end
LEAST_GAIN = 0.1  # m nearer to the goal that count as nearer


class Verdict(Enum):
    """What to do next at a boundary."""

    ONWARD = auto()
    BACK = auto()  # the same boundary, the other way along
    LEAVE = auto()
    NO_PATH = auto()


class GiveUp(StrEnum):
    """When Bug2 says that there is no path."""

    HIT_POINT = "hit_point"  # it has come round to where it hit
    LINE = "line"  # it is at the line, and not nearer


@dataclass(frozen=True, slots=True)
class Step:
    """One step along a boundary.

    Attributes:
        pose: Where the robot is.
        moved: Way since the step before, m.
        direction: Of the boundary, rad, map frame.
        free: Whether the way towards the goal is free.
    """

    pose: Pose2
    moved: float
    direction: float
    free: bool


class Circling(Protocol):
    """Decides, step by step, how long to follow one boundary.

    Attributes:
        circuits: How often it was gone round.
    """

    circuits: int

    def step(self, step: Step) -> Verdict:
        """Decide what to do next."""
        ...


class AllRound:
    """Bug1: all the way round, then to the place nearest to the goal."""

    def __init__(self, hit: Landmark, goal: tuple[float, float], reach: float) -> None:
        self.circuits = 0
        self._hit = hit
        self._goal = goal
        self._reach = reach
        self._travelled = 0.0
        self._nearest = float("inf")
        self._nearest_at = 0.0
        self._leave = hit
        self._left_to_go = float("nan")
        self._onward = True

    def step(self, step: Step) -> Verdict:
        """Decide what to do next."""
        self._travelled += step.moved
        return self._return(step) if self.circuits else self._circle(step)

    def _circle(self, step: Step) -> Verdict:
        near = distance(step.pose, *self._goal)
        if near < self._nearest:
            self._nearest, self._nearest_at = near, self._travelled
            self._leave = Landmark(step.pose, step.direction, reach=self._reach)
        passed = self._hit.passed(step.pose)
        if not passed or self._travelled < LEAST_CIRCUIT:
            return Verdict.ONWARD
        self.circuits = 1
        back = self._travelled - self._nearest_at
        self._onward = self._nearest_at <= back
        self._left_to_go = min(self._nearest_at, back)
        self._travelled = 0.0
        self._leave.passed(step.pose)
        return Verdict.ONWARD if self._onward else Verdict.BACK

    def _return(self, step: Step) -> Verdict:
        passed = self._leave.passed(step.pose, onward=self._onward)
        slack = max(1.0, 0.2 * self._left_to_go)
        close = distance(step.pose, self._leave.x, self._leave.y) < LEAST_GAIN
        if not (passed or close) or self._travelled < self._left_to_go - slack:
            return Verdict.ONWARD
        return Verdict.LEAVE if step.free else Verdict.NO_PATH


class AlongLine:
    """Bug2: until the line to the goal is met, nearer to the goal."""

    def __init__(
        self,
        hit: Landmark,
        line: tuple[Pose2, tuple[float, float]],
        give_up: GiveUp,
    ) -> None:
        """Begin at a hit point.

        Args:
            hit: Where.
            line: Where it starts, and the goal.
            give_up: When to say that there is no path.
        """
        self.circuits = 0
        self._hit = hit
        self._start, self._goal = line
        self._give_up = give_up
        self._travelled = 0.0
        self._from_hit = distance(Pose2(hit.x, hit.y), *self._goal)
        self._side: float | None = None

    def step(self, step: Step) -> Verdict:
        """Decide what to do next."""
        self._travelled += step.moved
        met, nearer = self._meets_line(step.pose)
        again = self._hit.passed(step.pose) and self._travelled >= LEAST_CIRCUIT
        if met and nearer and step.free:
            return Verdict.LEAVE
        if again:
            self.circuits += 1
            return Verdict.NO_PATH
        if met and not nearer and self._give_up == GiveUp.LINE:
            away = distance(step.pose, self._hit.x, self._hit.y)
            return Verdict.NO_PATH if away > LEAST_CIRCUIT / 2 else Verdict.ONWARD
        return Verdict.ONWARD

    def _meets_line(self, pose: Pose2) -> tuple[bool, bool]:
        """Tell whether the last step crossed the line, and nearer to the goal."""
        goal_x, goal_y = self._goal
        dx, dy = goal_x - self._start.x, goal_y - self._start.y
        side = dx * (pose.y - self._start.y) - dy * (pose.x - self._start.x)
        before, self._side = self._side, side
        met = before is not None and before * side <= 0
        return met, distance(pose, goal_x, goal_y) < self._from_hit - LEAST_GAIN
