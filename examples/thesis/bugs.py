"""Figures 13 and 14: Bug1 and Bug2 reach a goal, and find that there is no path."""

from typing import Final

from common import SEED, Drawn
from matplotlib.figure import Figure

from radarsim.autonomy.evaluation.navigation_run import NavigationRun
from radarsim.autonomy.evaluation.trials import load_trial
from radarsim.autonomy.plans import Algorithm, Mission
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.autonomy.plotting.runs import RunView, run_figure
from radarsim.server.host import Host
from radarsim.simulation.map_warnings import plan_height

OPEN, CLOSED = "bug_u_trap", "bug_closed_box"  # maps with and without a path
ENDINGS: Final = {
    "reached": "reaches its goal",
    "no_path": "finds that there is no path",
}
LEAVING: Final = {
    Algorithm.BUG1: "goes all the way round it, and leaves it where it came nearest",
    Algorithm.BUG2: "goes along it, and leaves it on the line to the goal, if nearer",
}


def drive(map_: str, algorithm: Algorithm) -> NavigationRun:
    """Drive a robot towards the goal of a map's trial."""
    scene, trial = load_trial(map_)
    mission = Mission(
        algorithm=algorithm,
        goals=(trial.goal,),
        start=trial.start,
        safety_distance=trial.safety_distance,
        time_limit=600.0,
    )
    run = NavigationRun(mission, Host(scene, seed=SEED))
    run.execute()
    return run


def draw_bug(algorithm: Algorithm) -> tuple[Figure, str]:
    """Draw a run that reaches the goal next to one that finds no path."""
    name, views, endings = algorithm.value.capitalize(), [], []
    for map_ in (OPEN, CLOSED):
        run = drive(map_, algorithm)
        scene, monitor = run.scene, run.monitor
        assert scene is not None
        assert monitor is not None  # the server is in this process
        # From the simulation: the robot's own figures drift with its inertial sensor.
        ending = f"{ENDINGS[run.outcome]}, after {monitor.path_length:.1f} m"
        views.append(
            RunView(
                run.run_log,
                f"{name} {ending}",
                run.mission.robot_class,
                "radar",
                outlines_of(scene, plan_height(scene)),
                true_path=monitor.positions,
            )
        )
        endings.append(f"in {map_} it {ending} and {monitor.collisions} touches")
    caption = (
        f"{name} drives towards the goal until something is in the way (H1),"
        f" {LEAVING[algorithm]} (L1): {'; '.join(endings)}."
    )
    return run_figure(views, text=13.0), caption


def draw() -> Drawn:
    """Draw figures 13 and 14."""
    return {
        "figure_13.png": draw_bug(Algorithm.BUG1),
        "figure_14.png": draw_bug(Algorithm.BUG2),
    }
