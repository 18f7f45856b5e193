"""Output of ``radarsim navigate``: progress, summary, picture and film of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Final

from radarsim.autonomy.cli.run_files import drawn_robot
from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, NavigationRun
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.run_log import Row, RunLog
from radarsim.autonomy.plans import Algorithm, Mission
from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.autonomy.plotting.runs import (
    NO_PATH,
    RunFrames,
    RunView,
    first_run_extent,
)
from radarsim.cli.progress import live_status
from radarsim.errors import PresetError
from radarsim.geometry import Floats, Point
from radarsim.plotting.film import Pixels
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import load_settings
from radarsim.simulation.map_warnings import plan_height

ACTIVITIES: Final = {
    Activity.GOING: "going to the goal",
    Activity.ALIGNING: "following a boundary",
    Activity.FOLLOWING: "following a boundary",
    Activity.RETURNING: "returning to the leave point",
    Activity.TURNING: "turning to the heading",
    Activity.REACHED: "goal reached",
    Activity.NO_PATH: "there is no path",
}
OUTCOMES: Final = {"reached": "goal reached", "no_path": "no path"}
ENDINGS: Final = {"reached": "reached", "no_path": "no path", "failed": "not reached"}
TITLES: Final = {
    "reached": "reaches its goal",
    "no_path": "finds that there is no path",
}
_DRIVES: Final = "drives to its goal"


@contextmanager
def run_progress(
    run_log: RunLog, update_film: Callable[[float], None]
) -> Iterator[Callable[[Row], None]]:
    """Show the progress of a navigation run on stderr, and film the run.

    Args:
        run_log: The log of the run so far.
        update_film: Adds a frame to the film, given the time in s.

    Yields:
        A function to be called with each row after it has been added to the log.
    """
    state: object = None
    hits = leaves = 0
    with live_status(lambda: describe_status(run_log)) as log:

        def update(row: Row) -> None:
            nonlocal state, hits, leaves
            update_film(row.time)
            last, state = state, (row.activity, row.goal)
            if last == state:
                return
            position, what = f"{row.x:.2f} {row.y:.2f}", row.activity.value
            change = what.replace("_", " ")
            if row.activity is Activity.GOING and row.goal is not None:
                x, y = row.goal
                change = f"going to {x:.2f} {y:.2f}, {row.goal_distance:.2f} m away"
            # The points of all goals are counted, including the goals reached before.
            if len(run_log.leave_points) > leaves:
                leaves = len(run_log.leave_points)
                change = f"leave point {leaves} at {position}, {change}"
            if len(run_log.hit_points) > hits:
                hits = len(run_log.hit_points)
                change = f"hit point {hits} at {position}, {what}"
            log(f"{run_log.time:8.1f} s  {change}")

        yield update


def describe_status(run_log: RunLog) -> str:
    """Return the current state of a navigation run as one line of text."""
    if not run_log.rows:
        return "waiting for a scan"
    row = run_log.rows[-1]
    nearest = f"{row.nearest:5.2f} m" if math.isfinite(row.nearest) else "   none"
    return "  ".join(
        (
            f"{row.activity.value:9}",
            f"goal {row.goal_distance:6.2f} m",
            f"{run_log.time:7.1f} s",
            f"path {run_log.path_length:6.2f} m",
            f"nearest {nearest}",
            row.pressed,
        )
    ).rstrip()


def as_text(run: NavigationRun) -> list[str]:
    """Return the summary of a navigation run as lines of text."""

    def listed(points: Sequence[Point]) -> str:
        return ", ".join(f"{x:.2f} {y:.2f}" for x, y in points) or "none"

    summary = run.summary()
    nearest = summary["nearest_obstacle"]
    near = f"nearest obstacle {nearest:.2f} m"
    if not math.isfinite(nearest):
        near = "nothing was met"
    is_interrupted = run.error == INTERRUPTED
    ending = INTERRUPTED if is_interrupted else OUTCOMES.get(run.outcome, "failed")
    lines = [
        f"{ending} by {summary['algorithm']}: {listed(run.goals)}",
        f"path          {summary['path_length']:.2f} m in {summary['time']:.1f} s;"
        f" {near}",
        f"hit points    {listed(summary['hit_points'])}",
        f"leave points  {listed(summary['leave_points'])}",
        f"circuits      {summary['circuits']}",
    ]
    for number, leg in enumerate(summary["legs"] if len(run.goals) > 1 else [], 1):
        lines.append(
            f"goal {number:<8} {listed([leg['goal']])}: {ENDINGS[leg['outcome']]},"
            f" {leg['path_length']:.2f} m in {leg['time']:.1f} s"
        )
    if judge := summary.get("judge"):
        lines.append(
            f"true path     {judge['path_length']:.2f} m,"
            f" collisions: {judge['collisions']},"
            f" {judge['goal_distance']:.2f} m from {_judged_goal(run.mission)}"
        )
    return lines


def _judged_goal(mission: Mission) -> str:
    """Return a phrase that names the goal to which the true distance is reported."""
    if mission.return_to_start:
        return "its start"
    return "the last goal" if len(mission.goals) > 1 else "the goal"


def view_of(run: NavigationRun) -> RunView:
    """Return a run, with at least one row in its log, as a view that can be drawn."""
    run_log, monitor, scene = run.run_log, run.monitor, run.scene
    subtitle = f"{run_log.path_length:.1f} m in {run_log.time:.0f} s"
    if run.circuits:
        subtitle += f", {run.circuits} circuit{'s' * (run.circuits != 1)}"
    if monitor is not None:
        away = monitor.off_goal(run.mission)
        subtitle += f", in truth {away:.2f} m from {_judged_goal(run.mission)}"
    return RunView(
        run_log,
        headline(run),
        drawn_robot(run.mission.robot_class).name,
        _medium_of(run),
        () if scene is None else outlines_of(scene, plan_height(scene)),
        subtitle=subtitle,
        true_path=_true_path(run),
    )


def headline(run: NavigationRun) -> str:
    """Return the title of a run with the algorithm, the outcome and the map."""
    if run.error == INTERRUPTED:
        return f"{_title(run)}, interrupted"
    return _title(run, TITLES.get(run.outcome, "fails"))


def _title(run: NavigationRun, what: str = "") -> str:
    """Return the name of the algorithm, its activity, and the name of the map."""
    where = "" if run.scene is None else f"in {run.scene.name}"
    name = run.mission.algorithm.value.capitalize()
    return " ".join(word for word in (name, what, where) if word)


def _medium_of(run: NavigationRun) -> str:
    """Return the type of the sensor used for navigation; empty if it is unknown."""
    try:
        items = load_robot(run.mission.robot_class).items_of("RangeScanner")
    except PresetError:
        return ""
    wanted = (run.mission.scanner or items[0].name).casefold()
    sensors = (each.sensor for each in items if each.name.casefold() == wanted)
    sensor = next(sensors, None)
    return "" if sensor is None else load_settings(sensor).medium


def _true_path(run: NavigationRun) -> Floats:
    return NO_PATH if run.monitor is None else run.monitor.positions


def run_camera(run: NavigationRun) -> Callable[[], Pixels]:
    """Return a function that draws the current state of a run after the first scan."""

    @cache  # called after the first row, which has the robot's start
    def film() -> tuple[RunView, RunFrames]:
        view, row = view_of(run), run.run_log.rows[0]
        view = replace(view, title=_title(run, _DRIVES))
        place, goals = (row.x, row.y), run.mission.goals
        extent = first_run_extent(view.outlines, place, goals)
        returns = run.mission.algorithm is Algorithm.BUG1
        return view, RunFrames(extent, view, returns=returns)

    def draw() -> Pixels:
        view, frames = film()
        run_log = run.run_log
        activity = run_log.rows[-1].activity
        path = f"{run_log.time:.1f} s, {run_log.path_length:.1f} m"
        return frames.draw(
            replace(
                view,
                title=_title(run, TITLES.get(activity.value, _DRIVES)),
                subtitle=f"{path}, {ACTIVITIES[activity]}",
                true_path=_true_path(run),
            )
        )

    return draw
