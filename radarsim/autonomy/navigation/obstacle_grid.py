"""A grid of the obstacles that the robot has seen so far.

Theory of operation
===================
The evidence of a cell increases when a beam ends in it, and decreases when a beam
passes through. So obstacles that have driven away are removed, and a single stray echo
does not close a cell for long. A beam that passes through a cell, but not near the
point that was seen in the cell, is ignored, since it may have passed next to a pole.
Unseen cells are open. The grid covers start, goals and a margin around them; points
outside are ignored until the grid grows.

Some beams pass a pane of glass and others end in it, so its cells close and open again.
A cell that closes for the third time, with seconds in between and seen from nearby,
therefore stays closed. Otherwise a robot would drive back and forth in front of the
pane forever.

A mirror shows images of obstacles in the space behind the mirror, where there are no
obstacles. A robot that is near such an image has driven past the mirror or has touched
it. So a closed cell is certain once the robot has seen it from nearby, together with
the cells within the drift of poses. Until then, the cell may be an image.

A radar that sends its echoes also shows obstacles behind a first thin hedge, so a dead
end is known before the robot has entered it.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.autonomy.navigation.grid_search import Cell
from radarsim.autonomy.navigation.observation import Observation
from radarsim.errors import NavigationError
from radarsim.geometry import Floats, Point, Pose2

CELL: Final = 0.1  # m
MARGIN: Final = 8.0  # m around start and goals
MAX_DISTANCE: Final = 10.0  # m; longer beams only mark cells as free
_GAIN, _LOSS, _MOST, _LEAST = 2, 1, 10, -6  # evidence of a cell: steps and limits
_SHORT: Final = 0.15  # m before the end of a beam in which no cell is marked free
_POINT: Final = 0.02  # m; side of a square in which only the newest point is stored
_BESIDE: Final = 0.015  # m from a point, within which a beam passes through the point
_NEAR: Final = 1.5  # m; nearer points cannot be images in mirrors
_DRIFT: Final = 0.3  # m; drift of poses between two sightings of one obstacle
_REOPENED: Final = 5.0  # s between two closings of a cell that are counted separately
_STAYS_CLOSED: Final = 3  # closings after which a cell is not opened again
_AROUND: Final = 3  # neighbouring cells that stay closed as well
_MOST_CELLS: Final = 1 << 24


class ObstacleGrid:
    """A grid of square cells, each with its evidence for an obstacle.

    Attributes:
        points: Points seen in closed cells, (N, 2) m, map frame; the newest point in
            each square of two centimetres.
    """

    def __init__(self, points: list[Point]) -> None:
        """Create an empty grid that contains some points, m, map frame.

        Raises:
            NavigationError: If the grid would have more than 17 million cells.
        """
        ends = np.array(points)
        self._corner = ends.min(axis=0) - MARGIN
        width, height = np.ptp(ends, axis=0) + 2 * MARGIN
        if width * height > _MOST_CELLS * CELL**2:
            raise NavigationError(
                f"start and goals span a grid of {width:.0f} by {height:.0f} m,"
                f" expected at most {_MOST_CELLS * CELL**2:.0f} m²; the algorithms"
                " bug1, bug2 and tangentbug need no grid"
            )
        columns, rows = math.ceil(width / CELL), math.ceil(height / CELL)
        self._evidence = np.zeros((rows, columns), np.int16)
        # newest point seen in each cell, m, map frame
        self._places = np.zeros((rows, columns, 2))
        # whether a point in each cell was seen from nearby
        self._seen_near = np.zeros((rows, columns), np.bool_)
        # time, s, at which each cell was last found blocked, and how often it was
        self._closed_at = np.full((rows, columns), -np.inf)
        self._closings = np.zeros((rows, columns), np.int16)
        self.points: Floats = np.zeros((0, 2))

    def grow(self) -> None:
        """Add a margin of unseen cells on all sides of the grid."""
        width = round(MARGIN / CELL)
        self._corner = self._corner - MARGIN
        self._evidence = np.pad(self._evidence, width)
        self._places = np.pad(self._places, ((width, width), (width, width), (0, 0)))
        self._seen_near = np.pad(self._seen_near, width)
        self._closed_at = np.pad(self._closed_at, width, constant_values=-np.inf)
        self._closings = np.pad(self._closings, width)

    def clear(self) -> None:
        """Reset the evidence of all cells."""
        self._evidence[:] = 0
        self._seen_near[:] = False
        self.points = np.zeros((0, 2))

    def add(self, observation: Observation) -> None:
        """Add the evidence of a scan to the grid."""
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
        is_near = np.hypot(*(ends[inside] - (pose.x, pose.y)).T) < _NEAR
        self._seen_near[rows[is_near], columns[is_near]] = True
        # If one beam ends in a cell and another one passes through it, the cell
        # contains an obstacle's edge, so its evidence increases.
        loss = np.where(self._evidence > 0, _GAIN, _LOSS)
        change = np.where(met, _GAIN, np.where(passed, -loss, 0))
        # Evidence is limited, so that old obstacles that have moved away are removed
        # soon. A glass pane may reappear in a neighbouring cell, so closings of the
        # neighbours count as well.
        closings = ndimage.maximum_filter(self._closings, 2 * _AROUND + 1)
        change[passed & ~met & (closings >= _STAYS_CLOSED)] = 0
        was_open = self._evidence <= 0
        self._evidence = np.clip(self._evidence + change, _LEAST, _MOST).astype(
            np.int16
        )
        closes = was_open & (self._evidence > 0)
        closes &= observation.time > self._closed_at + _REOPENED
        self._closings[closes & self._seen_near] += 1
        self._closed_at[closes] = observation.time
        points = np.vstack([ends[inside], self.points])
        _, newest = np.unique(
            np.floor(points / _POINT).astype(np.int64), axis=0, return_index=True
        )
        points = points[newest]
        self.points = points[self._evidence[self.cells(points)] > 0]

    def _passed(self, points: Floats, beams: Floats, pose: Pose2) -> NDArray[np.bool_]:
        """Return the cells, (R, C), that beams pass through.

        Args:
            points: Points of the beams, (N, 2) m, map frame.
            beams: Unit vectors of their beams, (N, 2).
            pose: Pose of the robot, from which the beams come.
        """
        rows, columns, inside = self._inside(points)
        beams = beams[inside]
        x, y = (self._places[rows, columns] - (pose.x, pose.y)).T
        off = np.abs(x * beams[:, 1] - y * beams[:, 0])
        counts = (self._evidence[rows, columns] <= 0) | (off <= _BESIDE)
        mask = np.zeros(self._evidence.shape, np.bool_)
        mask[rows[counts], columns[counts]] = True
        return mask

    def clearance(
        self, places: Floats | None = None, *, surely: bool = False
    ) -> Floats:
        """Return the distance, (R, C) m, from each cell to the nearest obstacle.

        Args:
            places: Positions of additional obstacles, (N, 2) m, map frame.
            surely: Ignore obstacles that may be images in a mirror.
        """
        is_open = self._evidence <= 0
        if surely:
            is_sure = ndimage.binary_dilation(
                self._seen_near & ~is_open, iterations=round(_DRIFT / CELL)
            )
            is_open |= ~is_sure
        if places is not None:
            rows, columns, _ = self._inside(places)
            is_open[rows, columns] = False
        # A distance transform needs at least one closed cell.
        if is_open.all():
            return np.full(is_open.shape, math.inf)
        clearance: Floats = ndimage.distance_transform_edt(is_open) * CELL
        return clearance

    def cell(self, point: Point) -> Cell:
        """Return the row and column of the cell at, or nearest to, a point."""
        rows, columns = self.cells(np.array([point]))
        return int(rows[0]), int(columns[0])

    def cells(self, points: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return rows and columns of the cells at, or nearest to, points, (N, 2) m."""
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
        """Return rows and columns of those points that are inside the grid.

        Args:
            points: (N, 2) m.

        Returns:
            Rows and columns, (M,) each, and a mask of the points inside, (N,).
        """
        columns, rows = np.floor((points - self._corner) / CELL).astype(np.int64).T
        height, width = self._evidence.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        return rows[inside], columns[inside], inside
