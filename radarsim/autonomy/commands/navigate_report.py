"""What ``radarsim navigate`` prints during a run and after it."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, NavigationRun
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.run_log import AT_BOUNDARY, Row, RunLog
from radarsim.cli.compile_progress import live_status
from radarsim.geometry import Point

ENDINGS = {"reached": "goal reached", "no_path": "no path"}


@contextmanager
def run_progress(run_log: RunLog) -> Iterator[Callable[[Row], None]]:
    """Show the progress of a run on stderr.

    Args:
        run_log: Rows of the run so far.

    Yields:
        A function to be called with each row after it has been added to the log.
    """
    with live_status(lambda: describe_status(run_log)) as log:

        def update(row: Row) -> None:
            previous = run_log.rows[-2] if len(run_log.rows) > 1 else None
            if previous is None or _state(previous) != _state(row):
                change = describe_change(run_log, previous, row)
                log(f"{run_log.time:8.1f} s  {change}")

        yield update


def _state(row: Row) -> tuple[Activity, Point | None]:
    return row.activity, row.goal


def describe_status(run_log: RunLog) -> str:
    """Return the state of a run in one line."""
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


def describe_change(run_log: RunLog, previous: Row | None, row: Row) -> str:
    """Return what changed between two consecutive rows of a run.

    Args:
        run_log: The run up to the second row.
        previous: The first row; None at the start of the run.
        row: The second row.
    """
    was_at_boundary = (
        previous is not None
        and previous.activity in AT_BOUNDARY
        and previous.goal == row.goal
    )
    position = f"{row.x:.2f} {row.y:.2f}"
    if row.activity is Activity.GOING and row.goal is not None:
        x, y = row.goal
        change = f"going to {x:.2f} {y:.2f}, {row.goal_distance:.2f} m away"
        if not was_at_boundary:
            return change
        return f"leave point {len(run_log.leave_points)} at {position}, {change}"
    if row.activity in AT_BOUNDARY and not was_at_boundary:
        return (
            f"hit point {len(run_log.hit_points)} at {position}, {row.activity.value}"
        )
    return row.activity.value.replace("_", " ")


def as_json(run: NavigationRun) -> str:
    """Return the summary of a run as one line of JSON."""
    return json.dumps(run.to_dict(), allow_nan=False)


def as_text(run: NavigationRun) -> list[str]:
    """Return the summary of a run as lines of text."""
    summary = run.summary()
    nearest = summary["nearest_obstacle"]
    near = f"nearest obstacle {nearest:.2f} m"
    if not math.isfinite(nearest):
        near = "nothing was met"
    lines = [
        f"{_ending(run)} by {summary['algorithm']}: {_points_text(run.mission.goals)}",
        f"path          {summary['path_length']:.2f} m in {summary['time']:.1f} s;"
        f" {near}",
        f"hit points    {_points_text(summary['hit_points'])}",
        f"leave points  {_points_text(summary['leave_points'])}",
        f"circuits      {summary['circuits']}",
    ]
    if judge := summary.get("judge"):
        lines.append(
            f"in truth      {judge['path_length']:.2f} m,"
            f" collisions: {judge['collisions']},"
            f" {judge['goal_distance']:.2f} m from the goal"
        )
    return lines


def _ending(run: NavigationRun) -> str:
    if run.error == INTERRUPTED:
        return INTERRUPTED
    return ENDINGS.get(run.outcome, "failed")


def _points_text(points: Sequence[Point]) -> str:
    return ", ".join(f"{x:.2f} {y:.2f}" for x, y in points) or "none"
