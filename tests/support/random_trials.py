"""Trials on random maps, judged by a raster.

Side beams (0, 25 or 50 UU off the centre) and the sensor (radar or laser) go by turn
over the maps.

The raster is of the map's plan, and shows what a robot can reach there.

The distance of each cell's centre from the plan's blocks and discs is exact; cells that
are far enough from everything are connected with their eight neighbours. Nothing is
shared with navigators, nor with the free space of scenes: a truth of its own.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from radarsim.autonomy.evaluation.trials import SCANNER, run_plan
from radarsim.autonomy.plans import ROBOT_RADIUS, Algorithm, Mission
from radarsim.generators.random_maps import (
    SAFETY_DISTANCE,
    RandomMap,
    make_random_map,
)
from radarsim.geometry import Floats, Point
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

CELL: Final = 0.05  # m
SENSORS: Final = ("radar", "laser")
ROBOT_HALF_WIDTH: Final = 0.248  # m; of a P3AT
HALF_PASSAGE: Final = 0.2  # m beyond the safety distance: half of what passages need
_MARGIN: Final = 3.0  # m of floor around everything
# Moves to neighbours and knight's moves: a path is at most 2.8 % longer than the exact.
_MOVES: Final = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
SIDE_OFFSETS: Final = (0, 25, 50)  # UU
UU: Final = 0.004  # m
TIME_LIMIT: Final = 1800.0  # s of simulated time

_Cell = TypeVar("_Cell", bound=np.generic)


class Expectation(StrEnum):
    """The right verdict of a navigator on a map."""

    REACHED = "reached"
    NO_PATH = "no_path"
    EITHER = "either"  # the passages are between those that count and those that do not
    TOO_NEAR = "too_near"  # the start or the goal is inside the safety distance


@dataclass(frozen=True, slots=True)
class RasterTruth:
    """The truth about a map.

    Attributes:
        expectation: The right verdict of a navigator.
        shortest: Length of the shortest path of a disc of ``ROBOT_RADIUS``, m; None if
            there is none.
    """

    expectation: Expectation
    shortest: float | None


def raster_truth(map_: RandomMap, safety_distance: float, reach: float) -> RasterTruth:
    """Compute the right verdict of a navigator on a map.

    Args:
        map_: The map.
        safety_distance: The navigator's, m.
        reach: How far off its beams the navigator's sensor sees, m; what it passes
            looks that much wider.
    """
    raster = _Raster(map_)
    # Between what surely is a passage and what surely is none, either answer is right.
    wide = raster.connects(safety_distance + HALF_PASSAGE + reach)
    narrow = raster.connects(ROBOT_HALF_WIDTH)
    near = min(raster.clearance(map_.start), raster.clearance(map_.goal))
    expectation = Expectation.EITHER
    if near < safety_distance:
        expectation = Expectation.TOO_NEAR
    elif wide:
        expectation = Expectation.REACHED
    elif not narrow:
        expectation = Expectation.NO_PATH
    return RasterTruth(expectation, raster.shortest_path(ROBOT_RADIUS))


class _Raster:
    """Distances of cells from everything solid."""

    def __init__(self, map_: RandomMap) -> None:
        self._map = map_
        places = np.array([map_.start, map_.goal, *((s.x, s.y) for s in map_.solids)])
        self._low = places.min(axis=0) - _MARGIN
        shape = np.ceil((places.max(axis=0) + _MARGIN - self._low) / CELL).astype(int)
        columns, rows = np.indices(shape)
        cells = np.column_stack([columns.ravel(), rows.ravel()])
        self._distances = self._from_solids(self._low + (cells + 0.5) * CELL)
        self._distances = self._distances.reshape(shape)

    def _from_solids(self, points: Floats) -> Floats:
        nearest = np.full(len(points), math.inf)
        for solid in self._map.solids:
            np.minimum(nearest, solid.distances(points), out=nearest)
        return nearest

    def clearance(self, place: Point) -> float:
        """Return the distance of a place from everything solid, m."""
        return float(self._from_solids(np.array([place]))[0])

    def connects(self, distance: float) -> bool:
        """Return whether start and goal are connected that far from everything."""
        labels, _ = ndimage.label(self._distances >= distance, np.ones((3, 3)))
        # Label 0 is of all cells that are too near.
        start, goal = labels[self._cell(self._map.start)], self._cell(self._map.goal)
        return bool(start and start == labels[goal])

    def shortest_path(self, distance: float) -> float | None:
        """Return the length of the shortest path that far from everything, m."""
        free = self._distances >= distance
        numbers = np.arange(free.size).reshape(free.shape)
        rows, columns, lengths = [], [], []
        # each pair of neighbours once, as the graph is not directed
        for dx, dy in _MOVES:
            here, there = _shifted(free, dx, dy), _shifted(free, -dx, -dy)
            both = here & there
            rows.append(_shifted(numbers, dx, dy)[both])
            columns.append(_shifted(numbers, -dx, -dy)[both])
            lengths.append(np.full(both.sum(), CELL * math.hypot(dx, dy)))
        edges = (np.concatenate(rows), np.concatenate(columns))
        graph = coo_array((np.concatenate(lengths), edges), shape=(free.size,) * 2)
        start, goal = (
            numbers[self._cell(p)] for p in (self._map.start, self._map.goal)
        )
        found = dijkstra(graph.tocsr(), directed=False, indices=start)[goal]
        return float(found) if np.isfinite(found) else None

    def _cell(self, place: Point) -> tuple[int, int]:
        column, row = np.floor((np.array(place) - self._low) / CELL).astype(int)
        return int(column), int(row)


def _shifted(cells: NDArray[_Cell], dx: int, dy: int) -> NDArray[_Cell]:
    """Return the cells that have a neighbour at a shift, in the same order."""
    columns, rows = cells.shape
    return cells[max(-dx, 0) : columns - max(dx, 0), max(-dy, 0) : rows - max(dy, 0)]


def mission_to(goal: Point, algorithm: str, **more: Any) -> Mission:
    """Return a mission to a goal, by the name of an algorithm."""
    values = {"safety_distance": SAFETY_DISTANCE, **more}
    return Mission(algorithm=Algorithm(algorithm), goals=(goal,), **values)


def random_trial_errors(number: int, algorithm: str) -> list[str]:
    """Run an algorithm on a random map, and return the errors of the result.

    Args:
        number: Number of the map.
        algorithm: Name of the algorithm.
    """
    map_, offset = make_random_map(number), SIDE_OFFSETS[number % len(SIDE_OFFSETS)]
    settings: dict[str, Any] = {"sensor": SENSORS[number % len(SENSORS)]}
    reach = 0.0
    if settings["sensor"] == "radar":
        settings["side_offset_uu"], reach = offset, offset * UU
    truth = raster_truth(map_, SAFETY_DISTANCE, reach)
    settings |= {"fov_deg": 359, "resolution_deg": 1}
    config = SimulationConfig(item_settings={SCANNER: settings})
    mission = mission_to(map_.goal, algorithm, time_limit=TIME_LIMIT)
    row = run_plan(mission, Host(load_random_map(map_), config=config, seed=number))
    verdicts = {Expectation.REACHED, Expectation.NO_PATH}
    allowed = {truth.expectation}
    if truth.expectation not in verdicts:
        allowed |= verdicts
    errors = [f"{row.collisions} collisions"] if row.collisions else []
    if row.outcome not in allowed:
        errors.append(f"{row.outcome} {row.note}, expected one of {sorted(allowed)}")
    return errors


def load_random_map(map_: RandomMap) -> Scene:
    """Load a random map as a file of it would be."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"random_{map_.number}.yaml"
        path.write_text(map_.as_yaml())
        return load_map(path)
