"""The walls near a place, from a grid of square cells.

A wall is entered in each cell that it crosses. Cells are numbered row by row and the
entries sorted by number, so that the cells beside each other in a row are one run of
entries, and empty cells cost nothing, however large the map.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.robots.footprint import (
    HALF_X,
    HALF_Y,
    MIDDLE_X,
    MIDDLE_Y,
    RANK,
    line_table,
)

Ints = NDArray[np.int64]

_MIN_CELL: Final = 1.0  # m; larger where long walls would cross too many cells
_ENTRIES_PER_WALL: Final = 16
_FREE_ENTRIES: Final = 65536
_FEW_WALLS: Final = 64
_SPARE_ROWS: Final = np.array([16384, 32768, 512])  # walls, entries, floors
_TOLERANCE: Final = 1e-6  # cells; a wall this close to a cell crosses it


# Columns of ``floors``: corner of the first cell and size of a cell, m; number of
# columns and of rows of cells; first and end of the entries.
LEFT, BOTTOM, CELL, CELL_COLUMNS, CELL_ROWS, FIRST, END = range(7)


class WallTable(NamedTuple):
    """The walls of several floors.

    S is the number of walls, E of entries, F of floors.

    Attributes:
        lines: (S, 5) table of lines.
        entries: (E, 2) number of a cell, ascending on each floor, and the number of a
            wall that crosses it.
        floors: (F, 7) the grid of each floor.
        marks: (S + 1,) number of the search that found a wall last; the last one counts
            the searches.
    """

    lines: Floats
    entries: Ints
    floors: Floats
    marks: Ints


class FloorWalls(NamedTuple):
    """The walls of one floor, as if its ``WallTable`` had no other.

    Attributes:
        lines: (S, 5) table of lines.
        entries: (E, 2) as in ``WallTable``.
        grid: (7,) row of ``WallTable.floors``.
    """

    lines: Floats
    entries: Ints
    grid: Floats


def floor_walls(segments: Floats) -> FloorWalls:
    """Return the walls of a floor: segments, (S, 2, 2) m, x and y of both ends."""
    if len(segments) <= _FEW_WALLS:
        # One cell without end: to look at each wall takes less time than to sort them.
        numbers = np.arange(len(segments))
        grid = np.array([0.0, 0.0, np.inf, 1, 1, 0, len(segments)])
        entries = np.column_stack([np.zeros_like(numbers), numbers])
        return FloorWalls(line_table(segments), entries, grid)
    size = _cell_size(segments)
    corner = segments.reshape(-1, 2).min(axis=0) - size
    row, column, wall = _cells_crossed((segments - corner) / size)
    columns, rows = column.max(initial=0) + 1, row.max(initial=0) + 1
    found = np.column_stack([row * columns + column, wall])
    entries = found[np.argsort(found[:, 0], kind="stable")]
    grid = np.array([*corner, size, columns, rows, 0, len(entries)], np.float64)
    return FloorWalls(line_table(segments), entries, grid)


class WallStore:
    """A ``WallTable`` with room for more floors.

    Floors are only added: what is in the table never changes, so that whoever holds it
    can go on using it.

    Attributes:
        table: The table; rows that are not used yet hold zeros.
    """

    def __init__(
        self, floors: Sequence[FloorWalls] = (), spare: Ints = _SPARE_ROWS
    ) -> None:
        """Create a table of some floors.

        Args:
            floors: The floors; there is room for as much again.
            spare: Numbers of walls, entries and floors for which there is more room.
        """
        needed = sum(map(_sizes, floors), np.zeros(3, np.int64))
        walls, entries, count = (2 * needed + spare).tolist()
        self.table = WallTable(
            np.zeros((walls, 5)),
            np.zeros((entries, 2), np.int64),
            np.zeros((count, 7)),
            np.zeros(walls + 1, np.int64),
        )
        self._used = np.zeros(3, np.int64)
        for floor in floors:
            self.add(floor)

    @property
    def count(self) -> int:
        """Number of the floors in the table."""
        return int(self._used[2])

    def add(self, floor: FloorWalls) -> bool:
        """Add a floor; its number is that of the floors before.

        Returns:
            False if there is no room for it: then nothing is added.
        """
        table, end = self.table, self._used + _sizes(floor)
        if (end > [len(rows) for rows in table[:3]]).any():
            return False
        walls, entries, number = self._used.tolist()
        table.lines[walls : end[0]] = floor.lines
        table.lines[walls : end[0], RANK] += walls
        table.entries[entries : end[1]] = floor.entries + np.array([0, walls])
        table.floors[number] = floor.grid
        table.floors[number, FIRST:] += entries
        self._used = end
        return True


def _sizes(floor: FloorWalls) -> Ints:
    """Return the numbers of walls, of entries and of floors."""
    return np.array([len(floor.lines), len(floor.entries), 1])


def _cell_size(segments: Floats) -> float:
    """Return the size of cells, m, at which walls do not cross too many."""
    extent = float(np.abs(segments[:, 1] - segments[:, 0]).sum())
    spare = _ENTRIES_PER_WALL * len(segments) + _FREE_ENTRIES
    return max(_MIN_CELL, extent / spare)


def _cells_crossed(segments: Floats) -> tuple[Ints, Ints, Ints]:
    """Return row, column and segment of each crossing of a segment with a cell.

    Args:
        segments: (S, 2, 2), in units of a cell.
    """
    upward = segments[:, 1, 1] >= segments[:, 0, 1]
    low = np.where(upward[:, None], segments[:, 0], segments[:, 1])
    run = np.where(upward[:, None], 1.0, -1.0) * (segments[:, 1] - segments[:, 0])
    segment, row = _between(low[:, 1], low[:, 1] + run[:, 1])
    start, rise = low[segment], run[segment]
    # the part of the segment within the row, as shares of its length
    edges = np.stack([row - _TOLERANCE, row + 1 + _TOLERANCE]) - start[:, 1]
    is_level = rise[:, 1] == 0.0
    shares = np.clip(edges / np.where(is_level, 1.0, rise[:, 1]), 0.0, 1.0)
    shares = np.where(is_level, [[0.0], [1.0]], shares)
    ends = start[:, 0] + shares * rise[:, 0]
    part, column = _between(ends.min(axis=0), ends.max(axis=0))
    return row[part], column, segment[part]


def _between(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """Return the number of the interval, and the cell, of all cells that each meets."""
    first = np.floor(low - _TOLERANCE).astype(np.int64)
    last = np.floor(high + _TOLERANCE).astype(np.int64)
    counts = last - first + 1
    interval = np.repeat(np.arange(len(low)), counts)
    passed = np.cumsum(counts) - counts  # cells of the intervals before
    return interval, np.arange(len(interval)) - passed[interval] + first[interval]


@njit_inline
def find_walls(
    table: WallTable, floor: int, x: float, y: float, reach: float, lines: Floats
) -> int:
    """Find the walls of a floor within ``reach`` m of a place.

    Args:
        table: The ``WallTable``.
        floor: Number of the floor.
        x: Of the place, m, map frame.
        y: Likewise.
        reach: How far a wall may be away, m.
        lines: Table of lines to be written from its first row on, large enough for all
            walls of the floor.

    Returns:
        The number of walls.
    """
    floors, entries, marks = table.floors, table.entries, table.marks
    cell, columns = floors[floor, CELL], int(floors[floor, CELL_COLUMNS])
    left, right = _cells_within(x - floors[floor, LEFT], reach, cell, columns)
    rows = floors[floor, CELL_ROWS]
    bottom, top = _cells_within(y - floors[floor, BOTTOM], reach, cell, rows)
    first, end = int(floors[floor, FIRST]), int(floors[floor, END])
    # A wall is in several cells. Marks with the number of the search need not be reset.
    marks[-1] += 1
    count = 0
    for row in range(bottom, top + 1):
        last = row * columns + right
        entry = _first_entry(entries, first, end, row * columns + left)
        while entry < end and entries[entry, 0] <= last:
            wall = entries[entry, 1]
            entry += 1
            if marks[wall] == marks[-1]:
                continue
            marks[wall] = marks[-1]
            if _is_near(table.lines, wall, x, y, reach):
                for i in range(5):
                    lines[count, i] = table.lines[wall, i]
                count += 1
    return count


@njit_cached
def find_walls_of_floor(
    table: WallTable, x: float, y: float, reach: float, lines: Floats
) -> int:
    """Find the walls of a table with one floor; see ``find_walls``."""
    return find_walls(table, 0, x, y, reach, lines)


@njit_inline
def _cells_within(
    place: float, reach: float, cell: float, count: float
) -> tuple[int, int]:
    """Return the first and the last of ``count`` cells within reach on an axis."""
    first, last = (place - reach) / cell, (place + reach) / cell
    # limited before they become whole numbers: the place may be far off the grid
    first, last = min(max(first, 0.0), count), min(max(last, -1.0), count - 1.0)
    return math.floor(first), math.floor(last)


@njit_inline
def _first_entry(entries: Ints, first: int, end: int, cell: int) -> int:
    """Return the first entry from ``first`` to ``end`` whose cell is not before one."""
    while first < end:
        middle = (first + end) // 2
        if entries[middle, 0] < cell:
            first = middle + 1
        else:
            end = middle
    return first


@njit_inline
def _is_near(lines: Floats, wall: int, x: float, y: float, reach: float) -> bool:
    """Return whether a wall passes within ``reach`` m of a place."""
    dx, dy = x - lines[wall, MIDDLE_X], y - lines[wall, MIDDLE_Y]
    half_x, half_y = lines[wall, HALF_X], lines[wall, HALF_Y]
    share = (dx * half_x + dy * half_y) / (half_x * half_x + half_y * half_y)
    share = min(max(share, -1.0), 1.0)
    dx, dy = dx - share * half_x, dy - share * half_y
    return bool(dx * dx + dy * dy <= reach * reach)
