"""Worlds in the form of the BARN benchmark: fields of cylinders, drawn by its rules.

BARN (Benchmark for Autonomous Robot Navigation) is 300 worlds of Gazebo. A field of
30 x 30 cells is filled at random and smoothed by a cellular automaton; each filled cell
is a cylinder as wide as the cell. Before the field is a yard that is walled on three
sides, in which the robot starts, so that it has to go through the field.

The shortest path has no limit on its turns, while the paths of the published worlds
turn by at most 45 degrees in a cell.

Source: Perille, Truong, Xiao and Stone, "Benchmarking Metric Ground Navigation" (2020),
and the program that drew its worlds (dperille/jackal-map-creation).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from radarsim.geometry import Floats, Point
from radarsim.rng import generator_for

ROWS: Final = 30  # of cells, across
COLUMNS: Final = 66  # from behind the robot to behind the field
CELL: Final = 0.15  # m
RADIUS: Final = CELL / 2  # m, of a cylinder
START: Final[Point] = (-2.25, 3.0)  # m; the robot faces along y
GOAL: Final[Point] = (-2.25, 13.0)  # m
FILLS: Final = (0.15, 0.2, 0.25, 0.3)  # shares of cells that are filled at first
SMOOTHINGS: Final = (2, 3, 4)
_FIELD: Final = slice(34, 64)  # columns
_FIRST: Final = (-4.425, 0.075)  # m, centre of the first cell
_BORN, _DIES = 5, 1  # filled neighbours, of 8, from which a cell is filled, or cleared
_ROBOT: Final = np.ones((5, 5))  # cells that the benchmark's robot needs
_MOVES: Final = ((1, 0), (0, 1), (1, 1), (1, -1))
_LIGHT: Final = "<light name='sun' type='directional'/>"

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class BarnWorld:
    """A world.

    Attributes:
        number: Its number.
        grid: (ROWS, COLUMNS) cells with a cylinder; rows along x, columns along y.
        path: (N, 2) rows and columns of the field, from its first column to its last:
            the shortest path of the benchmark's robot.
    """

    number: int
    grid: Mask
    path: NDArray[np.int64]

    def centres(self) -> Floats:
        """Return the centres of all cylinders, (N, 2) m."""
        # Nothing meets a cylinder that stands amid others.
        inside = ndimage.binary_erosion(self.grid, np.ones((3, 3)))
        cells = np.argwhere(self.grid & ~inside)
        centres: Floats = np.array(_FIRST) + cells * CELL
        return centres

    def as_sdf(self) -> str:
        """Return the world as a file of Gazebo."""
        places = [f"{x:f} {y:f} 0 0 0 0" for x, y in self.centres()]
        models = "".join(
            f"    <model name='unit_cylinder_{i}'>\n      <static>1</static>\n"
            f"      <pose frame=''>{place}</pose>\n      <link name='link'>\n"
            "        <collision name='collision'>\n          <geometry>\n"
            f"            <cylinder>\n              <radius>{RADIUS:f}</radius>\n"
            "              <length>1</length>\n            </cylinder>\n"
            "          </geometry>\n        </collision>\n      </link>\n"
            "    </model>\n"
            for i, place in enumerate(places)
        )
        states = "".join(
            f"      <model name='unit_cylinder_{i}'>\n"
            f"        <pose frame=''>{place}</pose>\n      </model>\n"
            for i, place in enumerate(places)
        )
        return (
            f"<sdf version='1.6'>\n  <world name='default'>\n    {_LIGHT}\n"
            "    <model name='ground_plane'>\n      <static>1</static>\n"
            "      <link name='link'>\n        <collision name='collision'>\n"
            "          <geometry>\n            <plane/>\n          </geometry>\n"
            "        </collision>\n      </link>\n    </model>\n"
            f"{models}    <state world_name='default'>\n{states}    </state>\n"
            "  </world>\n</sdf>\n"
        )


def make_barn_world(number: int) -> BarnWorld:
    """Make the world of a number, at least 0; twelve kinds of fields come by turn."""
    rng = generator_for(number, "BARN world")
    fill = FILLS[number // len(SMOOTHINGS) % len(FILLS)]
    while True:
        field = _draw_field(rng, fill, SMOOTHINGS[number % len(SMOOTHINGS)])
        # Fields without a path are drawn again.
        path = _find_path(field, rng)
        if len(path):
            break
    grid = np.zeros((ROWS, COLUMNS), np.bool_)
    grid[:, _FIELD] = field
    grid[[0, -1], : _FIELD.start] = True
    grid[:, 0] = True
    return BarnWorld(number, grid, path)


def _draw_field(rng: np.random.Generator, fill: float, smoothings: int) -> Mask:
    """Draw a field; its first and last row are walls."""
    field = rng.random((ROWS, _FIELD.stop - _FIELD.start)) < fill
    field[[0, -1]] = True
    around = np.ones((3, 3))
    around[1, 1] = 0
    for _ in range(smoothings):
        # Beyond its walls all is filled, and beyond its other two ends nothing.
        padded = np.pad(field.astype(np.float64), ((1, 1), (0, 0)), constant_values=1)
        count = ndimage.convolve(padded, around, mode="constant")[1:-1]
        field = (count >= _BORN) | (field & (count > _DIES))
    return field


def _find_path(field: Mask, rng: np.random.Generator) -> NDArray[np.int64]:
    """Find a shortest path from the first column to the last, (N, 2); (0, 2) if none.

    Its ends are drawn from the largest region at each end.
    """
    free = ~ndimage.binary_dilation(field, _ROBOT)
    labels, count = ndimage.label(free)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    first, last = (
        column[sizes[column].argmax()] for column in (labels[:, 0], labels[:, -1])
    )
    if not first or first != last:
        return np.zeros((0, 2), np.int64)
    start, end = (
        int(rng.choice(np.flatnonzero(labels[:, column] == first)))
        for column in (0, -1)
    )
    graph, width = _graph(free), field.shape[1]
    source, target = start * width, end * width + width - 1
    _, before = dijkstra(graph, False, source, return_predecessors=True)
    cells = [target]
    while cells[-1] != source:
        cells.append(before[cells[-1]])
    return np.column_stack(np.divmod(np.array(cells[::-1], np.int64), width))


def _graph(free: Mask) -> coo_array:
    """Return the graph of neighbouring cells that are free."""
    numbers = np.arange(free.size).reshape(free.shape)
    edges, lengths = [], []
    for dr, dc in _MOVES:
        here = np.argwhere(free)
        there = here + np.array([dr, dc])
        inside = ((there >= 0) & (there < free.shape)).all(axis=1)
        here, there = here[inside], there[inside]
        # Not between two that touch at a corner.
        beside = free[there[:, 0], here[:, 1]] | free[here[:, 0], there[:, 1]]
        joined = free[there[:, 0], there[:, 1]] & beside
        pair = [numbers[tuple(cells[joined].T)] for cells in (here, there)]
        edges.append(pair)
        lengths.append(np.full(len(pair[0]), np.hypot(dr, dc)))
    rows, columns = np.concatenate(edges, axis=1)
    return coo_array((np.concatenate(lengths), (rows, columns)), (free.size,) * 2)
