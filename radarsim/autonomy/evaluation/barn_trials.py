"""Trials on worlds of the BARN benchmark, with the benchmark's own score.

A folder holds worlds as the benchmark has them: ``world_N.world`` of Gazebo, with its
``path_N.npy`` beside it or in a folder ``path_files``. Nothing is fetched.

The robot starts before the field and has to get 10 m ahead. A run is a success if it
comes within 1 m of the goal, in at most 100 s since it has moved, before it touches
anything. The score of a success is OT / clip(AT, 2 OT, 8 OT): AT is the time it took,
and OT that for the length of the published path at 2 m/s. So it is .5 at best, and
.125 for a slow success. Earlier challenges began the clip at 4 OT.

Source: the rules and the program of the BARN challenge (Daffan/the-barn-challenge).
"""

import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim.autonomy.evaluation.random_trials import (
    load_random_map,
    raster_truth,
)
from radarsim.autonomy.evaluation.task_runner import read_log
from radarsim.autonomy.evaluation.trials import Row, config_with_sensor, run_plan
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.plans import Mission
from radarsim.errors import ForeignFileError
from radarsim.generators.barn_worlds import CELL, GOAL, START
from radarsim.generators.random_maps import SAFETY_DISTANCE, Disc, RandomMap
from radarsim.geometry import Floats, Point, Pose2
from radarsim.server.host import Host
from radarsim.validation import short_repr
from radarsim.xml_reader import XmlElement, parse_numbers, read_bytes, read_xml, wrong

ARRIVED: Final = 1.0  # m from the goal
MOVED: Final = 0.1  # m from the start, from where the time counts
LONGEST: Final = 100.0  # s
OPTIMAL_SPEED: Final = 2.0  # m/s
TIME_LIMIT: Final = 600.0  # s of simulated time
# From cells of a path to metres: rows along x, columns along y.
PATH_ORIGIN: Final = (-4.575, 5.075)
RESULT: Final = (
    "number",
    "algorithm",
    "sensor",
    "expected",
    "outcome",
    "collisions",
    "path_length",
    "shortest_path",
    "time",
    "note",
    "success",
    "actual_time",
    "optimal_time",
    "barn_score",
)
_NAME: Final = re.compile(r"world_(\d+)\.world")


def find_worlds(folder: Path) -> dict[int, tuple[Path, Path]]:
    """Return each world and its path in a folder or the folders in it, by number.

    Raises:
        ForeignFileError: If there are none, two of a number, or one without a path.
    """
    worlds: dict[int, tuple[Path, Path]] = {}
    files = [*folder.glob("world_*.world"), *folder.glob("*/world_*.world")]
    for world in sorted(files):
        if (match := _NAME.fullmatch(world.name)) is None:
            continue
        number = int(match[1])
        if number in worlds:
            text = f"{world}: a second world of number {number}, expected one"
            raise ForeignFileError(text)
        name = f"path_{number}.npy"
        homes = (world.parent, world.parent / "path_files", folder / "path_files")
        paths = [home / name for home in homes if (home / name).is_file()]
        if not paths:
            text = f"{world}: no {name}, expected it beside it or in path_files"
            raise ForeignFileError(text)
        worlds[number] = (world, paths[0])
    if not worlds:
        raise ForeignFileError(f"{folder}: no world_N.world, expected worlds of BARN")
    return dict(sorted(worlds.items()))


def read_cylinders(file: Path) -> list[Disc]:
    """Read the cylinders of a world, m, on the axes of the world.

    Raises:
        ForeignFileError: If it is no world of Gazebo, or has other things than
            cylinders and planes.
    """
    root = read_xml(file)
    world = root.first("world")
    if root.tag != "sdf" or world is None:
        tag = short_repr(root.tag)[1:-1]
        raise wrong(file, root.line, f"<{tag}>, expected <sdf> with a <world>")
    discs = []
    for model in world.all("model"):
        place = _pose(file, model, Pose2(0.0, 0.0))
        for link in model.all("link"):
            link_place = _pose(file, link, place)
            for collision in link.all("collision"):
                radius = _radius(file, collision)
                if radius is not None:
                    pose = _pose(file, collision, link_place)
                    discs.append(Disc(pose.x, pose.y, radius))
    if not discs:
        raise wrong(file, world.line, "no cylinders, expected some")
    return discs


