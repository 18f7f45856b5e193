"""Log of a run: a row for each scan, from which traces and plots are made."""

import csv
import io
import math
from collections import Counter
from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np

from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.runner import NavigationStep
from radarsim.geometry import Floats, Point, wrap_angle

CELL = 0.05  # m; end points of beams are counted in square cells of this size
AT_BOUNDARY = frozenset({Activity.ALIGNING, Activity.FOLLOWING, Activity.RETURNING})
# first line of a trace file: the names of the columns
TRACE_HEADER = "time,x,y,yaw,doing,goal_x,goal_y,speed,turn,nearest,pressed\n"
_DIGITS = 4  # for metres and radians in a trace


@dataclass(frozen=True, slots=True)
class Row:
    """The state of a run at one scan: one row of the trace file.

    Attributes:
        time: Server time, s.
        x: Estimated position of the robot, m, map frame.
        y: m, map frame.
        yaw: Estimated yaw, rad.
        activity: Activity of the controller.
        goal: The next goal, m, map frame; None once there is none.
        speed: Commanded forward speed, m/s.
        turn: Commanded turn rate, rad/s.
        nearest: Shortest range from the robot's centre, m; ``inf`` without a return.
        pressed: Names of the bumpers that were pressed or too near, separated by
            blanks.
    """

    time: float
    x: float
    y: float
    yaw: float
    activity: Activity
    goal: Point | None
    speed: float
    turn: float
    nearest: float
    pressed: str

    @property
    def goal_distance(self) -> float:
        """Distance from the robot to its next goal, m; 0 after the last goal."""
        goal = self.goal
        return 0.0 if goal is None else math.hypot(goal[0] - self.x, goal[1] - self.y)


@dataclass(slots=True)
class Leg:
    """One leg of a run: the part on the way to one goal.

    Attributes:
        start: Position where the robot first headed for the goal, m, map frame.
        goal: Position of the goal, m, map frame.
        began: Time at the start, s.
        ended: Time at the goal, or at the end of the run, s.
        path_length: Length of the estimated path, m.
        hit_points: Positions where the robot hit boundaries, m, map frame.
        leave_points: Positions where the robot left boundaries, m, map frame.
    """

    start: Point
    goal: Point
    began: float
    ended: float
    path_length: float = 0.0
    hit_points: list[Point] = field(default_factory=list)
    leave_points: list[Point] = field(default_factory=list)


def rounded(value: Any, digits: int) -> Any:
    """Return a value with all numbers rounded; nan and infinite numbers become None."""
    if isinstance(value, dict):
        return {key: rounded(each, digits) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each, digits) for each in value]
    if isinstance(value, float):
        # Adding zero turns -0.0 into 0.0, so both are written alike.
        return round(value, digits) + 0.0 if math.isfinite(value) else None
    return value


class RunLog:
    """Records a navigation run, scan by scan.

    Attributes:
        rows: One row for each scan.
        legs: The parts of the run, one for each goal so far.
        circuits: Number of complete circuits after which the robot headed for a leave
            point.
        path_length: Length of the estimated path, m.
    """

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.legs: list[Leg] = []
        self.circuits = 0
        self.path_length = 0.0
        self._cells: Counter[tuple[int, ...]] = Counter()

    def add(self, step: NavigationStep) -> Row:
        """Record one scan of the run, and return its row."""
        observation, twist, pose = step.observation, step.twist, step.observation.pose
        row = Row(
            observation.time,
            pose.x,
            pose.y,
            wrap_angle(pose.yaw),
            step.activity,
            step.goal,
            twist.speed,
            twist.turn,
            float(observation.ranges.min(initial=math.inf)),
            " ".join(step.pressed),
        )
        self._update(self.rows[-1] if self.rows else None, row)
        self.rows.append(row)
        cells = np.floor(step.observation.points() / CELL).astype(np.int64)
        self._cells.update(map(tuple, cells.tolist()))
        return row

    @property
    def hit_points(self) -> list[Point]:
        """Hit points of all legs, m, map frame."""
        return [point for leg in self.legs for point in leg.hit_points]

    @property
    def leave_points(self) -> list[Point]:
        """Leave points of all legs, m, map frame."""
        return [point for leg in self.legs for point in leg.leave_points]

    @property
    def time(self) -> float:
        """Time from the first scan to the last, s."""
        return self.rows[-1].time - self.rows[0].time if self.rows else 0.0

    @property
    def nearest(self) -> float:
        """The shortest range of the run from the robot's centre, m; ``inf`` if none."""
        return min((row.nearest for row in self.rows), default=math.inf)

    @property
    def path(self) -> Floats:
        """The path of the robot: its estimated positions, (N, 2) m, map frame."""
        return np.array([(row.x, row.y) for row in self.rows]).reshape(-1, 2)

    @property
    def beam_ends(self) -> Floats:
        """Cells where beams ended: x and y in m, and the number of beams, (M, 3).

        End points in one cell of 5 cm are counted together at its centre.
        """
        cells = sorted(self._cells)
        centres = (np.array(cells).reshape(-1, 2) + 0.5) * CELL
        return np.column_stack([centres, [self._cells[cell] for cell in cells]])

    def as_csv(self) -> str:
        """Return the trace as CSV: a row for each scan, with empty fields for None."""
        text = io.StringIO()
        text.write(TRACE_HEADER)
        writer = csv.writer(text, lineterminator="\n")
        for row in self.rows:
            # The goal is written as two columns, x and y.
            *before, goal, speed, turn, nearest, pressed = astuple(row)
            values = *before, *(goal or (None, None)), speed, turn, nearest, pressed
            writer.writerow(rounded(values, _DIGITS))
        return text.getvalue()

    def _update(self, previous: Row | None, row: Row) -> None:
        here = (row.x, row.y)
        # At each goal, the controller starts new lists of hit points and leave points.
        same_goal = previous is not None and previous.goal == row.goal
        was_at_boundary = previous is not None and previous.activity in AT_BOUNDARY
        if previous is not None:
            step = math.hypot(row.x - previous.x, row.y - previous.y)
            self.path_length += step
            # This step was driven towards the previous
            # goal, even if a new goal starts here.
            for leg in self.legs[-1:]:
                leg.path_length += step
                leg.ended = row.time
        if row.goal is not None and not same_goal:
            self.legs.append(Leg(here, row.goal, row.time, row.time))
        if row.activity in AT_BOUNDARY and not (was_at_boundary and same_goal):
            self.legs[-1].hit_points.append(here)
        if row.activity is Activity.GOING and was_at_boundary and same_goal:
            self.legs[-1].leave_points.append(here)
        if previous is not None:
            self.circuits += previous.activity != row.activity == Activity.RETURNING
