"""Simulated runs of plans and navigator trials, evaluated with the ground truth.

The results contain values that the robot cannot measure itself: its true pose, its
collisions, and the length of the shortest path. The client and the server run in
lockstep.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from radarsim.autonomy.evaluation.map_score import Score
from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.run_log import rounded
from radarsim.autonomy.plans import ROBOT, Algorithm, ExplorationPlan, Mission, Rule
from radarsim.errors import (
    ClientError,
    MapError,
    MappingError,
    NavigationError,
    TooNearError,
)
from radarsim.presets.robots import load_robot
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene, Trial
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

MAPS = (
    "bug_box",
    "bug_u_trap",
    "bug_spiral",
    "bug_closed_box",
    "bug_maze",
    "foliage_room",
    "hedge_garden",
)
SCANNER = "lms200"
GOAL_TOLERANCE = 0.5  # m; largest true distance at which a goal is reached
TIME_LIMIT = 3600.0  # s of simulated time


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """The result of a trial according to the ground truth, and the trial's parameters.

    Attributes:
        outcome: For a drive, ``reached`` if the robot reports that and is at the goal,
            ``no_path`` or ``too_near`` if the robot reports that, ``failed`` otherwise;
            for a map, the outcome of the exploration.
        collisions: Number of contacts that began.
        path_length: Length of the true path of the robot's centre, m.
        shortest_path: Length of the shortest path for a robot that keeps half its
            diagonal from solid obstacles, m; None if there is no path.
        time: Simulated time, s.
        circuits: Number of complete circuits around obstacles.
        off: True distance to the goal at the end, m; nan without a goal.
        note: Reason of a failure; empty without one.
        measured_length: Length of the path measured by the robot, m; nan if it was not
            needed.
        score: Comparison of a map with the scene.
        map: Name of the map of a trial; empty for other runs.
        algorithm: Name of the algorithm.
        sensor: Name of the sensor preset, with a full circle of view.
        seed: Seed of the simulation.
        rule: Rule of the bumpers.
    """

    outcome: str
    collisions: int
    path_length: float
    shortest_path: float | None = None
    time: float
    circuits: int = 0
    off: float = math.nan
    note: str = ""
    measured_length: float = math.nan
    score: Score | None = None
    map: str = ""
    algorithm: str = ""
    sensor: str = ""
    seed: int = 0
    rule: str = Rule.SHARE.value

    @property
    def is_correct(self) -> bool:
        """Whether the outcome is correct for the map, and no collision happened."""
        correct = "no_path" if self.shortest_path is None else "reached"
        return self.outcome == correct and not self.collisions

    def to_dict(self) -> dict[str, Any]:
        """Return the result of the trial for JSON, rounded to 1 mm and 1 ms."""
        what = ("map", "algorithm", "sensor", "seed", "rule")
        how = ("outcome", "collisions", "path_length", "shortest_path", "time")
        return self.select((*what, *how, "circuits", "off", "note"))

    def select(self, names: Iterable[str], digits: int = 3) -> dict[str, Any]:
        """Return the values or scores with the given names, rounded for JSON."""
        values = vars(self) | (self.score or {})
        return {name: rounded(values.get(name), digits) for name in names}


def run_plan(
    plan: Mission | ExplorationPlan,
    host: Host,
    *,
    seed: int = 0,
) -> TrialResult:
    """Let a robot carry out a plan in lockstep, and judge it by the ground truth.

    Args:
        plan: A drive to a goal, or an exploration, whose map is scored.
        host: The server.
        seed: Seed of exploration strategies that use chance.
    """
    if isinstance(plan, Mission):
        return _drive(plan, host)
    run, note = MappingRun(plan, host, seed=seed), ""
    try:
        run.run()
    except (ClientError, MappingError, NavigationError) as error:
        note = str(error)
    run.judge()
    monitor, trip = run.monitor, run.source.trip
    return TrialResult(
        outcome=str(run.source.outcome),
        collisions=0 if monitor is None else monitor.collisions,
        path_length=0.0 if monitor is None else monitor.path_length,
        time=trip.time,
        note=note,
        measured_length=trip.length,
        score=run.score,
    )


def _drive(mission: Mission, host: Host) -> TrialResult:
    monitor = GroundTruthMonitor(host)
    outcome, note, circuits = "failed", "", 0

    with monitor.open_client() as client:
        try:
            result = run_mission(client, mission)
            outcome, circuits = result.outcome, result.circuits
            limit = f"not there after {mission.time_limit:g} s"
            note = "" if outcome != "failed" else limit
        except (ClientError, NavigationError) as error:
            outcome = "too_near" if isinstance(error, TooNearError) else "failed"
            note = str(error)
    row = judge_drive(host, monitor, monitor.off_goal(mission), outcome, note)
    return replace(row, circuits=circuits)


def judge_drive(
    host: Host, monitor: GroundTruthMonitor, off: float, outcome: str, note: str
) -> TrialResult:
    """Return the result of a drive: failed if the robot reports the goal elsewhere.

    Args:
        host: The server.
        monitor: Ground truth monitor of the robot.
        off: True distance to the goal, m.
        outcome: The outcome that the robot reports.
        note: Reason of a failure; empty without one.
    """
    # The estimated pose drifts, so a robot may report the goal at a wrong position.
    if outcome == "reached" and off > GOAL_TOLERANCE:
        outcome, note = "failed", f"says reached, {off:.2f} m from the goal"
    return TrialResult(
        outcome=outcome,
        collisions=monitor.collisions,
        path_length=monitor.path_length,
        time=host.simulation.time,
        off=off,
        note=note,
    )


def config_with_sensor(sensor: str, **settings: Any) -> SimulationConfig:
    """Configure the scanner as a sensor that covers a full circle in steps of 1 degree.

    Args:
        sensor: Name of the preset.
        **settings: Other settings of the sensor.

    Raises:
        PresetError: If the sensor does not exist, or a setting is invalid.
    """
    settings = {"fov_deg": 359, "resolution_deg": 1, **settings, "sensor": sensor}
    config = SimulationConfig(item_settings={SCANNER: settings})
    config.check()
    return config


@cache
def load_trial(map_: str) -> tuple[Scene, Trial]:
    """Load a map that defines a trial; each process loads a map only once.

    Raises:
        MapError: If the map is invalid, or defines no trial.
    """
    scene = load_map(map_)
    if scene.trial is None:
        raise MapError([f"{map_}: no 'trial', expected a start, a goal and a distance"])
    return scene, scene.trial


def run_trial(
    map_: str, algorithm: str, sensor: str, seed: int, rule: str = Rule.SHARE.value
) -> TrialResult:
    """Run one trial with the arguments that ``TrialResult`` describes.

    Raises:
        MapError: If the map is invalid, or defines no trial.
        PresetError: If the sensor does not exist.
    """
    scene, _ = load_trial(map_)
    host = Host(scene, config=config_with_sensor(sensor), seed=seed)
    result = drive_trial(host, algorithm, rule)
    return replace(
        result, map=map_, algorithm=algorithm, sensor=sensor, seed=seed, rule=rule
    )


def drive_trial(
    host: Host,
    algorithm: str,
    rule: str = Rule.SHARE.value,
    time_limit: float = TIME_LIMIT,
) -> TrialResult:
    """Drive a robot through the trial that the map of a host defines."""
    trial = host.scene.trial
    assert trial is not None
    mission = Mission(
        algorithm=Algorithm(algorithm),
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        rule=Rule(rule),
        time_limit=time_limit,
    )
    shortest = shortest_for(host.scene, trial)
    return replace(run_plan(mission, host), shortest_path=shortest)


@cache
def shortest_for(scene: Scene, trial: Trial) -> float | None:
    """Return the length of a trial's shortest path, m; None without a path."""
    start = scene.start(trial.start)
    assert start is not None  # checked when the map was loaded
    model = load_robot(ROBOT)
    clearance = math.hypot(model.length, model.width) / 2
    path = shortest_path(scene, (start.pose.x, start.pose.y), trial.goal, clearance)
    return None if path is None else path[0]
