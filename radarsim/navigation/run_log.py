"""What a run was like, moment by moment: for traces and pictures."""

import csv
import io
import math
from collections import Counter
from dataclasses import astuple, dataclass, fields

import numpy as np

from radarsim.geometry import Floats, wrap_angle
from radarsim.navigation.bug import Activity, Point
from radarsim.navigation.runner import NavigationStep

TRACE_NAMES = {"activity": "doing"}  # columns of a trace that are named otherwise
CELL = 0.05  # m; of sensed points that share a square of this size, one is kept
AT_BOUNDARY = frozenset({Activity.ALIGNING, Activity.FOLLOWING, Activity.RETURNING})
_ROWS = 2**31  # of squares; the number of a square is column * _ROWS + row
_DIGITS = 4  # of metres and radians in a trace


@dataclass(frozen=True, slots=True)
class Row:
    """One moment without its scan.

    Attributes:
        time: s of the server.
        x: Where the robot took itself to be, m, map frame.
        y: m.
        yaw: rad.
        activity: What the bug was at.
        goal_x: The next goal's, m; None once there is none.
        goal_y: m.
        speed: What the bug wanted, m/s.
        turn: rad/s.
        nearest: The smallest range from the robot's centre, m; ``inf`` for none.
        pressed: The bumpers that were pressed or too near, with blanks between them.
    """

    time: float
    x: float
    y: float
    yaw: float
    activity: Activity
    goal_x: float | None
    goal_y: float | None
    speed: float
    turn: float
    nearest: float
    pressed: str

    @property
    def goal(self) -> Point | None:
        """The next goal, m; None once there is none."""
        if self.goal_x is None or self.goal_y is None:
            return None
        return self.goal_x, self.goal_y

    @property
    def goal_distance(self) -> float:
        """To the next goal, m; 0 once there is none."""
        goal = self.goal
        return 0.0 if goal is None else math.hypot(goal[0] - self.x, goal[1] - self.y)


@dataclass(frozen=True, slots=True)
class GoalLine:
    """The straight line from where the robot set out for a goal to that goal, m."""

    start: Point
    goal: Point


class RunLog:
    """Keeps a run.

    Attributes:
        rows: One for each scan.
        hit_points: Where obstacles were met, m, map frame.
        leave_points: Where they were left.
        goal_lines: The lines that were to be followed.
        circuits: How often the robot set out for a leave point after going all round.
        path_length: Of the way, m.
    """

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.hit_points: list[Point] = []
        self.leave_points: list[Point] = []
        self.goal_lines: list[GoalLine] = []
        self.circuits = 0
        self.path_length = 0.0
        self._cells: Counter[int] = Counter()

    def add(self, moment: NavigationStep) -> Row:
        """Keep a moment, and give what is kept of it."""
        row = _row(moment)
        self._note(self.rows[-1] if self.rows else None, row)
        self.rows.append(row)
        columns, rows = np.floor(moment.observation.points() / CELL).astype(np.int64).T
        self._cells.update((columns * _ROWS + rows).tolist())
        return row

    @property
    def time(self) -> float:
        """From the first scan to the last, s."""
        return self.rows[-1].time - self.rows[0].time if self.rows else 0.0

    @property
    def nearest(self) -> float:
        """The smallest range from the robot's centre, m; ``inf`` for none."""
        return min((row.nearest for row in self.rows), default=math.inf)

    @property
    def path(self) -> Floats:
        """Where the robot took itself to be, (N, 2) m."""
        return np.array([(row.x, row.y) for row in self.rows]).reshape(-1, 2)

    @property
    def beam_ends(self) -> Floats:
        """Where beams ended: x and y in m, and how many did, (M, 3).

        All that ended in one square of 5 cm are in its middle.
        """
        numbers = sorted(self._cells)
        cells = np.array(numbers, dtype=np.int64)
        columns = (cells + _ROWS // 2) // _ROWS
        places = np.column_stack([columns, cells - columns * _ROWS])
        counts = [self._cells[number] for number in numbers]
        return np.column_stack([(places + 0.5) * CELL, counts])

    def as_csv(self) -> str:
        """Give a row for each scan; what there is none of is empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        names = (field.name for field in fields(Row))
        writer.writerow(TRACE_NAMES.get(name, name) for name in names)
        writer.writerows(map(_cell, astuple(row)) for row in self.rows)
        return text.getvalue()

    def _note(self, before: Row | None, row: Row) -> None:
        """Note what has changed: goals, hit points, leave points."""
        here = (row.x, row.y)
        same_goal = before is not None and before.goal == row.goal
        was_at_boundary = before is not None and before.activity in AT_BOUNDARY
        if row.goal is not None and not same_goal:
            self.goal_lines.append(GoalLine(here, row.goal))
        if row.activity in AT_BOUNDARY and not (was_at_boundary and same_goal):
            self.hit_points.append(here)
        if row.activity is Activity.GOING and was_at_boundary and same_goal:
            self.leave_points.append(here)
        if before is not None:
            self.path_length += math.hypot(row.x - before.x, row.y - before.y)
            self.circuits += before.activity != row.activity == Activity.RETURNING


def _row(moment: NavigationStep) -> Row:
    observation, twist = moment.observation, moment.twist
    goal_x, goal_y = moment.goal or (None, None)
    return Row(
        observation.time,
        observation.pose.x,
        observation.pose.y,
        wrap_angle(observation.pose.yaw),
        moment.activity,
        goal_x,
        goal_y,
        twist.speed,
        twist.turn,
        float(observation.ranges.min(initial=math.inf)),
        " ".join(moment.pressed),
    )


def _cell(value: object) -> object:
    if not isinstance(value, float):
        return value
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
