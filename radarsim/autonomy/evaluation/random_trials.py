"""Trials on random maps: one line of JSON for each, resumable, judged by a raster.

Side beams (0, 25 or 50 UU beside the centre) and the sensor (radar or laser) go by turn
over the maps, and every map is run with every algorithm.

The raster is of the map's plan, and tells what a robot can reach there.

The distance of each cell's centre from the plan's blocks and discs is exact; cells that
are far enough from everything are connected with their eight neighbours. Nothing is
shared with navigators, nor with the free space of scenes: a truth of its own.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from radarsim.autonomy.evaluation.task_runner import read_log
from radarsim.autonomy.evaluation.trials import SCANNER, SENSORS, Row, run_plan
from radarsim.autonomy.navigation.algorithms import (
    ROBOT_HALF_WIDTH,
    ROBOT_RADIUS,
    Algorithm,
)
from radarsim.autonomy.navigation.plans import Mission
from radarsim.generators.random_maps import (
    FAMILIES,
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
HALF_PASSAGE: Final = 0.2  # m beyond the safety distance: half of what passages need
_MARGIN: Final = 3.0  # m of floor around everything
# Moves to neighbours and knight's moves: a path is at most 2.8 % longer than the exact.
_MOVES: Final = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2))
SIDE_OFFSETS: Final = (0, 25, 50)  # UU
UU: Final = 0.004  # m
TIME_LIMIT: Final = 1800.0  # s of simulated time
RESULT: Final = (
    "number",
    "algorithm",
    "family",
    "sensor",
    "side_offset",
    "expected",
    "outcome",
    "collisions",
    "path_length",
    "shortest_path",
    "time",
    "note",
    "correct",
)


_Cell = TypeVar("_Cell", bound=np.generic)


class Expectation(StrEnum):
    """What a navigator has to tell of a map."""

    REACHED = "reached"
    NO_PATH = "no_path"
    EITHER = "either"  # the passages are between those that count and those that do not
    TOO_NEAR = "too_near"  # the start or the goal is inside the safety distance


@dataclass(frozen=True, slots=True)
class RasterTruth:
    """The truth about a map.

    Attributes:
        expectation: What a navigator has to tell.
        shortest: Length of the shortest path of a disc of ``ROBOT_RADIUS``, m; None if
            there is none.
    """

    expectation: Expectation
    shortest: float | None


def raster_truth(map_: RandomMap, safety_distance: float, reach: float) -> RasterTruth:
    """Compute what a navigator has to tell of a map.

    Args:
        map_: The map.
        safety_distance: The navigator's, m.
        reach: How far beside its beams the navigator's sensor sees, m; what it passes
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


@dataclass(frozen=True, slots=True)
class RandomTrialSpec:
    """One trial: which random map, and which algorithm.

    Attributes:
        number: Number of the map.
        algorithm: Name of the algorithm.
    """

    number: int
    algorithm: str

    @property
    def family(self) -> str:
        """Family of the map."""
        return FAMILIES[self.number % len(FAMILIES)]

    @property
    def sensor(self) -> str:
        """Sensor preset of the map's trials."""
        return SENSORS[self.number % len(SENSORS)]

    @property
    def side_offset(self) -> int:
        """Offset of the radar's side beams, UU."""
        return SIDE_OFFSETS[self.number % len(SIDE_OFFSETS)]

    @property
    def reach(self) -> float:
        """How far beside its beams the sensor sees, m."""
        return self.side_offset * UU if self.sensor == "radar" else 0.0


@dataclass(frozen=True, kw_only=True)
class RandomTrialResult(Row, RandomTrialSpec):
    """The result of a trial on a random map.

    Attributes:
        expected: What a navigator has to tell, by the raster.
    """

    expected: str

    @property
    def correct(self) -> bool:
        """Whether the robot told what it has to, and touched nothing."""
        if self.collisions:
            return False
        verdicts = {Expectation.REACHED, Expectation.NO_PATH}
        if self.expected in verdicts:
            return self.outcome == self.expected
        return self.outcome in {*verdicts, self.expected}

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON, rounded to mm and ms."""
        return self.select(RESULT)


def all_random_trials(count: int, algorithms: Sequence[str]) -> list[RandomTrialSpec]:
    """Return the trials of the first maps.

    Args:
        count: Number of maps.
        algorithms: Algorithms, each of which runs on each map.
    """
    return [
        RandomTrialSpec(number, algorithm)
        for number in range(count)
        for algorithm in algorithms
    ]


def read_results(file: Path) -> list[dict[str, Any]]:
    """Read the lines of earlier results; an incomplete last line is left out.

    Raises:
        OSError: If the file exists and cannot be read.
        ValueError: If it has other lines.
    """
    return read_log(file, RESULT, "the result of a trial on a random map")


def run_random_trial(spec: RandomTrialSpec) -> RandomTrialResult:
    """Run one trial."""
    map_ = make_random_map(spec.number)
    truth = raster_truth(map_, SAFETY_DISTANCE, spec.reach)
    settings = {"sensor": spec.sensor, "fov_deg": 359, "resolution_deg": 1}
    if spec.sensor == "radar":
        settings["side_offset_uu"] = spec.side_offset
    config = SimulationConfig(item_settings={SCANNER: settings})
    host = Host(load_random_map(map_), config=config, seed=spec.number)
    mission = Mission(
        algorithm=Algorithm(spec.algorithm),
        goals=(map_.goal,),
        safety_distance=SAFETY_DISTANCE,
        time_limit=TIME_LIMIT,
    )
    row = vars(run_plan(mission, host)) | {"shortest_path": truth.shortest}
    expected = truth.expectation.value
    return RandomTrialResult(**asdict(spec), **row, expected=expected)


def load_random_map(map_: RandomMap) -> Scene:
    """Load a random map as a file of it would be."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"random_{map_.number}.yaml"
        path.write_text(map_.as_yaml())
        return load_map(path)
