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

_COLUMN: Final = 4 * CELLS_ALONG  # numbers of cells in a column, more than there are
_AROUND: Final = [i * _COLUMN + j for i in (-1, 0, 1) for j in (-1, 0, 1)]
_DRAWS: Final = 1000  # numbers that are drawn at once

_Position: TypeAlias = tuple[float, float]


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
        return _scatter_copies(entry.name, origin, entry.scatter)
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [Copy(name, origin + i * step) for i, name in enumerate(names)]


def _scatter_copies(name: str, origin: Floats, scatter: ScatterEntry) -> list[Copy]:
    draws = _draw_forever(generator_for(scatter.seed, "scatter", name))
    (left, lower), (right, upper) = scatter.area
    smallest, largest = scatter.scale
    width, height, spread = right - left, upper - lower, largest - smallest
    placed = _Neighbourhood(scatter.min_distance, max(width, height))
    offsets: list[tuple[float, float, float]] = []
    scales: list[float] = []
    for number in range(scatter.count):
        for _ in range(MAX_ATTEMPTS):
            x, y = left + width * next(draws), lower + height * next(draws)
            if placed.add(x, y, x - left, y - lower):
                break
        else:
            text = f"the area is full after {number} copies, expected {scatter.count}"
            raise BuildError([(("scatter",), text)])
        offsets.append((x, y, 0.0))
        scales.append(smallest + spread * next(draws))
    names = copy_names(name, scatter.count)
    positions = origin + np.array(offsets)
    return [Copy(*each) for each in zip(names, positions, scales, strict=True)]


def _draw_forever(rng: np.random.Generator) -> Iterator[float]:
    """Yield numbers from 0 to 1, those that ``rng.random()`` returns one by one."""
    while True:
        yield from rng.random(_DRAWS).tolist()


class _Neighbourhood:
    """Positions in an area that are at least some distance apart, in cells of a grid.

    A cell is a little larger than the distance, so that rounding hides no neighbour
    behind the cells around it. The grid starts in the area's corner and has cells of
    its scale: no cell has many of its positions, however small it is.
    """

    def __init__(self, distance: float, side: float) -> None:
        """Start without positions.

        Args:
            distance: Least distance, m; 0 for any.
            side: Length of the area's longer side, m.
        """
        self._distance = distance
        self._size = max(distance * 1.001, side / CELLS_ALONG)
        self._cells: defaultdict[int, list[_Position]] = defaultdict(list)

    def add(self, x: float, y: float, right: float, up: float) -> bool:
        """Add a position, unless another one is too near.

        Args:
            x: East, m.
            y: North, m.
            right: Distance from the area's left side, m, at least 0.
            up: Distance from the area's lower side, m, at least 0.
        """
        least = self._distance
        if least == 0:
            return True
        cells = self._cells
        cell = int(right / self._size) * _COLUMN + int(up / self._size)
        for offset in _AROUND:
            for a, b in cells.get(cell + offset, ()):
                if math.sqrt((a - x) * (a - x) + (b - y) * (b - y)) < least:
                    return False
        cells[cell].append((x, y))
        return True
