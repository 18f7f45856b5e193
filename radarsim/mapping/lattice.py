"""Square cells over the floor, numbered from the map's origin, that grow where needed.

Row 0 is the southernmost row and column 0 the westernmost column of what there is.
Growing keeps what is there, cell by cell: cells are numbered in whole numbers from the
origin of the map, so nothing is ever resampled.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MappingError
from radarsim.geometry import Floats

T = TypeVar("T", bound=np.generic)

STEP: Final = 64  # cells; growing by more at once is growing more seldom
MOST: Final = 1 << 15  # cells on a side
MOST_CELLS: Final = 1 << 26


@dataclass(frozen=True, slots=True)
class Lattice:
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

    def middles(self) -> tuple[Floats, Floats]:
        """Give the middles of columns, (C,) x, and of rows, (R,) y, m."""
        half = self.resolution / 2
        x, y = self.origin
        columns = np.arange(self.columns, dtype=np.float64)
        rows = np.arange(self.rows, dtype=np.float64)
        across: Floats = x + half + self.resolution * columns
        up: Floats = y + half + self.resolution * rows
        return across, up

    def grown(self, low: tuple[float, float], high: tuple[float, float]) -> "Lattice":
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
        return Lattice(self.resolution, column, row, columns, rows)

    def moved(self, cells: NDArray[T], to: "Lattice") -> NDArray[T]:
        """Lay cells of this lattice into a larger one; what is new is 0."""
        larger: NDArray[Any] = np.zeros(to.shape, cells.dtype)
        row, column = self.row - to.row, self.column - to.column
        larger[row : row + self.rows, column : column + self.columns] = cells
        return larger


def _reach(
    first: int, count: int, low: float, high: float, lattice: Lattice
) -> tuple[int, int]:
    """Give first cell and number of cells along one axis."""
    least = math.floor(low / lattice.resolution)
    most = math.floor(high / lattice.resolution)
    if count and first <= least and most < first + count:
        return first, count
    start = least // STEP * STEP
    end = (most // STEP + 1) * STEP
    if count:
        start, end = min(start, first), max(end, first + count)
    return start, end - start
