"""The reports of a tick, not rounded; the simulation has only their numbers."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import LineReport, SensorReport
from radarsim.protocol.reports import Status
from radarsim.simulation.tick_output import TickOutput


def status_of(output: TickOutput) -> Status | None:
    """Return the status; None when it is not due."""
    return next((r for r in _group_of(output) if isinstance(r, Status)), None)


def readings_of(output: TickOutput) -> list[LineReport]:
    """Return the readings of all items but scanners, poses first."""
    group = [report for report in _group_of(output) if not isinstance(report, Status)]
    return [*group, *output.cast]


def _group_of(output: TickOutput) -> list[LineReport]:
    numbers = iter(output.numbers)
    reports = [
        _filled(sample, numbers, output.group.dialect)
        for sample in output.group.samples
    ]
    assert not list(numbers)
    return reports


def _filled(
    sample: LineReport, numbers: Iterator[float], dialect: Dialect
) -> LineReport:
    """Return a report with the numbers that follow."""
    sources = sample.sources(dialect)
    changes: dict[str, Any] = {}
    if isinstance(sample, SensorReport) and "time" not in sources:
        changes["time"] = math.nan
    for name in sources:
        match getattr(sample, name):
            case bool():
                changes[name] = next(numbers) != 0
            case int():
                changes[name] = int(next(numbers))
            case float():
                changes[name] = next(numbers)
            case Pose2():
                changes[name] = Pose2(*islice(numbers, 3))
            case Pose3():
                changes[name] = Pose3(*islice(numbers, 6))
            case ((str(), _), *_) as ticks:
                changes[name] = tuple((key, int(next(numbers))) for key, _ in ticks)
            case values:
                changes[name] = tuple(islice(numbers, len(values)))
    made: LineReport = replace(sample, **changes)  # type: ignore[type-var]
    return made