def _pose(file: Path, element: XmlElement, outer: Pose2) -> Pose2:
    found = element.first("pose")
    if found is None or not found.text.strip():
        return outer
    x, y, _, roll, pitch, yaw = parse_numbers(file, found.line, found.text, 6)
    if roll or pitch:
        raise wrong(file, found.line, f"{found.text.strip()[:80]!r}, expected upright")
    return outer.compose(Pose2(x, y, yaw))


def _radius(file: Path, collision: XmlElement) -> float | None:
    """Return the radius of a cylinder, m; None for a plane, which is the floor."""
    geometry = collision.first("geometry")
    if geometry is None or not geometry.children:
        raise wrong(file, collision.line, "no shape, expected <cylinder>")
    shape = geometry.children[0]
    if shape.tag == "plane":
        return None
    radius = shape.first("radius") if shape.tag == "cylinder" else None
    if radius is None:
        tag = short_repr(shape.tag)[1:-1]
        raise wrong(file, shape.line, f"<{tag}>, expected <cylinder> with a <radius>")
    (value,) = parse_numbers(file, radius.line, radius.text, 1)
    if value <= 0:
        raise wrong(file, radius.line, f"<radius> {value:g}, expected more than 0")
    return value


def read_path(file: Path) -> Floats:
    """Read a path, (N, 2) m, on the axes of the world.

    Raises:
        ForeignFileError: If it is no array of rows and columns. Pickles are refused:
            they could run programs.
    """
    try:
        cells = np.load(io.BytesIO(read_bytes(file)), allow_pickle=False)
    except (ValueError, EOFError, MemoryError, OSError) as error:
        text = f"{file}: no array of numbers, expected one as numpy saves it"
        raise ForeignFileError(text) from error
    is_array = isinstance(cells, np.ndarray) and cells.dtype.kind in "iuf"
    if not is_array or cells.ndim != 2 or cells.shape[1] != 2 or not len(cells):
        raise ForeignFileError(f"{file}: expected an array of N rows and columns")
    if not np.isfinite(cells).all():
        raise ForeignFileError(f"{file}: expected finite rows and columns")
    path: Floats = cells.astype(np.float64) * CELL + PATH_ORIGIN
    return path


def optimal_time(path: Floats) -> float:
    """Return the time of a path, (N, 2) m, from start to goal at 2 m/s, s."""
    ways = np.vstack([START, path, GOAL])
    return float(np.hypot(*np.diff(ways, axis=0).T).sum()) / OPTIMAL_SPEED


def score_of(actual: float | None, optimal: float) -> float:
    """Return the benchmark's score of a run.

    Args:
        actual: Time of a success, s; None for no success.
        optimal: Time of the published path, s.
    """
    if actual is None:
        return 0.0
    return optimal / min(max(actual, 2 * optimal), 8 * optimal)


def barn_map(number: int, discs: Iterable[Disc]) -> RandomMap:
    """Return a world as a map, turned so that the robot starts along x."""
    solids = tuple(Disc(disc.y, -disc.x, disc.radius) for disc in discs)
    return RandomMap(number, "barn", solids, math.inf, _turned(START), _turned(GOAL))


def _turned(point: Point) -> Point:
    return point[1], -point[0]


