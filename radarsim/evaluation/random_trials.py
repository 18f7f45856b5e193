"""Trials on random maps: one line of JSON for each, resumable, judged by a raster.

Side beams (0, 25 or 50 UU beside the centre) and the sensor (radar or laser) go by turn
over the maps, and every map is run with every algorithm.
"""

from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from radarsim.evaluation.random_maps import (
    FAMILIES,
    SAFETY_DISTANCE,
    RandomMap,
    make_random_map,
)
from radarsim.evaluation.raster_truth import Expectation, raster_truth
from radarsim.evaluation.result_log import read_log
from radarsim.evaluation.task_runner import run_tasks
from radarsim.evaluation.trials import SCANNER, SENSORS, Drive, drive_mission
from radarsim.host import Host
from radarsim.navigation.mission import Mission
from radarsim.navigation.options import Algorithm
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.simulation.config import SimulationConfig

SIDE_OFFSETS: Final = (0, 25, 50)  # UU
UU: Final = 0.004  # m
TIME_LIMIT: Final = 1800.0  # s of simulated time


@dataclass(frozen=True, slots=True)
class RandomTrialSpec:
    """One trial: which random map, and which algorithm."""

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


@dataclass(frozen=True, slots=True)
class RandomTrialResult:
    """The result of a trial on a random map.

    Attributes:
        number: Number of the map.
        algorithm: The algorithm.
        family: Family of the map.
        sensor: Sensor preset.
        side_offset: Offset of the radar's side beams, UU.
        expected: What a navigator has to tell, by the raster.
        outcome: What it told: ``reached`` only if it is there, ``no_path``,
            ``too_near`` or ``failed``.
        collisions: How often the robot began to touch something.
        path_length: Length of the true path, m.
        shortest_path: Length of the shortest path by the raster, m, or None.
        time: Simulated time, s.
        note: Why it failed; empty if it did not.
    """

    number: int
    algorithm: str
    family: str
    sensor: str
    side_offset: int
    expected: str
    outcome: str
    collisions: int
    path_length: float
    shortest_path: float | None
    time: float
    note: str

    @property
    def is_correct(self) -> bool:
        """Whether the robot told what it has to, and touched nothing."""
        if self.collisions:
            return False
        verdicts = {Expectation.REACHED, Expectation.NO_PATH}
        if self.expected in verdicts:
            return self.outcome == self.expected
        return self.outcome in {*verdicts, self.expected}

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON, rounded to mm and ms."""
        values = {
            key: round(value, 3) if isinstance(value, float) else value
            for key, value in asdict(self).items()
        }
        return {**values, "correct": self.is_correct}


_KEYS: Final = {field.name for field in fields(RandomTrialResult)} | {"correct"}


def all_random_trials(
    count: int, algorithms: Sequence[str], done: Iterable[dict[str, Any]] = ()
) -> list[RandomTrialSpec]:
    """Return the trials of the first maps that are left.

    Args:
        count: Number of maps.
        algorithms: Algorithms, each of which runs on each map.
        done: Results that exist already, as ``read_results`` returns them.
    """
    left_out = {(each["number"], each["algorithm"]) for each in done}
    return [
        RandomTrialSpec(number, algorithm)
        for number in range(count)
        for algorithm in algorithms
        if (number, algorithm) not in left_out
    ]


def read_results(file: Path) -> list[dict[str, Any]]:
    """Read the lines of earlier results; an incomplete last line is left out.

    Raises:
        OSError: If the file exists and cannot be read.
        ValueError: If it has other lines.
    """
    return read_log(file, _KEYS, "the result of a trial on a random map")


def run_random_trial(spec: RandomTrialSpec) -> RandomTrialResult:
    """Run one trial."""
    map_ = make_random_map(spec.number)
    truth = raster_truth(map_, SAFETY_DISTANCE, spec.reach)
    drive = _drive(spec, map_)
    return RandomTrialResult(
        **asdict(spec),
        family=spec.family,
        sensor=spec.sensor,
        side_offset=spec.side_offset,
        expected=truth.expectation.value,
        outcome=drive.outcome,
        collisions=drive.collisions,
        path_length=drive.path_length,
        shortest_path=truth.shortest,
        time=drive.time,
        note=drive.note,
    )


def _drive(spec: RandomTrialSpec, map_: RandomMap) -> Drive:
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
    return drive_mission(host, mission)


def load_random_map(map_: RandomMap) -> Scene:
    """Load a random map as a file of it would be."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"random_{map_.number}.yaml"
        path.write_text(map_.as_yaml())
        return load_map(path)


def run_random_trials(
    specs: Sequence[RandomTrialSpec], *, workers: int
) -> Generator[RandomTrialResult, None, None]:
    """Run trials on several cores, and yield each result as soon as there is one.

    Args:
        specs: The trials.
        workers: Number of processes; with one, all trials run in this process.
    """
    with closing(run_tasks(run_random_trial, specs, workers=workers)) as running:
        yield from (result.unwrap() for result in running)
