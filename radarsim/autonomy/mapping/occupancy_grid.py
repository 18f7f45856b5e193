"""Occupancy grid that grows as needed, with one layer of evidence for each kind of hit.

Theory of operation
===================
Cells are squares with integer numbers from the map's origin, so growing copies cells
and never resamples them. Row 0 of an array is the southernmost row, column 0 the
westernmost column.

A radar that sees through foliage senses cells that a robot cannot drive through, so a
cell that a beam passed is not always drivable: ``sensed`` and ``drivable`` are separate
properties. Evidence is therefore kept in layers for solid obstacles, foliage, smoke,
and beam ends (see ``Layer``).

This module also computes the distances of cells from the nearest cell of a set.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.mapping.scan import Layer, PlanarScan
from radarsim.engine import engine
from radarsim.errors import MappingError
from radarsim.geometry import Floats, Pose2


def distance_field(cells: NDArray[np.bool_], max_distance: float) -> Floats:
    """Return the distance from each cell to the nearest true cell, between centers.

    ``scipy.ndimage.distance_transform_edt`` returns the same, but has no distance limit
    and takes about six times as long on maps of 400 by 400 cells.

    Args:
        cells: (R, C).
        max_distance: Limit of the search, in cells.

    Returns:
        (R, C) in cells; inf where no true cell is within the limit.
    """
    distances = np.full(cells.shape, np.inf)
    engine.fill_distances(np.ascontiguousarray(cells), max_distance, distances)
    return distances


T = TypeVar("T", bound=np.generic)
Mask = NDArray[np.bool_]

RESOLUTION: Final = 0.05  # m; default side of a cell
SHORT_RANGE: Final = 3.0  # m; UsarCommander shows free space within this range as safe
SENSED, NEAR = 1, 2  # flags of a cell, as in the engine's occupancy.hpp
LOG_ODDS_FREE, LOG_ODDS_LIMIT = 2, 60  # tenths of log-odds, as in the engine
GROWTH_STEP: Final = 64  # cells; larger steps mean less frequent growing
MAX_SIDE: Final = 1 << 15  # cells
MAX_CELLS: Final = 1 << 26


class CellClass(IntEnum):
    """Class of a cell: unknown, free, or the kind of its obstacle."""

    UNKNOWN = 0
    FREE = 1
    OBSTACLE = 2
    FOLIAGE = 3
    SMOKE = 4


@dataclass(frozen=True, slots=True)
class GridFrame:
    """Position and size of a grid of cells.

    Attributes:
        resolution: Side of a cell, m.
        column: Number of the first column, counted from the map's origin.
        row: Number of the first row, counted from the map's origin.
        columns: Number of columns.
        rows: Number of rows.
    """

    resolution: float
    column: int = 0
    row: int = 0
    columns: int = 0
    rows: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns of the grid."""
        return self.rows, self.columns

    @property
    def origin(self) -> tuple[float, float]:
        """South-west corner of the grid, x and y in m."""
        return self.column * self.resolution, self.row * self.resolution

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the row and column of the cell at a point, m; None if outside."""
        row = math.floor(y / self.resolution) - self.row
        column = math.floor(x / self.resolution) - self.column
        is_inside = 0 <= row < self.rows and 0 <= column < self.columns
        return (row, column) if is_inside else None

    def cell_centers(self) -> tuple[Floats, Floats]:
        """Return the x of the centers of columns, (C,) m, and the y of rows, (R,) m."""
        half = self.resolution / 2
        origin_x, origin_y = self.origin
        columns = np.arange(self.columns, dtype=np.float64)
        rows = np.arange(self.rows, dtype=np.float64)
        x: Floats = origin_x + half + self.resolution * columns
        y: Floats = origin_y + half + self.resolution * rows
        return x, y

    def extended_to(
        self, low: tuple[float, float], high: tuple[float, float]
    ) -> "GridFrame":
        """Return a frame that is extended, in large steps, until it contains a box.

        Args:
            low: South-west corner, m.
            high: North-east corner, m.

        Raises:
            MappingError: If the frame would have more than 32768 cells on a side, or 67
                million in all, which take 0.3 GB.
        """
        column, columns = _extended_axis(
            self.column, self.columns, low[0], high[0], self.resolution
        )
        row, rows = _extended_axis(
            self.row, self.rows, low[1], high[1], self.resolution
        )
        if max(columns, rows) > MAX_SIDE or columns * rows > MAX_CELLS:
            width, height = columns * self.resolution, rows * self.resolution
            raise MappingError(
                f"a map of {width:.0f} by {height:.0f} m in cells of"
                f" {self.resolution:g} m, expected at most {MAX_SIDE} cells on a side"
                f" and {MAX_CELLS:.3g} in all;"
                " the pose of the robot may be wrong, or the cells are too small"
            )
        return GridFrame(self.resolution, column, row, columns, rows)

    def copy_into(self, cells: NDArray[T], larger: "GridFrame") -> NDArray[T]:
        """Return the cells copied into an array of a larger frame, 0 elsewhere."""
        copy: NDArray[Any] = np.zeros(larger.shape, cells.dtype)
        row, column = self.row - larger.row, self.column - larger.column
        copy[row : row + self.rows, column : column + self.columns] = cells
        return copy


def _extended_axis(
    first: int, count: int, low: float, high: float, resolution: float
) -> tuple[int, int]:
    """Return first cell and number of cells of a larger frame along one axis."""
    low_cell = math.floor(low / resolution)
    high_cell = math.floor(high / resolution)
    if count and first <= low_cell and high_cell < first + count:
        return first, count
    start = low_cell // GROWTH_STEP * GROWTH_STEP
    end = (high_cell // GROWTH_STEP + 1) * GROWTH_STEP
    if count:
        start, end = min(start, first), max(end, first + count)
    return start, end - start


class OccupancyGrid:
    """An occupancy grid that grows to contain all scans.

    Attributes:
        frame: Position and size of the array of cells; replaced when the map grows.
    """

    def __init__(self, resolution: float = RESOLUTION) -> None:
        """Create an empty map with cells of a given side, m."""
        self.frame = GridFrame(resolution)
        self._evidence = np.zeros((len(Layer), 0, 0), np.int8)
        self._flags = np.zeros((0, 0), np.uint8)

    def add(self, pose: Pose2, scan: PlanarScan) -> None:
        """Add the evidence of a scan to the map.

        Args:
            pose: Pose of the robot at the scan, map frame.
            scan: The scan.

        Raises:
            MappingError: If the map gets too large.
            ValueError: If the direction or the end of a beam is not finite.
        """
        sensor = pose.compose(scan.mount)
        angles = scan.angles + (pose.yaw + scan.mount.yaw)
        directions = np.column_stack([np.cos(angles), np.sin(angles)])
        ends = directions * scan.known_range[:, None]
        # Infinite numbers and nan would give arbitrary
        # cells, and the map would grow to contain them.
        if not np.isfinite(ends).all():
            raise ValueError("angles or ranges of beams are not finite numbers")
        self._extend(sensor.x, sensor.y, ends)
        size = self.frame.resolution
        hits = scan.hits
        engine.add_scan(
            self._evidence,
            self._flags,
            self.frame.row,
            self.frame.column,
            sensor.x / size,
            sensor.y / size,
            directions,
            scan.known_range / size,
            scan.ends,
            hits.beams,
            hits.near / size,
            hits.far / size,
            hits.layer,
            SHORT_RANGE / size,
            scan.sees_through,
        )

    def clear_disc(self, pose: Pose2, radius: float) -> None:
        """Mark the disc that the robot covers as sensed and free.

        Args:
            pose: Pose of the robot, map frame.
            radius: Radius that the robot certainly covers, m.
        """
        corner = np.array([radius, radius])
        self._extend(pose.x, pose.y, np.array([-corner, corner]))
        x, y = self.frame.cell_centers()
        # Only cells around the robot are computed, so
        # the cost does not depend on the map size.
        columns = slice(*np.searchsorted(x, (pose.x - radius, pose.x + radius)))
        rows = slice(*np.searchsorted(y, (pose.y - radius, pose.y + radius)))
        x, y = x[columns], y[rows]
        disc = np.hypot(x - pose.x, y[:, None] - pose.y) <= radius
        self._flags[rows, columns][disc] |= SENSED | NEAR
        # The robot stands in these cells, so they
        # contain nothing solid, but may contain smoke.
        for layer in (Layer.SOLID, Layer.FOLIAGE):
            self._evidence[layer, rows, columns][disc] = -LOG_ODDS_LIMIT

    def free(self, cells: Mask) -> None:
        """Remove the evidence for solid objects from the cells of a mask, (R, C)."""
        for layer in (Layer.SOLID, Layer.BEAM_END):
            evidence = self._evidence[layer]
            evidence[cells] = np.minimum(evidence[cells], -LOG_ODDS_FREE)

    def sensed(self, x: float, y: float) -> bool:
        """Return whether any beam has reached the cell at a point, m."""
        cell = self.frame.cell(x, y)
        return cell is not None and bool(self._flags[cell] & SENSED)

    def drivable(self, x: float, y: float, safety: float) -> bool:
        """Return whether a robot may be at a point, at a distance from all obstacles.

        Args:
            x: m, map frame.
            y: m, map frame.
            safety: Distance to keep from solid obstacles and foliage, m.

        Returns:
            Whether the cell of the point is sensed, and all cells within the distance
            are passable, from center to center. If a server sends no echoes, foliage is
            known only by the beam ends deep inside it, so the distance should include
            that depth.
        """
        cell = self.frame.cell(x, y)
        if cell is None or not self._flags[cell] & SENSED:
            return False
        away = np.hypot(*(np.argwhere(self.blocked_cells()) - cell).T)
        return not (away <= safety / self.frame.resolution).any()

    def sensed_cells(self) -> Mask:
        """Return the sensed cells, (R, C)."""
        return np.asarray((self._flags & SENSED) != 0)

    def short_range_cells(self) -> Mask:
        """Return the cells that beams passed at short range, (R, C)."""
        return np.asarray((self._flags & NEAR) != 0)

    def beam_end_cells(self) -> Mask:
        """Return the cells where more beams end than pass, (R, C)."""
        return np.asarray(self._evidence[Layer.BEAM_END] > 0)

    def blocked_cells(self) -> Mask:
        """Return the cells that robots cannot enter, solid or foliage, (R, C)."""
        solid, foliage = self._evidence[Layer.SOLID], self._evidence[Layer.FOLIAGE]
        return np.asarray((solid > 0) | (foliage > 0))

    def classes(self) -> NDArray[np.uint8]:
        """Return the ``CellClass`` of each cell, (R, C)."""
        sensed = self.sensed_cells()
        classes = np.where(sensed, CellClass.FREE, CellClass.UNKNOWN).astype(np.uint8)
        # The class that hinders robots most is
        # written last, and overwrites other classes.
        classes[self._evidence[Layer.SMOKE] > 0] = CellClass.SMOKE
        classes[self._evidence[Layer.FOLIAGE] > 0] = CellClass.FOLIAGE
        classes[self._evidence[Layer.SOLID] > 0] = CellClass.OBSTACLE
        return classes

    def occupancy_probability(self) -> Floats:
        """Return the probability that a cell is blocked, (R, C); nan where unknown."""
        solid, foliage = self._evidence[Layer.SOLID], self._evidence[Layer.FOLIAGE]
        # Solid objects and foliage both block
        # robots. Evidence is in tenths of log-odds.
        log_odds = np.maximum(solid, foliage) / 10
        return np.where(self.sensed_cells(), 1 / (1 + np.exp(-log_odds)), np.nan)

    def _extend(self, x: float, y: float, offsets: Floats) -> None:
        """Extend the map to a point, m, and to points at offsets, (N, 2) m, from it."""
        # One cell is added on each side to allow for rounding. The initial value 0
        # includes the point itself, since a scan may have no beams.
        low = offsets.min(axis=0, initial=0.0) - self.frame.resolution
        high = offsets.max(axis=0, initial=0.0) + self.frame.resolution
        larger = self.frame.extended_to(
            (x + float(low[0]), y + float(low[1])),
            (x + float(high[0]), y + float(high[1])),
        )
        if larger != self.frame:
            layers = [self.frame.copy_into(layer, larger) for layer in self._evidence]
            flags = self.frame.copy_into(self._flags, larger)
            # All three attributes are assigned at once, so
            # that an interrupt leaves the map consistent.
            self._evidence, self._flags, self.frame = np.stack(layers), flags, larger
