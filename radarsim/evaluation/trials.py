"""Scored runs of Bug1 and Bug2: what a robot did, judged by the map and the truth.

A trial runs server and client in lockstep. The judge sees what the robot does not:
where it really is, what it touches, and how long the shortest path is.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from typing import Any

from radarsim.client import Client
from radarsim.errors import ClientError, MapError, NavigationError
from radarsim.evaluation.ground_truth import GroundTruthMonitor
from radarsim.evaluation.shortest_path import shortest_path
from radarsim.evaluation.workers import worker_pool
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.navigation.mission import Mission, run_mission
from radarsim.navigation.options import ROBOT, Algorithm
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene, Trial
from radarsim.simulation.config import SimulationConfig

MAPS = (
    *("bug_box", "bug_u_trap", "bug_spiral", "bug_closed_box", "bug_maze"),
    *("foliage_room", "hedge_garden"),
)
SENSORS = ("radar", "laser")
SCANNER = "lms200"
GOAL_REACH = 0.5  # m; who is farther from the goal than this has not reached it
TIME_LIMIT = 3600.0  # s of simulated time


@dataclass(frozen=True, slots=True)
class Entry:
    """One trial: what runs where."""

    map: str
    algorithm: str
    sensor: str
    seed: int


@dataclass(frozen=True, slots=True)
class Score:
    """What came of a trial.

    Attributes:
        map: Name of the map.
        algorithm: ``bug1`` or ``bug2``.
        sensor: Name of the preset; every one of them looks all the way round.
        seed: Of the simulation.
        outcome: ``reached`` if the robot says so and is there, ``no_path`` if it says
            so, ``failed`` otherwise.
        collisions: How often it began to touch something.
        path_length: True way of the robot's centre, m.
        shortest_path: m, for a robot that keeps half its diagonal from everything
            solid; None if there is no path.
        time: Simulated s.
        circuits: How often the robot went all round an obstacle.
        off: True distance to the goal at the end, m.
        note: Why it failed; empty if it did not.
    """

    map: str
    algorithm: str
    sensor: str
    seed: int
    outcome: str
    collisions: int
    path_length: float
    shortest_path: float | None
    time: float
    circuits: int
    off: float
    note: str

    @property
    def right(self) -> bool:
        """Whether it did what the map allows, and touched nothing."""
        wanted = "no_path" if self.shortest_path is None else "reached"
        return self.outcome == wanted and not self.collisions

    def to_dict(self) -> dict[str, Any]:
        """Give it for JSON, rounded to mm and ms."""
        rounded = {"path_length", "shortest_path", "time", "off"}
        return {
            key: round(value, 3) if key in rounded and value is not None else value
            for key, value in asdict(self).items()
        }


def entries(
    maps: Sequence[str], algorithms: Sequence[str], sensors: Sequence[str], seeds: int
) -> list[Entry]:
    """Combine everything with everything, map by map."""
    return [
        Entry(map_, algorithm, sensor, seed)
        for map_, algorithm, sensor, seed in product(
            maps, algorithms, sensors, range(seeds)
        )
    ]


def config_with_sensor(sensor: str) -> SimulationConfig:
    """Give the robot a sensor that looks all the way round, at the radar's steps.

    Raises:
        PresetError: If there is no such sensor.
    """
    fan = {"sensor": sensor, "fov_deg": 359, "resolution_deg": 1}
    config = SimulationConfig(item_settings={SCANNER: fan})
    config.check()
    return config


def load_trial(map_: str) -> tuple[Scene, Trial]:
    """Load a map that says what there is to try.

    Raises:
        MapError: If it is wrong, or does not say.
    """
    scene = load_map(map_)
    if scene.trial is None:
        raise MapError([f"{map_}: no 'trial', expected a start, a goal and a distance"])
    return scene, scene.trial


def run_trial(entry: Entry) -> Score:
    """Run one trial.

    Raises:
        MapError: If the map is wrong, or does not say what there is to try.
        PresetError: If there is no such sensor.
    """
    scene, trial, shortest = _prepared(entry.map)
    host = Host(scene, config=config_with_sensor(entry.sensor), seed=entry.seed)
    monitor = GroundTruthMonitor(host)
    mission = Mission(
        algorithm=Algorithm(entry.algorithm),
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        time_limit=TIME_LIMIT,
    )
    outcome, note, circuits = "failed", "", 0
    with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
        try:
            result = run_mission(client, mission)
            outcome, circuits = result.outcome, result.circuits
            note = "" if outcome != "failed" else f"not there after {TIME_LIMIT:g} s"
        except (ClientError, NavigationError) as error:
            note = str(error)
    off = monitor.distance(trial.goal)
    if outcome == "reached" and off > GOAL_REACH:
        outcome, note = "failed", f"says reached, {off:.2f} m from the goal"
    return Score(
        **asdict(entry),
        outcome=outcome,
        collisions=monitor.collisions,
        path_length=monitor.path_length,
        shortest_path=shortest,
        time=host.simulation.time,
        circuits=circuits,
        off=off,
        note=note,
    )


@cache
def _prepared(map_: str) -> tuple[Scene, Trial, float | None]:
    """Load a map and find its shortest path, once in a process."""
    scene, trial = load_trial(map_)
    found_start = scene.start(trial.start)
    assert found_start is not None  # the map was checked when it was read
    start = found_start.pose
    model = load_robot(ROBOT)
    clearance = math.hypot(model.length, model.width) / 2
    found = shortest_path(scene, (start.x, start.y), trial.goal, clearance)
    return scene, trial, None if found is None else found[0]


def run_trials(wanted: Sequence[Entry], *, workers: int) -> Iterator[Score]:
    """Run trials on several cores; they come in their order.

    Args:
        wanted: What to run.
        workers: Processes; with one, all runs in this one.

    Raises:
        MapError: If a map is wrong, or does not say what there is to try.
        PresetError: If there is no such sensor.

    Whoever stops in between ends those that still run.
    """
    _check(wanted)
    if workers == 1 or len(wanted) == 1:
        yield from map(run_trial, wanted)
        return
    with worker_pool(workers) as pool:
        yield from pool.map(run_trial, wanted)


def _check(wanted: Sequence[Entry]) -> None:
    """Find out what is wrong before anything runs."""
    for map_ in dict.fromkeys(entry.map for entry in wanted):
        load_trial(map_)
    for sensor in dict.fromkeys(entry.sensor for entry in wanted):
        config_with_sensor(sensor)
