"""Place the copies of objects that are repeated or scattered."""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.map_checks import Problem
from radarsim.scene.map_schema import ObjectEntry, ScatterEntry

MAX_ATTEMPTS: Final = 200  # random positions for a copy, before the area counts as full
CELLS_ALONG: Final = 10_000  # of an area's longer side, at most

_Position: TypeAlias = tuple[float, float]
_Cell: TypeAlias = tuple[int, int]


class BuildError(Exception):
    """An object cannot be built.

    Attributes:
        problems: The keys inside of the object, each with what is wrong there.
    """

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems


@dataclass(frozen=True, eq=False)
class Copy:
    """One copy of an object.

    Attributes:
        name: The object's name, with a number if there are several copies.
        position: (3,) m, of its origin.
        scale: Factor of its size.
    """

    name: str
    position: Floats
    scale: float = 1.0


def copy_names(name: str, count: int | None) -> Iterator[str]:
    """Yield the names of an object's copies, ``name_1``, ``name_2``; or just its own.

    Args:
        name: The object's own name.
        count: None for an object that is neither repeated nor scattered.
    """
    if count is None:
        yield name
    else:
        yield from (f"{name}_{number}" for number in range(1, count + 1))


def place_copies(entry: ObjectEntry) -> list[Copy]:
    """Place an object's copies.

    Scattered positions are drawn one after the other from a stream of the entry's own
    seed and name, so that a larger count does not move the first copies.

    Raises:
        BuildError: If the area is too small for so many copies so far apart.
    """
    origin = np.array(entry.position, dtype=np.float64)
    if entry.scatter is not None:
        return list(_scatter_copies(entry.name, origin, entry.scatter))
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [Copy(name, origin + i * step) for i, name in enumerate(names)]


def _scatter_copies(name: str, origin: Floats, scatter: ScatterEntry) -> Iterator[Copy]:
    rng = generator_for(scatter.seed, "scatter", name)
    low, high = np.array(scatter.area)
    smallest, largest = scatter.scale
    placed = _Neighbourhood(scatter.min_distance, low, max(high - low))
    for number, copy_name in enumerate(copy_names(name, scatter.count)):
        for _ in range(MAX_ATTEMPTS):
            position = rng.uniform(low, high)
            if placed.add(*position.tolist()):
                break
        else:
            text = f"the area is full after {number} copies, expected {scatter.count}"
            raise BuildError([(("scatter",), text)])
        scale = rng.uniform(smallest, largest)
        yield Copy(copy_name, origin + np.append(position, 0.0), scale)


class _Neighbourhood:
    """Positions in an area that are at least some distance apart, in cells of a grid.

    A cell is a little larger than the distance, so that rounding hides no neighbour
    behind the cells around it. The grid starts in the area's corner and has cells of
    its scale: no cell has many of its positions, however small it is.
    """

    def __init__(self, distance: float, corner: Floats, side: float) -> None:
        """Start without positions.

        Args:
            distance: Least distance, m; 0 for any.
            corner: The area's lower corner, m.
            side: Length of its longer side, m.
        """
        self._distance = distance
        self._left, self._lower = corner.tolist()
        self._size = max(distance * 1.001, float(side) / CELLS_ALONG)
        self._cells: defaultdict[_Cell, list[_Position]] = defaultdict(list)

    def add(self, x: float, y: float) -> bool:
        """Add a position, m, unless another one is too near."""
        if self._distance == 0:
            return True
        column = math.floor((x - self._left) / self._size)
        row = math.floor((y - self._lower) / self._size)
        if any(
            math.sqrt((a - x) * (a - x) + (b - y) * (b - y)) < self._distance
            for i in (column - 1, column, column + 1)
            for j in (row - 1, row, row + 1)
            for a, b in self._cells.get((i, j), ())
        ):
            return False
        self._cells[column, row].append((x, y))
        return True