class BarnClock:
    """Tells when a run was a success by the rules of the benchmark.

    Attributes:
        actual_time: s; None as long as it is none.
    """

    def __init__(self, host: Host, start: Point, goal: Point) -> None:
        self.actual_time: float | None = None
        self._simulation = host.simulation
        self._start, self._goal = start, goal
        self._began: float | None = None  # s
        self._is_over = False

    def watch(self) -> None:
        """Look at the robot; to be called after every tick."""
        if self._is_over or not self._simulation.vehicles:
            return
        robot, now = self._simulation.vehicles[0].robot, self._simulation.time
        place = (robot.pose.x, robot.pose.y)
        if self._began is None:
            self._began = now if math.dist(place, self._start) >= MOVED else None
            return
        elapsed = now - self._began
        if math.dist(place, self._goal) <= ARRIVED and not robot.touched:
            self.actual_time = elapsed
        has_arrived = self.actual_time is not None
        self._is_over = has_arrived or robot.touched or elapsed >= LONGEST


@dataclass(frozen=True, slots=True)
class BarnTrialSpec:
    """One trial.

    Attributes:
        number: Number of the world.
        algorithm: Name of the algorithm.
        sensor: Name of the sensor preset; all of them cover a full circle.
        world: The file of the world.
        path: The file of its path.
    """

    number: int
    algorithm: str
    sensor: str
    world: Path
    path: Path

    def read(self) -> tuple[RandomMap, float]:
        """Return the map, and the optimal time, s.

        Raises:
            ForeignFileError: If a file is wrong.
        """
        map_ = barn_map(self.number, read_cylinders(self.world))
        return map_, optimal_time(read_path(self.path))


@dataclass(frozen=True, kw_only=True)
class BarnTrialResult(Row, BarnTrialSpec):
    """The result of a trial.

    Attributes:
        expected: What a navigator has to tell of passages that are wide enough.
        actual_time: Time of a success by the benchmark's rules, s; None for none.
        optimal_time: Time of the published path, s.
    """

    expected: str
    actual_time: float | None
    optimal_time: float

    @property
    def success(self) -> bool:
        """Whether it is one by the rules of the benchmark."""
        return self.actual_time is not None

    @property
    def barn_score(self) -> float:
        """Score of the benchmark."""
        return score_of(self.actual_time, self.optimal_time)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON, rounded to mm and ms."""
        return self.select(RESULT)


def all_barn_trials(
    folder: Path, algorithms: Sequence[str], sensors: Sequence[str]
) -> list[BarnTrialSpec]:
    """Return the trials of the worlds in a folder.

    Args:
        folder: The folder.
        algorithms: Algorithms, each of which runs on each world.
        sensors: Sensors, likewise.

    Raises:
        ForeignFileError: If there are no worlds, or some are not as expected.
    """
    return [
        BarnTrialSpec(number, algorithm, sensor, *files)
        for (number, files), algorithm, sensor in product(
            find_worlds(folder).items(), algorithms, sensors
        )
    ]


def read_barn_results(file: Path) -> list[dict[str, Any]]:
    """Read the lines of earlier results; an incomplete last line is left out.

    Raises:
        OSError: If the file exists and cannot be read.
        ValueError: If it has other lines.
    """
    return read_log(file, RESULT, "the result of a trial on a world of BARN")


def run_barn_trial(spec: BarnTrialSpec) -> BarnTrialResult:
    """Run one trial.

    Raises:
        ForeignFileError: If a file is wrong.
        PresetError: If there is no such sensor.
    """
    map_, optimal = spec.read()
    truth = raster_truth(map_, SAFETY_DISTANCE, 0.0)
    host = Host(
        load_random_map(map_),
        config=config_with_sensor(spec.sensor),
        seed=spec.number,
    )
    mission = Mission(
        algorithm=Algorithm(spec.algorithm),
        goals=(map_.goal,),
        safety_distance=SAFETY_DISTANCE,
        time_limit=TIME_LIMIT,
    )
    clock = BarnClock(host, map_.start, map_.goal)
    row = vars(run_plan(mission, host, after_tick=clock.watch))
    row |= {"shortest_path": truth.shortest}
    return BarnTrialResult(
        **asdict(spec),
        **row,
        expected=truth.expectation.value,
        actual_time=clock.actual_time,
        optimal_time=optimal,
    )
