"""What ``radarsim navigate`` prints once a run is over."""

import json
import math
from collections.abc import Sequence

from radarsim.evaluation.navigation_run import NavigationRun
from radarsim.navigation.bug import Point

ENDINGS = {"reached": "goal reached", "no_path": "no path"}


def as_json(run: NavigationRun) -> str:
    """Return the summary of a run as one line of JSON."""
    return json.dumps(run.to_dict(), allow_nan=False)


def as_text(run: NavigationRun) -> list[str]:
    """Return the summary of a run as lines of text."""
    summary = run.summary()
    nearest = summary["nearest_obstacle"]
    met = math.isfinite(nearest)
    near = f"nearest obstacle {nearest:.2f} m" if met else "nothing was met"
    lines = [
        f"{ending_of(run)} by {summary['algorithm']}: {_places(run.mission.goals)}",
        f"path          {summary['path_length']:.2f} m in {summary['time']:.1f} s;"
        f" {near}",
        f"hit points    {_places(summary['hit_points'])}",
        f"leave points  {_places(summary['leave_points'])}",
        f"circuits      {summary['circuits']}",
    ]
    if judge := summary.get("judge"):
        lines.append(
            f"in truth      {judge['path_length']:.2f} m,"
            f" collisions: {judge['collisions']},"
            f" {judge['goal_distance']:.2f} m from the goal"
        )
    return lines


def ending_of(run: NavigationRun) -> str:
    """Return how a run ended; one that neither ended nor failed was broken off."""
    return ENDINGS.get(run.outcome, "failed" if run.error else "broken off")


def title_of(run: NavigationRun) -> str:
    """Return two lines to stand above a picture."""
    run_log = run.run_log
    name = run.mission.algorithm.value.capitalize()
    where = "" if run.scene is None else f" in {run.scene.name}"
    rounds = f"{run.circuits} circuit{'s' * (run.circuits != 1)}"
    return (
        f"{name}{where}: {ending_of(run)}\n"
        f"{run_log.path_length:.2f} m in {run_log.time:.1f} s, {rounds}"
    )


def _places(points: Sequence[Point]) -> str:
    return ", ".join(f"{x:.2f} {y:.2f}" for x, y in points) or "none"
