"""A line on stderr that tells how things stand, for as long as they go on."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, Protocol

from rich.console import Console
from rich.live import Live
from rich.text import Text

from radarsim.navigation.bug import Activity, Point
from radarsim.navigation.run_log import AT_BOUNDARY, Row, RunLog

REFRESHES: Final = 8  # a second


class Lines:
    """Lines for where no line can live, one below the other."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def add(self, line: str) -> None:
        """Print one."""
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def living(present: Callable[[], str]) -> Iterator[Lines | None]:
    """Show how things stand by one line, if stderr is a terminal that can.

    Args:
        present: Says it; called only when the line is drawn.

    Yields:
        Where to tell of changes if it cannot.
    """
    console = Console(stderr=True)
    if not console.is_terminal or console.is_dumb_terminal:
        yield Lines(console)
        return
    line = _Line(present)
    with Live(line, console=console, refresh_per_second=REFRESHES, transient=True):
        yield None


class _Line:
    def __init__(self, present: Callable[[], str]) -> None:
        self._present = present

    def __rich__(self) -> Text:
        return Text(self._present(), no_wrap=True, overflow="ellipsis")


# Section from cli.progress.
# What a person is told on stderr while a robot finds its way.


class ProgressReporter(Protocol):
    """Tells of a run as it goes on."""

    def tell(self, row: Row) -> None:
        """Take notice of the moment that the record has got last."""


class NullReporter:
    """Who tells nothing, since the line that lives knows it all by the record."""

    def tell(self, row: Row) -> None:
        """Take notice."""


@contextmanager
def progress(run_log: RunLog) -> Iterator[ProgressReporter]:
    """Tell of a run, by one living line on a terminal, else by a line per change."""
    with living(lambda: describe_latest(run_log)) as lines:
        yield NullReporter() if lines is None else ChangeLogger(lines, run_log)


def describe_latest(run_log: RunLog) -> str:
    """Say in one line how things stand."""
    return (
        describe_progress(run_log, run_log.rows[-1])
        if run_log.rows
        else "waiting for a scan"
    )


def describe_progress(run_log: RunLog, row: Row) -> str:
    """Say in one line how things stand."""
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


class ChangeLogger:
    """A line for every change of what the robot is at."""

    def __init__(self, lines: Lines, run_log: RunLog) -> None:
        self._lines = lines
        self._run_log = run_log
        self._before: tuple[Activity, Point | None] | None = None

    def tell(self, row: Row) -> None:
        """Print a line if something has changed."""
        describe_latest = (row.activity, row.goal)
        if describe_latest == self._before:
            return
        line = f"{self._run_log.time:8.1f} s  {self._change(row)}"
        self._before = describe_latest
        self._lines.add(line)

    def _change(self, row: Row) -> str:
        activity, goal = self._before or (None, None)
        along = activity in AT_BOUNDARY and goal == row.goal
        here = f"{row.x:.2f} {row.y:.2f}"
        if row.activity is Activity.GOING and row.goal is not None:
            x, y = row.goal
            left = (
                f"leave point {len(self._run_log.leave_points)} at {here}, "
                if along
                else ""
            )
            return f"{left}going to {x:.2f} {y:.2f}, {row.goal_distance:.2f} m away"
        if row.activity in AT_BOUNDARY and not along:
            number = len(self._run_log.hit_points)
            return f"hit point {number} at {here}, {row.activity.value}"
        return row.activity.value.replace("_", " ")
