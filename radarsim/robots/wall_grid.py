"""The walls near a place, from a grid of square cells.

A wall is entered in each cell that it crosses. Cells are numbered row by row and the
entries sorted by number, so that the cells beside each other in a row are one run of
entries, and empty cells cost nothing, however large the map.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats
from radarsim.robots.footprint import LINE, Lines, line_table

Ints = NDArray[np.int64]

_MIN_CELL: Final = 1.0  # m; larger where long walls would cross too many cells
_ENTRIES_PER_WALL: Final = 16
_FREE_ENTRIES: Final = 65536
_FEW_WALLS: Final = 64
_SPARE_ROWS: Final = np.array([16384, 32768, 512])  # walls, entries, floors


WALL_ENTRY: Final = engine.rows["WallEntry"]
WALL_GRID: Final = engine.rows["WallGrid"]


class FloorWalls(NamedTuple):
    """The walls of one floor, as if no table had any other.

    Attributes:
        lines: (S,) the walls.
        entries: (E,) of type ``WALL_ENTRY``, by cells.
        grid: (1,) of type ``WALL_GRID``.
    """

    lines: Lines
    entries: NDArray[np.void]
    grid: NDArray[np.void]

    def pack(self) -> Packed:
        """Return these walls as a table that has no others, of type ``Walls``."""
        return pack_walls(*self)


def pack_walls(
    lines: Lines, entries: NDArray[np.void], floors: NDArray[np.void]
) -> Packed:
    """Return a table of the walls of several floors, of type ``Walls``."""
    return engine.structures["Walls"].pack(
        lines=lines,
        entries=entries,
        floors=floors,
        marks=np.zeros(len(lines), np.int64),
        searches=np.zeros(1, np.int64),
    )


def floor_walls(segments: Floats) -> FloorWalls:
    """Return the walls of a floor: segments, (S, 2, 2) m, x and y of both ends."""
    lines = line_table(segments)
    if len(segments) <= _FEW_WALLS:
        # One cell without end: to look at each wall takes less time than to sort them.
        entries = np.zeros(len(segments), WALL_ENTRY)
        entries["wall"] = np.arange(len(segments))
        endless = (0.0, 0.0, np.inf, 1, 1, 0, len(segments), 0)
        return FloorWalls(lines, entries, np.array([endless], WALL_GRID))
    segments = np.ascontiguousarray(segments, np.float64)
    size = _cell_size(segments)
    left, bottom = segments.reshape(-1, 2).min(axis=0) - size
    grid = np.array([(left, bottom, size, 1, 1, 0, 0, 0)], WALL_GRID)
    entries = np.zeros(engine.count_crossings(segments, grid), WALL_ENTRY)
    engine.enter_crossings(segments, grid, entries)
    grid["end"] = len(entries)
    order = np.argsort(entries["cell"], kind="stable")
    return FloorWalls(lines, entries[order], grid)


class WallStore:
    """The walls of several floors, with room for more.

    Floors are only added: what is in the table never changes, so that whoever holds it
    can go on using it.

    Attributes:
        table: The table, of type ``Walls``.
        lines: The number of lines for which it has room.
    """

    def __init__(self, floors: Sequence[FloorWalls] = ()) -> None:
        """Create a table of some floors, with room for more; without any, for none."""
        needed = sum(map(_sizes, floors), np.zeros(3, np.int64))
        room = (2 * needed + (_SPARE_ROWS if floors else 0)).tolist()
        types = LINE, WALL_ENTRY, WALL_GRID
        self._tables = tuple(map(np.zeros, room, types))
        self.table = pack_walls(*self._tables)
        self.lines = room[0]
        self._used = np.zeros(3, np.int64)
        for floor in floors:
            self.add(floor)

    def add(self, floor: FloorWalls) -> bool:
        """Add a floor; its number is that of the floors before.

        Returns:
            False if there is no room for it: then nothing is added.
        """
        end = self._used + _sizes(floor)
        if (end > [len(rows) for rows in self._tables]).any():
            return False
        walls, first, _ = self._used.tolist()
        pieces = zip(self._tables, self._used.tolist(), end.tolist(), strict=True)
        lines, entries, grid = (table[start:stop] for table, start, stop in pieces)
        lines[:], entries[:], grid[:] = floor
        grid["first_line"] = walls
        grid["first"] += first
        grid["end"] += first
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
