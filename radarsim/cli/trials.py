"""``radarsim trials``."""

import json
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import fmean

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn
from rich.table import Table

from radarsim.errors import MapError, PresetError
from radarsim.evaluation.trials import (
    MAPS,
    Score,
    config_with_sensor,
    entries,
    load_trial,
    run_trials,
)
from radarsim.navigation.options import Algorithm

ALGORITHMS = tuple(algorithm.value for algorithm in Algorithm)
COLUMNS = ("success", "path m", "ratio", "touches", "time s", "circuits")


def run_and_print(
    names: tuple[str | None, str, str],
    *,
    seeds: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Run trials, with a bar on stderr, and print a table or JSON on stdout.

    Args:
        names: Of maps (None for all that are made for trials), of algorithms and of
            sensors, with commas between them.
        seeds: How many of each.
        workers: Processes; None for one on each core.
        as_json: A list of all scores instead of the table.

    Raises:
        MapError: If a map is wrong.
        typer.BadParameter: If a name is not known.
    """
    maps = MAPS if names[0] is None else _split(names[0], "--maps")
    algorithms = _split(names[1], "--algorithms")
    sensors = _split(names[2], "--sensors")
    _check(maps, algorithms, sensors)
    wanted = entries(maps, algorithms, sensors, seeds)
    count = min(workers or _cores(), len(wanted))
    begun = time.perf_counter()
    scores = list(_with_bar(run_trials(wanted, workers=count), len(wanted)))
    took = time.perf_counter() - begun
    if as_json:
        typer.echo(json.dumps([score.to_dict() for score in scores], allow_nan=False))
        return
    Console().print(_table(scores))
    typer.echo(
        "path in truth, ratio to the shortest; means, but touches are all that were"
    )
    for score in scores:
        if not score.right:
            typer.echo(_fault(score))
    by = "1 process" if count == 1 else f"{count} processes"
    typer.echo(f"{len(scores)} trials in {took:.1f} s by {by}")


def _split(text: str, hint: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        text = f"{text[:80]!r}, expected names with commas between them"
        raise typer.BadParameter(text, param_hint=hint)
    return list(dict.fromkeys(names))


def _check(
    maps: Sequence[str], algorithms: Sequence[str], sensors: Sequence[str]
) -> None:
    for name in maps:
        _check_map(name)
    for name in algorithms:
        if name not in ALGORITHMS:
            text = f"{name[:80]!r}, expected one of {list(ALGORITHMS)}"
            raise typer.BadParameter(text, param_hint="--algorithms")
    for name in sensors:
        try:
            config_with_sensor(name)
        except PresetError as error:
            raise typer.BadParameter(str(error), param_hint="--sensors") from None


def _check_map(name: str) -> None:
    """Find names of maps that are not there, or have nothing to try."""
    try:
        load_trial(name)
    except MapError as error:
        if name in MAPS or Path(name).exists():
            raise
        text = f"{error}; those made for trials are {list(MAPS)}"
        raise typer.BadParameter(text, param_hint="--maps") from None


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _with_bar(scores: Iterator[Score], total: int) -> Iterator[Score]:
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("trials", total=total)
        for score in scores:
            bar.advance(task)
            yield score


def _table(scores: Sequence[Score]) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for column in ("map", "algorithm", "sensor"):
        table.add_column(column, no_wrap=True)
    for column in COLUMNS:
        table.add_column(column, justify="right")
    groups: dict[tuple[str, str, str], list[Score]] = {}
    for score in scores:
        key = (score.map, score.algorithm, score.sensor)
        groups.setdefault(key, []).append(score)
    for key, group in groups.items():
        table.add_row(*key, *_numbers(group))
    return table


def _numbers(group: Sequence[Score]) -> Iterator[str]:
    """Give what all seeds of one kind of trial come to, column by column."""
    path, shortest = fmean(s.path_length for s in group), group[0].shortest_path
    yield f"{sum(s.right for s in group)}/{len(group)}"
    yield f"{path:.2f}"
    ratio = "-" if shortest is None or not path else f"{path / shortest:.2f}"
    yield "no path" if shortest is None else ratio
    yield f"{sum(s.collisions for s in group)}"
    yield f"{fmean(s.time for s in group):.1f}"
    yield f"{fmean(s.circuits for s in group):.1f}"


def _fault(score: Score) -> str:
    touched = f"collisions: {score.collisions}" if score.collisions else ""
    told = "; ".join(text for text in (score.outcome, score.note, touched) if text)
    who = f"{score.map} {score.algorithm} {score.sensor} seed {score.seed}"
    return f"{who}: {told}"
