"""What Bug1 and Bug2 do at a boundary: how long to follow it, and where to leave it.

Theory of operation
===================
Bug1 drives all the way around, notes where it is nearest to the goal, and drives back
there the shorter way round. If the goal's direction leads into the obstacle there,
there is no path. Bug2 leaves where it meets the line from start to goal again, nearer
to the goal than at the hit point, unless the line leads into the obstacle there.

When Bug2 gives up is an option. Choset and others: when it meets its hit point, here
or another point of its own path, again. The thesis: already when it meets the line
and is no nearer to the goal there, which gives up on maps that have a path.

Poses drift, so the very same point is never met again. But a robot that follows the
same boundary in the same direction crosses the line perpendicular to its path there,
not far from the point. So a point is recognised by that line: a landmark.

Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2; a
thesis on navigation with a radar in USARSim, section 5.1.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import Enum, auto

from radarsim.autonomy.navigation.control import distance
from radarsim.autonomy.plans import GiveUp
from radarsim.geometry import Point, Pose2

LEAST_CIRCUIT = 1.5  # m; a shorter closed path is no circuit
SPACING = 2.0  # m between landmarks on a boundary
AT_LINE = 0.1  # m beside the line to the goal that still count as on it
LEAST_GAIN = 0.1  # m nearer to the goal that count as nearer


class Landmark:
    """A point of a path, and the direction of the path there.

    Attributes:
        x: m, map frame.
        y: m, map frame.
        direction: rad, map frame.
    """

    def __init__(self, pose: Pose2, direction: float, *, max_offset: float) -> None:
        """Create a landmark.

        Args:
            pose: A pose at the point.
            direction: Direction of the path, rad, map frame.
            max_offset: How far beside the point a path still passes it, m.
        """
        self.x, self.y = pose.x, pose.y
        self.direction = direction
        self._max_offset = max_offset
        self._progress = 0.0  # m past the landmark, along its direction

    def observe(self, pose: Pose2, *, onward: bool = True) -> bool:
        """Take the next pose of a path; return whether it has just passed this point.

        Args:
            pose: The robot's pose now.
            onward: Whether the pass counts along the landmark's direction, or against.
        """
        dx, dy = pose.x - self.x, pose.y - self.y
        c, s = math.cos(self.direction), math.sin(self.direction)
        before, self._progress = self._progress, c * dx + s * dy
        offset = abs(c * dy - s * dx)
        # Only now that the progress is noted, or a later step would seem to pass it.
        if offset > self._max_offset:
            return False
        return before < 0 <= self._progress if onward else before > 0 >= self._progress


class Decision(Enum):
    """What to do next at a boundary."""

    ONWARD = auto()
    BACK = auto()  # along the same boundary, in the other direction
    LEAVE = auto()
    NO_PATH = auto()


class Trail:
    """Landmarks along a boundary, the hit point first; passing one closes a circuit.

    The hit point itself may lie off the path of a robot that follows the boundary. Then
    the first landmark on that path closes the circuit.
    """

    def __init__(self, hit: Landmark, max_offset: float) -> None:
        self._landmarks = [(0.0, hit)]
        self._max_offset = max_offset

    def extend(self, pose: Pose2, direction: float, travelled: float) -> float | None:
        """Take the next step, and set a landmark there if it is time for one.

        Args:
            pose: Of the robot.
            direction: Of the boundary, rad, map frame.
            travelled: Path length since the hit point, m.

        Returns:
            Where along the trail the landmark is that was passed again: the path length
            from the hit point, m; None if none was.
        """
        # Each of them has to see every step.
        passed = [at for at, mark in self._landmarks if mark.observe(pose)]
        if travelled - self._landmarks[-1][0] >= SPACING:
            mark = Landmark(pose, direction, max_offset=self._max_offset)
            self._landmarks.append((travelled, mark))
        # The landmarks that were just set are passed by noise alone.
        closing = [at for at in passed if travelled - at >= LEAST_CIRCUIT]
        return closing[0] if closing else None


class BoundaryPolicy(ABC):
    """Decides, step by step, how long to follow one boundary.

    Attributes:
        circuits: Number of complete circuits.
        missed: Whether it leaves because the leave point was not found again.
        circuit_start: Where on the path from the hit point the last circuit began, m.
    """

    def __init__(self, hit: Landmark, goal: Point, max_offset: float) -> None:
        """Create the policy at a hit point.

        Args:
            hit: The hit point.
            goal: m, map frame.
            max_offset: How far beside a landmark a path still passes it, m.
        """
        self.circuits = 0
        self.missed = False
        self.circuit_start = 0.0
        self._trail = Trail(hit, max_offset)
        self._max_offset = max_offset
        self._goal = goal
        self._travelled = 0.0

    def step(
        self, pose: Pose2, moved: float, direction: float, *, free: bool
    ) -> Decision:
        """Decide what to do next.

        Args:
            pose: Of the robot.
            moved: Distance from the pose of the step before, m.
            direction: Of the boundary, rad, map frame.
            free: Whether the boundary is not between the robot and the goal; another
                obstacle may be.
        """
        self._travelled += moved
        return self._decide(pose, direction, free=free)

    @abstractmethod
    def _decide(self, pose: Pose2, direction: float, *, free: bool) -> Decision: ...


class Bug1Policy(BoundaryPolicy):
    """Bug1: all the way around, then to the point nearest to the goal."""

    def __init__(self, hit: Landmark, goal: Point, max_offset: float) -> None:
        super().__init__(hit, goal, max_offset)
        # goal distance, path length, pose and direction of every step
        self._steps: list[tuple[float, float, Pose2, float]] = []
        self._leave = hit
        self._perimeter = math.nan
        self._return_length = math.nan
        self._onward = True
        self._turned_back = False

    def _decide(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        if self.circuits:
            return self._return(pose, free=free)
        return self._circle(pose, direction)

    def _circle(self, pose: Pose2, direction: float) -> Decision:
        goal_distance = distance(pose, *self._goal)
        self._steps.append((goal_distance, self._travelled, pose, direction))
        began = self._trail.extend(pose, direction, self._travelled)
        if began is None:
            return Decision.ONWARD
        self.circuits, self.circuit_start = 1, began
        # Only steps of the circuit: the way to where it began may not be part of it.
        _, at, nearest, direction = min(
            (each for each in self._steps if each[1] >= began), key=lambda each: each[0]
        )
        self._leave = Landmark(nearest, direction, max_offset=self._max_offset)
        self._leave.observe(pose)  # from here on it knows on which side it is
        self._perimeter = self._travelled - began
        back = self._travelled - at
        self._onward = at - began <= back
        self._return_length = min(at - began, back)
        self._travelled = 0.0
        return Decision.ONWARD if self._onward else Decision.BACK

    def _return(self, pose: Pose2, *, free: bool) -> Decision:
        passed = self._leave.observe(pose, onward=self._onward)
        # Poses drift, so the way back may measure shorter or longer than the way there.
        slack = max(1.0, 0.2 * self._return_length)
        close = distance(pose, self._leave.x, self._leave.y) < LEAST_GAIN
        # Before that the robot may pass the landmark on another side of the obstacle.
        due = self._turned_back or self._travelled >= self._return_length - slack
        if due and (passed or close):
            # A robot that lost its path cannot tell which obstacle hides the goal here
            self.missed = self._turned_back
            blocked = not free and not self.missed
            return Decision.NO_PATH if blocked else Decision.LEAVE
        if self._travelled > self._return_length + 2 * slack:
            # It turns back once, for up to a whole circuit; then it leaves anywhere.
            if self._turned_back:
                self.missed = True
                return Decision.LEAVE
            self._turned_back = True
            self._onward = not self._onward
            self._return_length, self._travelled = self._perimeter, 0.0
            return Decision.BACK
        return Decision.ONWARD


class Bug2Policy(BoundaryPolicy):
    """Bug2: until the line to the goal is met, nearer to the goal."""

    def __init__(
        self,
        hit: Landmark,
        goal: Point,
        max_offset: float,
        *,
        starts: Sequence[Pose2],
        give_up: GiveUp,
    ) -> None:
        """Create the policy at a hit point.

        Args:
            hit: The hit point.
            goal: m, map frame.
            max_offset: How far beside a landmark a path still passes it, m.
            starts: Starts of the lines to the goal, at any of which it leaves; at least
                one. Where it gives up at a line, that is the last one.
            give_up: When to conclude that there is no path.
        """
        super().__init__(hit, goal, max_offset)
        self._hit = hit
        self._lines = [_Line(start, goal) for start in starts]
        self._give_up = give_up
        self._hit_distance = distance(Pose2(hit.x, hit.y), *goal)

    def _decide(self, pose: Pose2, direction: float, *, free: bool) -> Decision:
        # All lines are asked, since each remembers on which side the robot was.
        met = [line.meets(pose) for line in self._lines]
        at_line, crossed = any(at for at, _ in met), met[-1][1]
        nearer = distance(pose, *self._goal) < self._hit_distance - LEAST_GAIN
        # Before anything is decided: the landmarks have to see every step, too.
        began = self._trail.extend(pose, direction, self._travelled)
        if at_line and nearer and free:
            return Decision.LEAVE
        if began is not None:
            self.circuits, self.circuit_start = self.circuits + 1, began
            return Decision.NO_PATH
        if crossed and not nearer and self._give_up == GiveUp.LINE:
            # At its hit point the robot is at the line as well.
            away = distance(pose, self._hit.x, self._hit.y)
            return Decision.NO_PATH if away > LEAST_CIRCUIT / 2 else Decision.ONWARD
        return Decision.ONWARD


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
