"""Figures 13 and 14: Bug1 and Bug2, success and failure, from real runs."""

from dataclasses import dataclass
from typing import Final

from radarsim.client import Client
from radarsim.evaluation.free_space import floor_plan
from radarsim.evaluation.ground_truth import GroundTruthMonitor
from radarsim.evaluation.trials import load_trial
from radarsim.figures.figure import DrawnFigure
from radarsim.figures.scan_spec import ROBOT
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.navigation.mission import Mission, run_mission
from radarsim.navigation.options import Algorithm
from radarsim.navigation.run_log import RunLog
from radarsim.navigation.runner import NavigationStep
from radarsim.plotting.runs import figure_of

OPEN: Final = "bug_u_trap"  # a goal that can be reached
CLOSED: Final = "bug_closed_box"  # and one that cannot
ENDINGS: Final = {"reached": "goal reached", "no_path": "no path"}
LIMIT: Final = 600.0  # s of simulated time


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a bug, as the robot measured it and as it truly was.

    Attributes:
        map: Name of the map.
        algorithm: The bug algorithm.
        run_log: The run as the robot measured it.
        outcome: ``reached``, ``no_path`` or ``failed``.
        circuits: Number of complete circuits around obstacles.
        collisions: True number of collisions.
        length: True path length, m.
        off: True distance to the goal at the end, m.
    """

    map: str
    algorithm: Algorithm
    run_log: RunLog
    outcome: str
    circuits: int
    collisions: int
    length: float
    off: float


def run(map_: str, algorithm: Algorithm, seed: int) -> Run:
    """Drive a robot towards the goal of a map's trial."""
    scene, trial = load_trial(map_)
    host = Host(scene, seed=seed)
    monitor, run_log = GroundTruthMonitor(host), RunLog()
    mission = Mission(
        algorithm=algorithm,
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        time_limit=LIMIT,
    )

    def observe(moment: NavigationStep) -> None:
        run_log.add(moment)

    with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
        result = run_mission(client, mission, observe)
    return Run(
        map_,
        algorithm,
        run_log,
        result.outcome,
        result.circuits,
        monitor.collisions,
        monitor.path_length,
        monitor.distance(trial.goal),
    )


def draw_bug(seed: int, *, algorithm: Algorithm) -> DrawnFigure:
    """Draw a run that reaches the goal above one that finds no path."""
    runs = [run(map_, algorithm, seed) for map_ in (OPEN, CLOSED)]
    plans = [floor_plan(load_trial(each.map)[0]) for each in runs]
    drawings = tuple(
        figure_of(each.run_log, _title(each), plan)
        for each, plan in zip(runs, plans, strict=True)
    )
    options = [f"--serve {each.map} --algorithm {algorithm.value}" for each in runs]
    commands = tuple(f"radarsim navigate {each} --seed {seed}" for each in options)
    return DrawnFigure(drawings, _caption(*runs), commands)


def _caption(above: Run, below: Run) -> str:
    how = {
        Algorithm.BUG1: "all round its boundary, then back to the point of it that is"
        " nearest to the goal",
        Algorithm.BUG2: "along its boundary until that crosses the line to the goal,"
        " nearer to it than where it was met",
    }[above.algorithm]
    name, touches = above.algorithm.value, above.collisions + below.collisions
    return (
        f"{name.capitalize()} drives a {ROBOT} by the eight bumpers of its radar: in a"
        " straight line towards the goal (G) until something is in the way (H),"
        f" {how} (L), and on from there. Above: {_ending(above)}. Below, where the goal"
        f" is in a closed box: {_ending(below)}. It touched something {touches} times."
        " Ways are where the robot believes to be, by its drifting INS; grey is where"
        " its beams ended, black the map that it does not know."
    )


def _ending(run: Run) -> str:
    rounds = f"{run.circuits} time{'s' * (run.circuits != 1)}"
    ending = ENDINGS.get(run.outcome, run.outcome)
    return (
        f"{ending} after {run.length:.1f} m, {rounds} all round an obstacle, in truth"
        f" {run.off:.2f} m from the goal"
    )


def _title(run: Run) -> str:
    ending = ENDINGS.get(run.outcome, run.outcome)
    return f"{run.algorithm.value.capitalize()} in {run.map}: {ending}"
