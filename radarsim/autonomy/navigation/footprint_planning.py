"""Path planning for a rectangular footprint, through gaps too narrow for a disc.

Theory of operation
===================
A path is a sequence of motions: turns on the spot, and straight motions along the
robot's axis, forward or backward, as a differential-drive robot makes them. A* searches
for the cheapest path over cells and 16 headings, each of which leads from the centre of
a cell to the centre of another cell. The grid is aligned with the robot's pose, so any
start pose is one of its states.

For each cell a mask stores the orientations in which seen points are within the margins
around the rectangle. The points are rounded to a centimetre, since the margins are no
wider. A turn also checks the orientation between two headings; between these the
corners of the footprint reach less than the least margin farther out.

The cost of the same path for a robot that can move in all directions is the heuristic.
The search begins only after a check that a path exists, since it would otherwise visit
all poses to find that there is none. At the end straight motions replace detours of the
lattice where they keep the same clearance. Their clearance is exact: a straight motion
sweeps a rectangle.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.grid_search import path_costs
from radarsim.engine import engine
from radarsim.geometry import Floats, Point, Pose2, wrap_angle

CELL: Final = 0.05  # m
LEAST_MARGIN: Final = 0.02  # m around the footprint that has to be free
MARGINS: Final = (LEAST_MARGIN, 0.05, 0.1)  # m; the wider ones raise the cost
MORE: Final = (3.0, 1.0)  # extra cost per metre within each wider margin
REVERSE: Final = 2.0  # times the cost of driving forward
TURN: Final = 0.1  # m; a turn to the next heading costs as much as this distance
AROUND: Final = 1.0  # m around all seen points in which paths are searched
_PARTS: Final = 5  # parts of a cell per axis, to which points are rounded
SLACK: Final = 0.01  # m; error of rounded positions
_ANGLE: Final = math.radians(3)  # rad between two checked poses of a turn
_NEAR: Final = 0.5  # m from a path, beyond which clearances are ignored
# Steps of one motion, in cells, for half of the headings; the others are opposite.
_AHEAD: Final = ((1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1))
_HEADINGS: Final = np.array([*_AHEAD, *((-x, -y) for x, y in _AHEAD)], np.int64)
_LENGTHS: Final = np.hypot(*_HEADINGS.T) * CELL
# Costs of the motions at each heading: forward, backward, turn left and turn right.
_COSTS: Final = np.column_stack([_LENGTHS, _LENGTHS * REVERSE, *np.full((2, 16), TURN)])
# Greatest ratio of a path's length on a grid with 8 neighbours to its length on a grid
# with 16 neighbours.
_LONGER: Final = (1 + math.sqrt(2)) / math.sqrt(5)
# Number of mask bits per margin: one for each heading in half a circle, and one for
# each angle between two headings.
_BITS: Final = 16


@dataclass(frozen=True, slots=True)
class Footprint:
    """A rectangle centred on the robot; computes its distance from obstacle points.

    Attributes:
        length: Length along the robot's axis, m.
        width: Width across the robot's axis, m.
    """

    length: float
    width: float

    @property
    def radius(self) -> float:
        """Half the diagonal of the footprint, m."""
        return math.hypot(self.length, self.width) / 2

    def distances(
        self, points: Floats, poses: Floats, longer: float | Floats = 0.0
    ) -> Floats:
        """Return distances, (P, N) m, of points from the footprint at poses; 0 inside.

        Args:
            points: (N, 2) m.
            poses: (P, 3) m and rad.
            longer: Length to add to the footprint, m; a number, or (P, 1).
        """
        c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        x, y = points[:, 0] - poses[:, :1], points[:, 1] - poses[:, 1:2]
        along = np.abs(c * x + s * y) - (self.length + longer) / 2
        across = np.abs(c * y - s * x) - self.width / 2
        outside: Floats = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        return outside

    def clearance(self, points: Floats, pose: Floats) -> float:
        """Return the distance, m, from the footprint at a pose to the nearest point."""
        return float(self.distances(points, pose[None]).min(initial=math.inf))

    def motion_clearance(self, points: Floats, begin: Floats, end: Floats) -> float:
        """Return the least distance, m, of points from the footprint during a motion.

        Args:
            points: (N, 2) m.
            begin: (3,) m and rad.
            end: (3,) m and rad, at the same position or with the same heading as begin.
        """
        way, middle = math.dist(begin[:2], end[:2]), (begin[:2] + end[:2]) / 2
        reach = self.radius + _NEAR + way / 2
        near = points[np.hypot(*(points - middle).T) < reach]
        if way:
            pose = np.array([[*middle, end[2]]])
            return float(self.distances(near, pose, way).min(initial=_NEAR))
        turn = wrap_angle(end[2] - begin[2])
        yaws = begin[2] + np.linspace(0.0, turn, 2 + int(abs(turn) / _ANGLE))
        poses = np.column_stack([np.tile(begin[:2], (len(yaws), 1)), yaws])
        return float(self.distances(near, poses).min(initial=_NEAR))

    def clearances(self, points: Floats, poses: Floats) -> Floats:
        """Return the clearance of each motion between successive poses, (P - 1,) m."""
        pairs = itertools.pairwise(poses)
        return np.array([self.motion_clearance(points, *pair) for pair in pairs])


def plan_footprint(
    footprint: Footprint, points: Floats, start: Pose2, goal: Point
) -> Floats | None:
    """Plan a path of a rectangular footprint between obstacle points.

    No motion comes closer to a point than the least margin, less a centimetre, or than
    the clearance at the start if that is smaller.

    Args:
        footprint: The footprint.
        points: Obstacle points, (N, 2) m.
        start: Pose of the robot, m and rad.
        goal: m; the path ends in the cell that holds it, and at the goal itself if the
            footprint can turn there.

    Returns:
        (P, 3) m and rad, from the start on; between successive poses the robot turns on
        the spot or moves along its axis. None if there is no path.
    """
    grid = _PoseGrid(footprint, points, start, goal)
    path = grid.search()
    if path is None:
        return None
    way = goal - path[-1, :2]
    yaw = math.atan2(way[1], way[0])
    end = np.array([path[-1], [*path[-1, :2], yaw], [*goal, yaw]])
    if way.any() and footprint.clearances(points, end).min() >= LEAST_MARGIN:
        path = np.vstack([path, end[1:]])
    return _shortened(footprint, points, path)


class _PoseGrid:
    """A grid of robot poses, with masks of the poses that are close to obstacles."""

    def __init__(
        self, footprint: Footprint, points: Floats, start: Pose2, goal: Point
    ) -> None:
        self._start = start
        c, s = math.cos(start.yaw), math.sin(start.yaw)
        self._turned = np.array([[c, -s], [s, c]])  # rotates rows to the map frame
        places = np.vstack([points, [goal], [[start.x, start.y]]])
        places = (places - (start.x, start.y)) @ self._turned
        low = np.floor((places.min(axis=0) - AROUND) / CELL)
        high = np.ceil((places.max(axis=0) + AROUND) / CELL)
        self._first = low.astype(np.int64)  # column and row of the first cell
        columns, rows = (high - low).astype(np.int64) + 1
        self._shape = int(rows), int(columns)
        clearance = footprint.clearance(points, np.array([start.x, start.y, start.yaw]))
        least = min(LEAST_MARGIN, clearance - SLACK)
        self._masks = self._mask(footprint, places[:-2], least)
        column, row = np.rint(places[-2] / CELL).astype(np.int64) - self._first
        self._goal = int(row) * self._shape[1] + int(column)

    def _mask(
        self, footprint: Footprint, places: Floats, least: float
    ) -> NDArray[np.int64]:
        """Return a mask for each cell, (R, C), of the headings too close to obstacles.

        Args:
            footprint: The footprint.
            places: Obstacle points, (N, 2) m, in the frame of the grid.
            least: Least margin, m; below 0 for a slightly smaller footprint.
        """
        rows, columns = self._shape
        masks = np.zeros(rows * columns, np.int64)
        parts = np.floor((places / CELL + 0.5) * _PARTS).astype(np.int64)
        parts = np.unique(parts, axis=0)
        cells, parts = np.divmod(parts, _PARTS)
        numbers = (cells - self._first) @ np.array([1, columns])
        reach = math.ceil((footprint.radius + MARGINS[-1]) / CELL) + 1
        steps = np.arange(-reach, reach + 1)
        shifts = np.array([(dx, dy) for dx in steps for dy in steps])
        for part in np.ndindex(_PARTS, _PARTS):
            chosen = numbers[(parts == part).all(axis=1)]
            # vectors to the obstacle point from the centres of the surrounding cells
            ways = ((np.array(part) + 0.5) / _PARTS - 0.5 - shifts) * CELL
            bits = _bits(footprint, ways, least)
            for (dx, dy), bit in zip(shifts[bits > 0], bits[bits > 0], strict=True):
                masks[chosen + (dx + dy * columns)] |= bit
        return masks.reshape(rows, columns)

    def search(self) -> Floats | None:
        """Return the poses of the cheapest path, (P, 3), map frame; None if none."""
        rows, columns = self._shape
        cost = np.ones(self._shape)
        column, row = -self._first
        start = int(row) * columns + int(column)
        if not engine.are_joined(self._masks, _HEADINGS, start, self._goal):
            return None
        even = sum(1 << bit for bit in range(0, _BITS, 2))
        for level, more in enumerate(MORE, start=1):
            # The cost is added to cells where, at every heading, the footprint is
            # within the margin of an obstacle point.
            cost += more * ((self._masks >> level * _BITS) & even == even)
        cost[self._masks & even == even] = math.inf
        guide = path_costs(cost, divmod(self._goal, columns)) * (CELL / _LONGER)
        if not math.isfinite(guide.flat[start]):
            return None
        # The number of a state is 16 times its cell number plus its heading number.
        parents = np.zeros((rows * columns, len(_HEADINGS)), np.int32)
        state = engine.search_states(
            self._masks, _HEADINGS, _COSTS, *MORE, guide, start, self._goal, parents
        )
        if state < 0:
            return None
        states = [state]
        while before := int(parents.flat[states[-1]]):
            states.append(before - 1)
        cells, headings = np.divmod(np.array(states[::-1], np.int64), len(_HEADINGS))
        places = np.column_stack([cells % columns, cells // columns]) + self._first
        poses = places * CELL @ self._turned.T + (self._start.x, self._start.y)
        yaws = np.arctan2(*_HEADINGS[headings].T[::-1]) + self._start.yaw
        return np.column_stack([poses, yaws])


def _bits(footprint: Footprint, ways: Floats, least: float) -> NDArray[np.int64]:
    """Return the mask bits that an obstacle point sets in the cells around it.

    Args:
        footprint: The footprint.
        ways: (N, 2) m, vectors from the centres of the cells to the point.
        least: Least margin, m.

    Returns:
        (N,); a bit for each margin and orientation in which the point is too close.
    """
    yaws = np.arctan2(*_HEADINGS.T[::-1])[: _BITS // 2 + 1]
    yaws[-1] = math.pi
    turns = np.zeros(_BITS)
    turns[::2] = yaws[:-1]
    turns[1::2] = (yaws[:-1] + yaws[1:]) / 2
    poses = np.column_stack([np.zeros((_BITS, 2)), turns])
    smaller = min(least, 0.0)
    inner = Footprint(footprint.length + 2 * smaller, footprint.width + 2 * smaller)
    distances = inner.distances(ways, poses) + smaller
    mask = np.zeros(len(ways), np.int64)
    for level, margin in enumerate((least, *MARGINS[1:])):
        for bit, row in enumerate(distances):
            mask |= (row <= margin).astype(np.int64) << (level * _BITS + bit)
    return mask


def _shortened(footprint: Footprint, points: Floats, path: Floats) -> Floats:
    """Return the path, (P, 3), with straight motions in place of detours.

    Straight motions keep the clearance of the detours, or the widest margin.
    """
    path = _merged(path)
    clearances = footprint.clearances(points, path)
    is_leg = (np.diff(path[:, :2], axis=0) != 0).any(axis=1)
    ahead = np.column_stack([np.cos(path[1:, 2]), np.sin(path[1:, 2])])
    is_back = is_leg & ((np.diff(path[:, :2], axis=0) * ahead).sum(axis=1) < 0)
    done, i = [path[0]], 0
    while i < len(path) - 1:
        # Motions are joined only up to the next backward motion.
        limit = i + int(np.append(is_back[i:], True).argmax())
        for j in range(limit, i + 1, -1):
            way = path[j, :2] - path[i, :2]
            if not way.any():
                continue
            yaw = math.atan2(way[1], way[0])
            # The robot turns, drives straight, and turns to the path's next heading.
            motions = np.array(
                [done[-1], [*path[i, :2], yaw], [*path[j, :2], yaw], path[j]]
            )
            needed = min(MARGINS[-1], clearances[i:j].min())
            if footprint.clearances(points, motions).min() >= needed:
                done += list(motions[1:])
                i = j
                break
        else:
            i += 1
            done.append(path[i])
    return _merged(np.array(done))


def _merged(path: Floats) -> Floats:
    """Merge successive turns of a path, and successive motions along one line."""
    kept = [path[0]]
    for pose, after in zip(path[1:], [*path[2:], None], strict=True):
        if after is not None:
            before = kept[-1]
            ways = pose[:2] - before[:2], after[:2] - pose[:2]
            stands = [not way.any() for way in ways]
            if all(stands):
                continue
            same = pose[2] == before[2] == after[2] and ways[0] @ ways[1] > 0
            if same and not any(stands):
                continue
        kept.append(pose)
    return np.array(kept)
