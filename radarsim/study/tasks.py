"""The tasks of the study: drive to a goal, or map, with one sensor on one map."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from radarsim.errors import ClientError, MappingError, NavigationError
from radarsim.evaluation.mapping_run import MappingRun
from radarsim.evaluation.shortest_path import shortest_path
from radarsim.evaluation.trials import SCANNER, drive_mission
from radarsim.exploration.exploration import ExplorationPlan
from radarsim.host import Host
from radarsim.navigation.mission import Mission
from radarsim.navigation.options import Algorithm
from radarsim.simulation.config import SimulationConfig
from radarsim.study.maps import KINDS, make_study_map

MAPPING: Final = "map"
RADAR: Final = "radar"
SENSORS: Final = (RADAR, "physical", "hokuyo", "sick")
QUICK: Final = ("smoke_corridor",)
MAPPED: Final = ("hidden_room", "office")  # rooms with walls around
ROBOT_RADIUS: Final = 0.37  # m; half the diagonal of a P3AT
BEAMS: Final = {"fov_deg": 358, "resolution_deg": 2}  # as many as in half a circle by 1
DRIVING_TIME: Final = 900.0  # s of simulated time
MAPPING_TIME: Final = 120.0  # s of simulated time

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class StudyTask:
    """One run.

    Attributes:
        seed: Seed of the map and of the simulation.
        map: Kind of the map.
        sensor: Sensor preset, which looks all the way round.
        method: Algorithm that drives to the goal, or ``map``.
    """

    seed: int
    map: str
    sensor: str
    method: str


def study_tasks(
    seeds: int, algorithm: Algorithm, kinds: Sequence[str] = KINDS
) -> list[StudyTask]:
    """Return all tasks, seed by seed.

    Args:
        seeds: Number of seeds.
        algorithm: Algorithm that drives to the goals.
        kinds: Kinds of maps.
    """
    return [
        StudyTask(seed, map_, sensor, method)
        for seed in range(seeds)
        for map_ in kinds
        for sensor in SENSORS
        for method in (
            algorithm.value,
            *((MAPPING,) if map_ in MAPPED else ()),
        )
    ]


def run_study_task(task: StudyTask) -> Row:
    """Run a task and return its row, rounded to mm, ms, and four digits of shares."""
    row = _map_row(task) if task.method == MAPPING else _drive_row(task)
    return asdict(task) | {
        key: round(value, 4 if "coverage" in key or "within" in key else 3)
        if isinstance(value, float)
        else value
        for key, value in row.items()
    }


def _config(sensor: str) -> SimulationConfig:
    return SimulationConfig(item_settings={SCANNER: {"sensor": sensor, **BEAMS}})


def _drive_row(task: StudyTask) -> Row:
    """Drive to the goal; what is right is decided by the robot's own size."""
    map_ = make_study_map(task.map, task.seed)
    scene = map_.load()
    shortest = shortest_path(scene, map_.start, map_.goal, ROBOT_RADIUS)
    host = Host(scene, config=_config(task.sensor), seed=task.seed)
    mission = Mission(
        algorithm=Algorithm(task.method), goals=(map_.goal,), time_limit=DRIVING_TIME
    )
    drive = drive_mission(host, mission)
    expected = "no_path" if shortest is None else "reached"
    return {
        "expected": expected,
        "outcome": drive.outcome,
        "collisions": drive.collisions,
        "path_length": drive.path_length,
        "shortest_path": None if shortest is None else shortest[0],
        "time": drive.time,
        "note": drive.note,
    }


def _map_row(task: StudyTask) -> Row:
    """Explore for a while, and compare the map with the scene."""
    scene = make_study_map(task.map, task.seed).load()
    host = Host(scene, config=_config(task.sensor), seed=task.seed)
    run = MappingRun(ExplorationPlan(time_limit=MAPPING_TIME), host, seed=task.seed)
    try:
        run.run(("", 0))
    except (ClientError, MappingError, NavigationError) as error:
        run.result.error = str(error)
    run.judge()
    result, score, monitor = run.result, run.result.score, run.result.monitor
    row: Row = {
        "outcome": result.outcome,
        "collisions": 0 if monitor is None else monitor.collisions,
        "path_length": 0.0 if monitor is None else monitor.path_length,
        "time": result.trip.time,
        "reachable_coverage": None if score is None else score.reachable_coverage,
        "hidden_coverage": None if score is None else score.hidden_coverage,
        "within_two_cells": None if score is None else score.within_two_cells,
        "note": result.error,
    }
    return row
