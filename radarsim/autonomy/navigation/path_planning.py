"""Path planning: along the cheapest path to the goal, on the grid as it is seen so far.

What nobody has seen counts as open, so paths are as short as they can be, and are
planned anew while the robot drives. There is no path if none is left on the grid, nor
around it, and the robot has stood and looked for a moment.

The grid holds what blocks robots, as it is seen on the way, and the cost of its cells.

Theory of operation
===================
A cell gains when a beam ends in it, and loses when a beam goes through: so what has
driven away is forgotten, and one stray echo closes nothing for long. A beam that goes
through a cell beside the very place where something was seen in it says nothing: it may
have passed a pole. Cells that nobody has seen are open. The grid covers
start and goal and a margin around them; what is beyond is left out until the grid
grows.

A radar that sends its echoes also shows what is behind a first thin hedge: a dead end
is known before the robot has driven into it.

Shortest paths and connected cells are found by compiled kernels.

The rule of passage tells where a robot's centre may be, and what a cell costs.

The centre keeps the safety distance from what blocks robots, so a passage is wide
enough if twice the safety distance, and what the sensor and the cells blur, fits in.
Where there is room, paths keep farther away. All planners that work on grids follow
this rule, so that what one of them can reach is what all can reach.
"""

import heapq
import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.autonomy.navigation.control import (
    STOP,
    Twist,
    moved,
)
from radarsim.autonomy.navigation.controller import (
    Activity,
    Controller,
    ControllerSettings,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Floats, Point, Pose2, wrap_angle
from radarsim.jit import njit_cached

COSTLY: Final = 0.4  # m beyond the safety distance, where a step costs more
COSTLY_FACTOR: Final = 3.0  # added at its inner edge to the cost of a step, which is 1
CHEAP: Final = 2.0  # cost of a step that a short cut may lead over


def step_cost(clearance: Floats, safety_distance: float) -> Floats:
    """Return the cost of a step of one cell into each; inf where none may be made.

    Args:
        clearance: (R, C) m from the centre of each cell to the nearest centre of a cell
            that blocks robots; inf if that is far away.
        safety_distance: m from the robot's centre.

    Returns:
        (R, C).
    """
    depth = np.clip(1 - (clearance - safety_distance) / COSTLY, 0.0, 1.0)
    cost: Floats = 1.0 + COSTLY_FACTOR * depth
    return np.where(clearance < safety_distance, math.inf, cost)


Cell = tuple[int, int]

_EIGHT_NEIGHBORS = np.ones((3, 3), np.bool_)


def shortest_path(
    cost: Floats, start: Cell, targets: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the cheapest path from a cell to any of the targets, over all 8 neighbors.

    Args:
        cost: (R, C) cost of a step of one cell into each; inf for closed cells.
        start: Row and column, closed or not.
        targets: (R, C).

    Returns:
        (N, 2) rows and columns, both ends included; N is 0 if there is no path, and 1
        if the start is a target.
    """
    parents = np.full(cost.shape, -1, np.int64)
    end = _search(cost, start[0], start[1], targets, parents)
    path = []
    while end >= 0:
        row, column = divmod(int(end), cost.shape[1])
        path.append((row, column))
        end = parents[row, column] if (row, column) != start else -1
    return np.array(path[::-1], np.int64).reshape(-1, 2)


def flood_fill(passable: NDArray[np.bool_], start: Cell) -> NDArray[np.bool_]:
    """Return all cells connected with the start, which is one of them, (R, C)."""
    cells = passable.copy()
    cells[start] = True
    labels, _ = ndimage.label(cells, _EIGHT_NEIGHBORS)
    return np.asarray(labels == labels[start])


def may_join_outside(passable: NDArray[np.bool_], start: Cell, end: Cell) -> bool:
    """Return whether two cells are both connected with the border of the grid.

    Then a path between them may lead around what the grid shows.
    """
    border = np.ones(passable.shape, np.bool_)
    border[1:-1, 1:-1] = False
    return all((flood_fill(passable, each) & border).any() for each in (start, end))


@njit_cached
def _search(
    cost: Floats,
    row: int,
    column: int,
    targets: NDArray[np.bool_],
    parents: NDArray[np.int64],
) -> int:
    """Visit cells by cost until one is a target (Dijkstra); return it, or -1.

    Unlike ``scipy.sparse.csgraph`` it stops at the first target, needs no graph, and
    always chooses the same of several paths of equal cost.
    """
    rows, columns = cost.shape
    best = np.full((rows, columns), np.inf)
    best[row, column] = 0.0
    queue = [(0.0, np.int64(row * columns + column))]
    while queue:
        so_far, cell = heapq.heappop(queue)
        i, j = cell // columns, cell % columns
        if so_far > best[i, j]:
            continue  # a cheaper way here has been found since this was queued
        if targets[i, j]:
            return int(cell)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                k, n = i + di, j + dj
                if not (0 <= k < rows and 0 <= n < columns):
                    continue
                total = so_far + cost[k, n] * math.sqrt(di * di + dj * dj)
                # Less, and not as much; and the queue sorts equal costs by cells. So of
                # several cheapest paths it is always the same.
                if total < best[k, n]:
                    best[k, n] = total
                    parents[k, n] = cell
                    heapq.heappush(queue, (total, np.int64(k * columns + n)))
    return -1


CELL: Final = 0.1  # m
MARGIN: Final = 8.0  # m around start and goal
MAX_DISTANCE: Final = 10.0  # m; longer beams only say that this much is free
_GAIN, _LOSS, _MOST, _LEAST = 2, 1, 10, -6  # evidence of a cell
_SHORT: Final = 0.15  # m before its end where a beam tells nothing
_BESIDE: Final = 0.015  # m beside a place that a beam still goes through


class ObstacleGrid:
    """Square cells, and the evidence that something in each blocks robots."""

    def __init__(self, points: list[Point]) -> None:
        """Create an empty grid around some points, m, map frame."""
        ends = np.array(points)
        self._corner = ends.min(axis=0) - MARGIN
        columns, rows = np.ceil((np.ptp(ends, axis=0) + 2 * MARGIN) / CELL).astype(int)
        self._evidence = np.zeros((rows, columns), np.int16)
        # what was last seen in each cell, m, map frame
        self._places = np.zeros((rows, columns, 2))

    def grow(self) -> None:
        """Add a margin on all sides; nobody has seen it."""
        width = round(MARGIN / CELL)
        self._corner = self._corner - MARGIN
        self._evidence = np.pad(self._evidence, width)
        self._places = np.pad(self._places, ((width, width), (width, width), (0, 0)))

    def clear(self) -> None:
        """Forget all that was seen."""
        self._evidence[:] = 0

    def add(self, observation: Observation) -> None:
        """Add a scan."""
        ranges, pose = observation.ranges, observation.pose
        steps = np.arange(CELL / 2, MAX_DISTANCE, CELL)
        free = steps < np.minimum(ranges, MAX_DISTANCE)[:, None] - _SHORT
        angles = observation.bearings + pose.yaw
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        points = (pose.x, pose.y) + steps[:, None] * directions[:, None]
        beams = np.broadcast_to(directions[:, None], points.shape)[free]
        passed = self._passed(points[free], beams, pose)
        ends = observation.blocking_points()
        ends = ends[np.hypot(*(ends - (pose.x, pose.y)).T) < MAX_DISTANCE]
        rows, columns, inside = self._inside(ends)
        met = np.zeros(self._evidence.shape, np.bool_)
        met[rows, columns] = True
        self._places[rows, columns] = ends[inside]
        # A cell in which one beam ends and which another passes is an edge: it gains.
        loss = np.where(self._evidence > 0, _GAIN, _LOSS)
        change = np.where(met, _GAIN, np.where(passed, -loss, 0))
        # Within limits, so that what has stood for long is forgotten soon, too.
        self._evidence = np.clip(self._evidence + change, _LEAST, _MOST).astype(
            np.int16
        )

    def _passed(self, points: Floats, beams: Floats, pose: Pose2) -> NDArray[np.bool_]:
        """Return the cells that beams go through, (R, C).

        Args:
            points: Points of the beams, (N, 2) m, map frame.
            beams: Unit vectors of their beams, (N, 2).
            pose: Where the beams come from.
        """
        rows, columns, inside = self._inside(points)
        beams = beams[inside]
        x, y = (self._places[rows, columns] - (pose.x, pose.y)).T
        off = np.abs(x * beams[:, 1] - y * beams[:, 0])
        counts = (self._evidence[rows, columns] <= 0) | (off <= _BESIDE)
        mask = np.zeros(self._evidence.shape, np.bool_)
        mask[rows[counts], columns[counts]] = True
        return mask

    def clearance(self) -> Floats:
        """Return the distance of each cell from what blocks robots, (R, C) m."""
        is_open = self._evidence <= 0
        # A distance transform needs a closed cell to measure from.
        if is_open.all():
            return np.full(is_open.shape, math.inf)
        clearance: Floats = ndimage.distance_transform_edt(is_open) * CELL
        return clearance

    def cell(self, point: Point) -> Cell:
        """Return row and column of a point; of the nearest cell, if it is outside."""
        rows, columns = self.cells(np.array([point]))
        return int(rows[0]), int(columns[0])

    def cells(self, points: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows and columns of points, (N, 2) m, as ``cell`` does."""
        places = np.floor((points - self._corner) / CELL).astype(np.int64)
        most = np.array(self._evidence.shape)[::-1] - 1
        columns, rows = np.clip(places, 0, most).T
        return rows, columns

    def centres(self, cells: NDArray[np.int64]) -> Floats:
        """Return the centres of cells, (N, 2) rows and columns, as (N, 2) m."""
        centres: Floats = self._corner + (cells[:, ::-1] + 0.5) * CELL
        return centres

    def _inside(
        self, points: Floats
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return the rows and columns of the points that are inside.

        Args:
            points: (N, 2) m.

        Returns:
            Rows and columns, (M,) each, and which points they belong to, (N,).
        """
        columns, rows = np.floor((points - self._corner) / CELL).astype(np.int64).T
        height, width = self._evidence.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        return rows[inside], columns[inside], inside


INTERVAL: Final = 0.5  # s between two plans
LOOKAHEAD: Final = 2.0  # m of a path that is cut short where the straight line is open
SURE_AFTER: Final = 5.0  # s without a path after which there is none
ESCAPE_RADIUS: Final = 1.0  # m around a robot that is too near to something
ESCAPE_COST: Final = 10.0
NEARER: Final = 10.0  # times that, nearer to it than the robot is
PAUSE: Final = 2.0  # s between two looks that are not one
APART: Final = 0.3  # m, or rad, between two scans that are kept
_MOST_GROWN: Final = 10  # margins around the first grid


class PathPlanning(Controller):
    """Planned paths; has no hit points, leave points and circuits."""

    def __init__(self, goals: Sequence[Point], settings: ControllerSettings) -> None:
        super().__init__(goals, settings)
        self._grid: ObstacleGrid | None = None
        self._scans: list[Observation] = []  # by which the grid can be drawn anew
        self._cost: Floats = np.zeros((0, 0))
        self._path: Floats = np.zeros((0, 2))
        self._planned = -math.inf  # s
        self._hopeless_since: float | None = None  # s
        self._looked_at = -math.inf  # s; when there last was no path
        self._grown = 0  # number of times that the grid has grown

    def reconsider(
        self, pose: Pose2, correct: Callable[[Observation], Observation]
    ) -> None:
        """See ``Controller``; the grid is drawn anew by what was seen."""
        super().reconsider(pose, correct)
        self._hopeless_since = None
        if self._grid is not None:
            self._grid.clear()
            self._scans = [correct(scan) for scan in self._scans]
            for scan in self._scans:
                self._grid.add(scan)

    def _begin_goal(self, _: Pose2) -> None:
        self._planned = -math.inf

    def _decide(self, observation: Observation, _: float) -> Twist:
        if observation.time >= self._planned + INTERVAL:
            self._plan(observation)
        if not len(self._path):
            return self._look(observation)
        self._hopeless_since = None
        return self._head_for(observation, self._next_point(observation.pose))

    def _plan(self, observation: Observation) -> None:
        """Add the scan to the grid, and plan a path on it."""
        pose, goal = observation.pose, self.goals[0]
        if self._grid is None:
            self._grid = ObstacleGrid([(pose.x, pose.y), *self.goals])
        self._grid.add(observation)
        if not self._scans or _are_apart(self._scans[-1].pose, pose):
            self._scans.append(observation)
        self._planned = observation.time
        clearance = self._grid.clearance()
        cost = step_cost(clearance, self._settings.bumpers.safety_distance)
        start, end = self._grid.cell((pose.x, pose.y)), self._grid.cell(goal)
        # It is too near to something, by noise or as that has moved: it may leave, and
        # come nearer only where there is no other way.
        if not math.isfinite(cost[start]):
            rows, columns = np.indices(cost.shape)
            near = np.hypot(rows - start[0], columns - start[1]) * CELL < ESCAPE_RADIUS
            near &= ~np.isfinite(cost)
            cost[near] = ESCAPE_COST
            cost[near & (clearance < clearance[start])] *= NEARER
        targets = np.zeros(cost.shape, np.bool_)
        targets[end] = True
        self._cost = cost
        self._path = self._grid.centres(shortest_path(cost, start, targets))
        if len(self._path):
            # The centre of its cell may be 7 cm off, of the 10 that are allowed.
            self._path[-1] = goal
        elif self._grown < _MOST_GROWN and may_join_outside(
            np.isfinite(cost), start, end
        ):
            self._grid.grow()
            self._grown += 1
            # On the larger grid nothing has been planned yet.
            self._hopeless_since = None

    def _look(self, observation: Observation) -> Twist:
        """Stand where there is no path; if none appears, there is none."""
        looked, self._looked_at = self._looked_at, observation.time
        # Who waited meanwhile for something that moves has not looked.
        if self._hopeless_since is None or observation.time > looked + PAUSE:
            self._hopeless_since = observation.time
        if observation.time - self._hopeless_since >= SURE_AFTER:
            self.activity = Activity.NO_PATH
        return STOP

    def _next_point(self, pose: Pose2) -> Point:
        """Return the farthest point of the path to which the straight line is open."""
        distances = np.hypot(*(self._path - (pose.x, pose.y)).T)
        nearest = int(distances.argmin())
        ahead, away = self._path[nearest:], distances[nearest:]
        within = int((away > LOOKAHEAD).argmax()) if away.max() > LOOKAHEAD else None
        # Never nearer, as a robot that heads for where it is turns on the spot forever.
        chosen = ahead[min(2, len(ahead) - 1)]
        for point in ahead[:within][::-1]:
            if self._is_cheap(pose, point):
                chosen = point
                break
        return float(chosen[0]), float(chosen[1])

    def _is_cheap(self, pose: Pose2, point: Floats) -> bool:
        """Return whether the straight line to a point costs little more than open."""
        assert self._grid is not None
        end = Pose2(float(point[0]), float(point[1]))
        count = max(2, math.ceil(moved(pose, end) / CELL * 2))
        line = np.linspace((pose.x, pose.y), (end.x, end.y), count)
        costs = self._cost[self._grid.cells(line)]
        # Near a wall, or at a goal beside one, the ends cost more than that themselves.
        return bool(costs.max() <= max(CHEAP, costs[0], costs[-1]))


def _are_apart(one: Pose2, other: Pose2) -> bool:
    """Return whether a scan from another pose shows more."""
    return moved(one, other) > APART or abs(wrap_angle(one.yaw - other.yaw)) > APART
