"""Square cells over the floor, numbered from the map's origin, that grow where needed.

Row 0 is the southernmost row and column 0 the westernmost column of what there is.
Growing keeps what is there, cell by cell: cells are numbered in whole numbers from the
origin of the map, so nothing is ever resampled.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MappingError
from radarsim.geometry import Floats, Pose2
from radarsim.mapping.distance_field import distance_field
from radarsim.mapping.inverse_sensor_model import (
    LAYERS,
    LOG_ODDS_LIMIT,
    NEAR,
    SENSED,
    Beams,
    Cells,
    cross,
    forget,
    meet,
)
from radarsim.mapping.scan import BeamHits, Layer, PlanarScan

T = TypeVar("T", bound=np.generic)

STEP: Final = 64  # cells; growing by more at once is growing more seldom
MOST: Final = 1 << 15  # cells on a side
MOST_CELLS: Final = 1 << 26


@dataclass(frozen=True, slots=True)
class GridFrame:
    """Where cells are.

    Attributes:
        resolution: Side of a cell, m.
        column: Number of the first column, counted from the map's origin.
        row: The same of the first row.
        columns: How many there are.
        rows: How many there are.
    """

    resolution: float
    column: int = 0
    row: int = 0
    columns: int = 0
    rows: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, as arrays have them."""
        return self.rows, self.columns

    @property
    def origin(self) -> tuple[float, float]:
        """The south-west corner, x and y in m."""
        return self.column * self.resolution, self.row * self.resolution

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Give row and column of the cell around a place; None if there is none."""
        row = math.floor(y / self.resolution) - self.row
        column = math.floor(x / self.resolution) - self.column
        inside = 0 <= row < self.rows and 0 <= column < self.columns
        return (row, column) if inside else None

    def cell_centers(self) -> tuple[Floats, Floats]:
        """Give the middles of columns, (C,) x, and of rows, (R,) y, m."""
        half = self.resolution / 2
        x, y = self.origin
        columns = np.arange(self.columns, dtype=np.float64)
        rows = np.arange(self.rows, dtype=np.float64)
        across: Floats = x + half + self.resolution * columns
        up: Floats = y + half + self.resolution * rows
        return across, up

    def extended_to(
        self, low: tuple[float, float], high: tuple[float, float]
    ) -> "GridFrame":
        """Give one that holds a box too, in steps of many cells.

        Args:
            low: South-west corner, m.
            high: North-east corner, m.

        Raises:
            MappingError: If it would have more than 32768 cells on a side, or 67
                million in all, which take 0.3 GB.
        """
        column, columns = _reach(self.column, self.columns, low[0], high[0], self)
        row, rows = _reach(self.row, self.rows, low[1], high[1], self)
        if max(columns, rows) > MOST or columns * rows > MOST_CELLS:
            across, up = columns * self.resolution, rows * self.resolution
            raise MappingError(
                f"a map of {across:.0f} by {up:.0f} m in cells of"
                f" {self.resolution:g} m, expected at most {MOST} cells on a side and"
                f" {MOST_CELLS:.3g} in all;"
                " the place of the robot may be wrong, or the cells are too small"
            )
        return GridFrame(self.resolution, column, row, columns, rows)

    def copy_into(self, cells: NDArray[T], to: "GridFrame") -> NDArray[T]:
        """Lay cells of this lattice into a larger one; what is new is 0."""
        larger: NDArray[Any] = np.zeros(to.shape, cells.dtype)
        row, column = self.row - to.row, self.column - to.column
        larger[row : row + self.rows, column : column + self.columns] = cells
        return larger


def _reach(
    first: int, count: int, low: float, high: float, frame: GridFrame
) -> tuple[int, int]:
    """Give first cell and number of cells along one axis."""
    least = math.floor(low / frame.resolution)
    most = math.floor(high / frame.resolution)
    if count and first <= least and most < first + count:
        return first, count
    start = least // STEP * STEP
    end = (most // STEP + 1) * STEP
    if count:
        start, end = min(start, first), max(end, first + count)
    return start, end - start


# Section from mapping.grid.
# The map: what stands where, in layers that are kept apart.
#
# A radar that sees through foliage senses what a robot cannot drive through. So what
# a
# beam went through is not what is free to drive: ``sensed`` and ``drivable`` are two
# questions. The layers are solid things, foliage and the like, which beams get into
# and
# robots do not, smoke and the like, which both get into, and where beams end,
# whatever
# ended them.


class CellClass(IntEnum):
    """What a cell is."""

    UNKNOWN = 0
    FREE = 1
    OBSTACLE = 2
    FOLIAGE = 3
    SMOKE = 4


RESOLUTION: Final = 0.05  # m
SHORT_RANGE: Final = 3.0  # m, within which UsarCommander calls free space safe

Mask = NDArray[np.bool_]


class OccupancyGrid:
    """A map that grows.

    Attributes:
        lattice: Where its cells are; another one after the map has grown.
    """

    def __init__(
        self, resolution: float = RESOLUTION, *, short_range: float = SHORT_RANGE
    ) -> None:
        """Begin with nothing.

        Args:
            resolution: Side of a cell, m.
            short_range: What is free so near to the scanner is ``near``, m.
        """
        self.frame = GridFrame(resolution)
        self._short = short_range / resolution
        self._evidence = np.zeros((LAYERS, 0, 0), np.int8)
        self._flags = np.zeros((0, 0), np.uint8)

    def add(self, pose: Pose2, scan: PlanarScan) -> None:
        """Take in a scan.

        Args:
            pose: Of the robot when it was taken, map frame.
            scan: Any.

        Raises:
            MappingError: If the map gets too large.
            ValueError: If a beam has no direction or no end.
        """
        c, s = math.cos(pose.yaw), math.sin(pose.yaw)
        x = pose.x + c * scan.mount.x - s * scan.mount.y
        y = pose.y + s * scan.mount.x + c * scan.mount.y
        angles = scan.angles + (pose.yaw + scan.mount.yaw)
        ways = np.column_stack([np.cos(angles), np.sin(angles)])
        ends = ways * scan.reach[:, None]
        if not np.isfinite(ends).all():
            raise ValueError("beams without a direction or an end, expected numbers")
        self._grow(x, y, ends)
        size = self.frame.resolution
        beams = Beams(
            np.array([x, y]) / size,
            np.array([self.frame.column, self.frame.row]),
            ways,
            scan.reach / size,
            scan.ends,
            self._short,
            scan.sees_through,
        )
        met = scan.hits
        met = BeamHits(met.beams, met.near / size, met.far / size, met.what)
        path = np.zeros((2 * max(self.frame.shape) + 2, 2), np.int64)
        cells = Cells(self._evidence, self._flags)
        meet(cells, beams, met, path)
        cross(cells, beams, path)
        forget(cells, beams, path)

    def stand(self, pose: Pose2, radius: float) -> None:
        """Take in that the robot stands somewhere: it is free there, and sensed.

        Args:
            pose: Of the robot, map frame.
            radius: That it covers for sure, m.
        """
        corner = np.array([radius, radius])
        self._grow(pose.x, pose.y, np.array([-corner, corner]))
        x, y = self.frame.cell_centers()
        columns = slice(*np.searchsorted(x, (pose.x - radius, pose.x + radius)))
        rows = slice(*np.searchsorted(y, (pose.y - radius, pose.y + radius)))
        x, y = x[columns], y[rows]
        under = np.hypot(x - pose.x, y[:, None] - pose.y) <= radius
        self._flags[rows, columns][under] |= SENSED | NEAR
        for layer in (Layer.SOLID, Layer.FOLIAGE):
            self._evidence[layer, rows, columns][under] = -LOG_ODDS_LIMIT

    def sensed(self, x: float, y: float) -> bool:
        """Tell whether any beam has been in the cell around a place, m."""
        cell = self.frame.cell(x, y)
        return cell is not None and bool(self._flags[cell] & SENSED)

    def drivable(self, x: float, y: float, safety: float) -> bool:
        """Tell whether a robot may be at a place.

        Args:
            x: m, map frame.
            y: m.
            safety: Distance to keep from solid things and foliage, m.

        Returns:
            Whether the cell around it is sensed, and no cell that robots cannot enter
            is within the distance, from middle to middle. Where no echoes are told,
            foliage is known only by the places deep in it where beams end, so the
            distance should be larger by that.
        """
        cell = self.frame.cell(x, y)
        if cell is None or not self._flags[cell] & SENSED:
            return False
        reach = safety / self.frame.resolution
        span = math.floor(reach)
        top, left = max(cell[0] - span, 0), max(cell[1] - span, 0)
        window = np.s_[top : cell[0] + span + 1, left : cell[1] + span + 1]
        rows, columns = np.nonzero(self._blocked(window))
        near = np.hypot(rows + top - cell[0], columns + left - cell[1]) <= reach
        return not near.any()

    def sensed_cells(self) -> Mask:
        """Give where ``sensed`` holds, (R, C)."""
        return np.asarray((self._flags & SENSED) != 0)

    def short_range_cells(self) -> Mask:
        """Give what beams went through within the short range, (R, C)."""
        return np.asarray((self._flags & NEAR) != 0)

    def beam_end_cells(self) -> Mask:
        """Give where beams rather end than go on, whatever ends them, (R, C)."""
        return np.asarray(self._evidence[Layer.BEAM_END] > 0)

    def blocked_cells(self) -> Mask:
        """Give what robots cannot enter: solid things and foliage, (R, C)."""
        return self._blocked(np.s_[:, :])

    def drivable_cells(self, safety: float) -> Mask:
        """Give where ``drivable`` holds at a distance in m, (R, C)."""
        reach = safety / self.frame.resolution
        far = np.isinf(distance_field(self.blocked_cells(), reach))
        return far & self.sensed_cells()

    def classes(self) -> NDArray[np.uint8]:
        """Give what each cell is, (R, C): uint8 of ``CellClass``."""
        found = np.where(self.sensed_cells(), CellClass.FREE, CellClass.UNKNOWN).astype(
            np.uint8
        )
        found[self._evidence[Layer.SMOKE] > 0] = CellClass.SMOKE
        found[self._evidence[Layer.FOLIAGE] > 0] = CellClass.FOLIAGE
        found[self._evidence[Layer.SOLID] > 0] = CellClass.OBSTACLE
        return found

    def occupancy_probability(self) -> Floats:
        """Give the probability that robots cannot enter, (R, C); nan where unknown."""
        odds = (
            np.maximum(self._evidence[Layer.SOLID], self._evidence[Layer.FOLIAGE]) / 10
        )
        return np.where(self.sensed_cells(), 1 / (1 + np.exp(-odds)), np.nan)

    def _blocked(self, window: tuple[slice, slice]) -> Mask:
        solid, foliage = (
            self._evidence[Layer.SOLID][window],
            self._evidence[Layer.FOLIAGE][window],
        )
        return np.asarray((solid > 0) | (foliage > 0))

    def _grow(self, x: float, y: float, ways: Floats) -> None:
        """Make room for a place, where ways of (N, 2) m lead from it, and rounding."""
        low = ways.min(axis=0, initial=0.0) - self.frame.resolution
        high = ways.max(axis=0, initial=0.0) + self.frame.resolution
        larger = self.frame.extended_to(
            (x + float(low[0]), y + float(low[1])),
            (x + float(high[0]), y + float(high[1])),
        )
        if larger != self.frame:
            layers = [self.frame.copy_into(layer, larger) for layer in self._evidence]
            flags = self.frame.copy_into(self._flags, larger)
            # at once: whoever breaks off in between still has a map
            self._evidence, self._flags, self.frame = np.stack(layers), flags, larger
