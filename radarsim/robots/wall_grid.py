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
from radarsim.jit import njit_inline
from radarsim.robots.footprint import (
    HALF_X,
    HALF_Y,
    MIDDLE_X,
    MIDDLE_Y,
    NO_SEGMENTS,
    RANK,
    line_table,
)

Ints = NDArray[np.int64]

_MIN_CELL: Final = 1.0  # m; larger where long walls would cross too many cells
_ENTRIES_PER_WALL: Final = 16
_FREE_ENTRIES: Final = 65536
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


def wall_table(floors: Sequence[Floats]) -> WallTable:
    """Return the table of the walls of some floors.

    Args:
        floors: The segments of each, (S, 2, 2) m, x and y of both ends, map frame.
    """
    nothing = np.zeros((0, 2), np.int64), np.zeros((0, 7))
    table = WallTable(line_table(NO_SEGMENTS), *nothing, np.zeros(1, np.int64))
    for segments in floors:
        table = with_floor(table, segments)
    return table


def with_floor(table: WallTable, segments: Floats) -> WallTable:
    """Return a table with one more floor, of which the segments are given."""
    walls, size = len(table.lines), _cell_size(segments)
    corner = segments.reshape(-1, 2).min(axis=0) - size if len(segments) else (0, 0)
    row, column, wall = _cells_crossed((segments - corner) / size)
    columns, rows = column.max(initial=0) + 1, row.max(initial=0) + 1
    found = np.column_stack([row * columns + column, wall + walls])
    entries = np.concatenate(
        [table.entries, found[np.argsort(found[:, 0], kind="stable")]]
    )
    run = len(table.entries), len(entries)
    lines = line_table(segments)
    lines[:, RANK] += walls
    grid = np.array([[*corner, size, columns, rows, *run]], np.float64)
    return WallTable(
        np.concatenate([table.lines, lines]),
        entries,
        np.concatenate([table.floors, grid]),
        np.zeros(walls + len(segments) + 1, np.int64),
    )


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
