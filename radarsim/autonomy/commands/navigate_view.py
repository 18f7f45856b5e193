"""What pictures and films of ``radarsim navigate`` show, from a run."""

from __future__ import annotations

from typing import Final

from radarsim.autonomy.commands.film import drawn_robot
from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, NavigationRun
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.plotting.film import Pixels
from radarsim.autonomy.plotting.outlines import Outline, outlines_of
from radarsim.autonomy.plotting.run_film import RunFrames, first_extent
from radarsim.autonomy.plotting.runs import NO_PATH, RunView, SteeringSensor
from radarsim.errors import PresetError
from radarsim.geometry import Floats
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import load_settings
from radarsim.simulation.map_warnings import plan_height

ACTIVITIES: Final = {
    Activity.GOING: "going to the goal",
    Activity.ALIGNING: "following a boundary",
    Activity.FOLLOWING: "following a boundary",
    Activity.RETURNING: "returning to the leave point",
    Activity.REACHED: "goal reached",
    Activity.NO_PATH: "there is no path",
}

ENDINGS: Final = {
    "reached": "reaches its goal",
    "no_path": "finds that there is no path",
}
ENDED: Final = {Activity.REACHED: "reached", Activity.NO_PATH: "no_path"}


def view_of(run: NavigationRun) -> RunView:
    """Return how a run is drawn; it has at least one row."""
    return RunView(
        run.run_log,
        headline(run),
        drawn_robot(run.mission.robot_class).name,
        sensor_of(run),
        outlines=true_outlines(run),
        subtitle=_summary(run),
        true_path=true_path(run),
    )


def headline(run: NavigationRun) -> str:
    """Return what the bug does, or has done, in words."""
    if run.error == INTERRUPTED:
        return f"{_title(run)}, interrupted"
    return _title(run, ENDINGS.get(run.outcome, "fails"))


def _title(run: NavigationRun, what: str = "") -> str:
    """Return the name of the algorithm, what it does, and where."""
    where = "" if run.scene is None else f"in {run.scene.name}"
    name = run.mission.algorithm.value.capitalize()
    return " ".join(word for word in (name, what, where) if word)


def sensor_of(run: NavigationRun) -> SteeringSensor | None:
    """Return the sensor that a robot steers by; None if the class is unknown."""
    try:
        items = load_robot(run.mission.robot_class).items_of("RangeScanner")
    except PresetError:
        return None
    wanted = (run.mission.scanner or items[0].name).casefold()
    for item in items:
        if item.name.casefold() == wanted and item.sensor is not None:
            return SteeringSensor(item.sensor, load_settings(item.sensor).medium)
    return None


def true_outlines(run: NavigationRun) -> tuple[Outline, ...]:
    """Return the outlines of the scene, if it is known."""
    scene = run.scene
    return () if scene is None else outlines_of(scene, plan_height(scene))


def true_path(run: NavigationRun) -> Floats:
    """Return the path that the robot truly drove, (N, 2) m; none if it is unknown."""
    return NO_PATH if run.monitor is None else run.monitor.positions


def _summary(run: NavigationRun) -> str:
    path = f"{run.run_log.path_length:.1f} m in {run.run_log.time:.0f} s"
    if run.circuits:
        path += f", {run.circuits} circuit{'s' * (run.circuits != 1)}"
    if run.monitor is None:
        return path
    away = run.monitor.distance(run.mission.goals[-1])
    return f"{path}, in truth {away:.2f} m from the goal"


class RunCamera:
    """Draws frames of a navigation run."""

    def __init__(self, run: NavigationRun) -> None:
        self._run = run
        self._frames: RunFrames | None = None

    def draw(self) -> Pixels:
        """Draw the run as it is; at least one row."""
        run, run_log = self._run, self._run.run_log
        if self._frames is None:
            self._frames = self._prepare()
        row = run_log.rows[-1]
        status = f"{run_log.time:.1f} s, {run_log.path_length:.1f} m"
        status = f"{status}, {ACTIVITIES[row.activity]}"
        ending = ENDINGS.get(ENDED.get(row.activity, ""), "drives to its goal")
        title = _title(run, ending)
        return self._frames.draw(run_log, true_path(run), status, title)

    def _prepare(self) -> RunFrames:
        run, outlines = self._run, true_outlines(self._run)
        row = run.run_log.rows[0]
        return RunFrames(
            first_extent(outlines, (row.x, row.y), run.mission.goals),
            _title(run, "drives to its goal"),
            drawn_robot(run.mission.robot_class).name,
            sensor_of(run),
            outlines,
            returns=run.mission.algorithm is Algorithm.BUG1,
        )
