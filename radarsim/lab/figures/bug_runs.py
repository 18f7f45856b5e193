"""Figures 13 and 14: Bug1 and Bug2, success and failure, from real runs."""

from typing import Final

from radarsim.autonomy.evaluation.navigation_run import (
    GroundTruthMonitor,
    NavigationRun,
)
from radarsim.autonomy.evaluation.trials import load_trial
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.plans import Mission
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.autonomy.plotting.runs import RunView, SteeringSensor, run_figure
from radarsim.lab.figures.figure import ROBOT, DrawnFigure
from radarsim.server.host import Host
from radarsim.simulation.map_warnings import plan_height

OPEN: Final = "bug_u_trap"  # a goal that can be reached
CLOSED: Final = "bug_closed_box"  # and one that cannot
ENDINGS: Final = {"reached": "goal reached", "no_path": "no path"}
TITLES: Final = {
    "reached": "reaches its goal",
    "no_path": "finds that there is no path",
}
LIMIT: Final = 600.0  # s of simulated time
_TEXT: Final = 13.0  # points; the page shows it at half its size


def run(map_: str, algorithm: Algorithm, seed: int) -> NavigationRun:
    """Drive a robot towards the goal of a map's trial."""
    scene, trial = load_trial(map_)
    mission = Mission(
        algorithm=algorithm,
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        time_limit=LIMIT,
    )
    driven = NavigationRun(mission, Host(scene, seed=seed))
    driven.execute(("", 0))  # no address, as the server is in this process
    return driven


def draw_bug(seed: int, *, algorithm: Algorithm) -> DrawnFigure:
    """Draw a run that reaches the goal beside one that finds no path."""
    runs = [run(map_, algorithm, seed) for map_ in (OPEN, CLOSED)]
    drawing = run_figure([_view(each) for each in runs], text=_TEXT)
    options = f"--algorithm {algorithm.value} --seed {seed}"
    commands = [f"radarsim navigate {map_} {options}" for map_ in (OPEN, CLOSED)]
    return DrawnFigure(
        (drawing,), _caption(algorithm), tuple(commands), _details(*runs)
    )


def _view(run: NavigationRun) -> RunView:
    assert run.scene is not None
    return RunView(
        run.run_log,
        _title(run),
        run.mission.robot_class,
        SteeringSensor("radar", "radar"),
        outlines_of(run.scene, plan_height(run.scene)),
        true_path=_truth(run).positions,
    )


def _caption(algorithm: Algorithm) -> str:
    leaving, finding = {
        Algorithm.BUG1: (
            "goes all the way round it, and leaves it where it came nearest (L1)",
            "the wall is between it and the goal even there",
        ),
        Algorithm.BUG2: (
            "goes along it, and leaves it where it is back on the line to the goal, and"
            " nearer (L1)",
            "it comes back to H1 without having crossed that line nearer to the goal",
        ),
    }[algorithm]
    return (
        f"{algorithm.value.capitalize()} drives towards the goal until something is in"
        f" the way (H1), {leaving}. At the closed box on the right {finding}, so it"
        " knows that there is no path."
    )


def _details(left: NavigationRun, right: NavigationRun) -> str:
    touched = sum(_truth(each).collisions for each in (left, right))
    return (
        f"A {ROBOT} drives by the eight bumpers of its radar. On the left:"
        f" {_ending(left)}. On the right: {_ending(right)}. It touched something"
        f" {touched} times. The coloured path is where the robot believes to be, by its"
        " drifting INS, the dotted one where it truly is. The violet is where its beams"
        " ended, by that belief; the grey walls are the map, which it does not know."
    )


def _ending(run: NavigationRun) -> str:
    rounds = f"{run.circuits} time{'s' * (run.circuits != 1)}"
    ending = ENDINGS.get(run.outcome, run.outcome)
    return (
        f"{ending} after {_truth(run).path_length:.1f} m, {rounds} all round an"
        f" obstacle, in truth {_off(run):.2f} m from the goal"
    )


def _title(run: NavigationRun) -> str:
    name, ending = run.mission.algorithm.value, TITLES.get(run.outcome, run.outcome)
    length = _truth(run).path_length
    return f"{name.capitalize()} {ending}, after {length:.1f} m"


def _truth(run: NavigationRun) -> GroundTruthMonitor:
    assert run.monitor is not None  # the server is in this process
    return run.monitor


def _off(run: NavigationRun) -> float:
    """Return the true distance to the goal at the end, m."""
    return _truth(run).distance(run.mission.goals[-1])
