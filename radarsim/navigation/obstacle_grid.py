"""A grid of what blocks robots, as it is seen on the way, and the cost of its cells.

Theory of operation
===================
A cell gains when a beam ends in it, and loses, half as much, when a beam goes through:
so what has driven away is forgotten, and one stray echo closes nothing for long. Cells
that nobody has seen are open. The grid covers start and goal and a margin around them;
what is beyond is left out until the grid grows.

A radar that sends its echoes also shows what is behind a first thin hedge: a dead end
is known before the robot has driven into it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.geometry import Floats
from radarsim.navigation.grid_path import Cell
from radarsim.navigation.observation import Observation
from radarsim.navigation.passage import step_cost

CELL: Final = 0.1  # m
MARGIN: Final = 8.0  # m around start and goal
MAX_DISTANCE: Final = 10.0  # m; longer beams only say that this much is free
_GAIN, _LOSS, _MOST, _LEAST = 2, 1, 10, -6  # evidence of a cell
_SHORT: Final = 0.15  # m before its end where a beam tells nothing

Point = tuple[float, float]


class ObstacleGrid:
    """Square cells, and the evidence that something in each blocks robots."""

    def __init__(self, points: list[Point]) -> None:
        """Create an empty grid around some points, m, map frame."""
        ends = np.array(points)
        self._corner = ends.min(axis=0) - MARGIN
        columns, rows = np.ceil((np.ptp(ends, axis=0) + 2 * MARGIN) / CELL).astype(int)
        self._evidence = np.zeros((rows, columns), np.int16)

    def grow(self) -> None:
        """Add a margin on all sides; nobody has seen it."""
        width = round(MARGIN / CELL)
        self._corner = self._corner - MARGIN
        self._evidence = np.pad(self._evidence, width)

    def add(self, observation: Observation) -> None:
        """Add a scan."""
        ranges, pose = observation.ranges, observation.pose
        steps = np.arange(CELL / 2, MAX_DISTANCE, CELL)
        free = steps < np.minimum(ranges, MAX_DISTANCE)[:, None] - _SHORT
        angles = observation.bearings + pose.yaw
        x = pose.x + np.cos(angles)[:, None] * steps
        y = pose.y + np.sin(angles)[:, None] * steps
        passed = self._mask(x[free], y[free])
        ends = observation.blocking_points()
        near = np.hypot(*(ends - (pose.x, pose.y)).T) < MAX_DISTANCE
        met = self._mask(*ends[near].T)
        change = np.where(met, _GAIN, np.where(passed, -_LOSS, 0))
        self._evidence = np.clip(self._evidence + change, _LEAST, _MOST).astype(
            np.int16
        )

    def cost(self, least: float) -> Floats:
        """Return the cost of a step of one cell into each, (R, C); inf if closed.

        Args:
            least: Distance from what blocks robots below which cells are closed, m.
        """
        is_open = self._evidence <= 0
        if is_open.all():
            return np.ones(is_open.shape)
        return step_cost(ndimage.distance_transform_edt(is_open) * CELL, least)

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

    def _mask(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Return the cells that some points are in, (R, C)."""
        mask = np.zeros(self._evidence.shape, np.bool_)
        columns = np.floor((x - self._corner[0]) / CELL).astype(np.int64)
        rows = np.floor((y - self._corner[1]) / CELL).astype(np.int64)
        height, width = self._evidence.shape
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        mask[rows[inside], columns[inside]] = True
        return mask
