"""What a person is told on stderr while a robot finds its way."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from radarsim.cli.living import Lines, living
from radarsim.navigation.bug import Doing, Point
from radarsim.navigation.record import AT_BOUNDARY, Record, Row


class Teller(Protocol):
    """Tells of a run as it goes on."""

    def tell(self, row: Row) -> None:
        """Take notice of the moment that the record has got last."""


class Nobody:
    """Who tells nothing, since the line that lives knows it all by the record."""

    def tell(self, row: Row) -> None:
        """Take notice."""


@contextmanager
def progress(record: Record) -> Iterator[Teller]:
    """Tell of a run, by one living line on a terminal, else by a line per change."""
    with living(lambda: now(record)) as lines:
        yield Nobody() if lines is None else Changes(lines, record)


def now(record: Record) -> str:
    """Say in one line how things stand."""
    return present(record, record.rows[-1]) if record.rows else "waiting for a scan"


def present(record: Record, row: Row) -> str:
    """Say in one line how things stand."""
    nearest = f"{row.nearest:5.2f} m" if math.isfinite(row.nearest) else "   none"
    return "  ".join(
        (
            f"{row.doing.value:9}",
            f"goal {row.goal_distance:6.2f} m",
            f"{record.time:7.1f} s",
            f"path {record.length:6.2f} m",
            f"nearest {nearest}",
            row.pressed,
        )
    ).rstrip()


class Changes:
    """A line for every change of what the robot is at."""

    def __init__(self, lines: Lines, record: Record) -> None:
        self._lines = lines
        self._record = record
        self._before: tuple[Doing, Point | None] | None = None

    def tell(self, row: Row) -> None:
        """Print a line if something has changed."""
        now = (row.doing, row.goal)
        if now == self._before:
            return
        line = f"{self._record.time:8.1f} s  {self._change(row)}"
        self._before = now
        self._lines.add(line)

    def _change(self, row: Row) -> str:
        doing, goal = self._before or (None, None)
        along = doing in AT_BOUNDARY and goal == row.goal
        here = f"{row.x:.2f} {row.y:.2f}"
        if row.doing is Doing.GOING and row.goal is not None:
            x, y = row.goal
            left = (
                f"leave point {len(self._record.leaves)} at {here}, " if along else ""
            )
            return f"{left}going to {x:.2f} {y:.2f}, {row.goal_distance:.2f} m away"
        if row.doing in AT_BOUNDARY and not along:
            return f"hit point {len(self._record.hits)} at {here}, {row.doing.value}"
        return row.doing.value.replace("_", " ")
