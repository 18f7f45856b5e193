"""What ``radarsim trials --random`` does: trials on random maps, line by line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.table import Table

from radarsim.cli.options import check_writable
from radarsim.cli.output import print_lines
from radarsim.signal_handlers import raise_on_signals

if TYPE_CHECKING:
    from radarsim.evaluation.random_trials import RandomTrialResult


def run_random(
    count: int, algorithms: Sequence[str], output: Path | None, workers: int
) -> None:
    """Run the trials that are left, write a line for each, and print a summary.

    Args:
        count: Number of maps.
        algorithms: Algorithms, each of which runs on each map.
        output: File of the lines; those that it holds already are not run again.
        workers: Number of processes.
    """
    from radarsim.cli.compile_progress import compile_now
    from radarsim.evaluation.random_trials import (
        all_random_trials,
        run_random_trials,
    )

    earlier = _read(output)
    todo = all_random_trials(count, algorithms, earlier)
    wanted = {
        (each.number, each.algorithm) for each in all_random_trials(count, algorithms)
    }
    results = [
        each for each in earlier if (each["number"], each["algorithm"]) in wanted
    ]
    if todo:
        compile_now()
        with (
            raise_on_signals(),
            closing(
                run_random_trials(todo, workers=min(workers, len(todo)))
            ) as running,
        ):
            results += _written(running, output, len(todo))
    results.sort(key=lambda each: (each["number"], algorithms.index(each["algorithm"])))
    Console().print(_table(results))
    for each in results:
        if not each["correct"]:
            print_lines([_failure_text(each)])


def _read(output: Path | None) -> list[dict[str, Any]]:
    from radarsim.evaluation.random_trials import read_results

    if output is None:
        return []
    check_writable(output, "--output")
    try:
        return read_results(output)
    except (OSError, ValueError) as error:
        raise typer.BadParameter(str(error), param_hint="--output") from None


def _written(
    running: Iterator[RandomTrialResult], output: Path | None, total: int
) -> Iterator[dict[str, Any]]:
    """Write each result as soon as there is one, in one piece."""
    from radarsim.cli.progress import with_bar
    from radarsim.evaluation.result_log import opened_log

    with opened_log(output) as add:
        for result in with_bar(running, "trials", total):
            values = result.to_dict()
            add(values)
            yield values


def _table(results: Sequence[dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("family", no_wrap=True)
    for column in ("correct", "false no path", "touches", "failed"):
        table.add_column(column, justify="right")
    families = dict.fromkeys(each["family"] for each in results)
    for family in families:
        _add_row(table, family, [each for each in results if each["family"] == family])
    if len(families) > 1:
        _add_row(table, "all", results)
    return table


def _add_row(table: Table, name: str, group: Sequence[dict[str, Any]]) -> None:
    counts = Counter[str]()
    for each in group:
        counts["correct"] += each["correct"]
        counts["false"] += (each["outcome"], each["expected"]) == ("no_path", "reached")
        counts["touches"] += each["collisions"]
        counts["failed"] += each["outcome"] == "failed"
    numbers = (str(counts[key]) for key in ("false", "touches", "failed"))
    table.add_row(name, f"{counts['correct']}/{len(group)}", *numbers)


def _failure_text(result: dict[str, Any]) -> str:
    collisions = f"collisions: {result['collisions']}" if result["collisions"] else ""
    told = f"{result['outcome']}, expected {result['expected']}"
    reasons = "; ".join(filter(None, (told, result["note"], collisions)))
    name = f"map {result['number']} ({result['family']}) {result['algorithm']}"
    sensor = f"{result['sensor']} N = {result['side_offset']}"
    return f"{name} {sensor}: {reasons}"
