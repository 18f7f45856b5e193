"""``radarsim trials``: let robots navigate on maps, and score their runs."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import closing
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, TypeAlias

import click
from annotated_types import Ge
from rich.console import Console
from rich.table import Table
from rich.text import Text

from radarsim.autonomy.plans import Algorithm, Rule
from radarsim.cli.fields import Json
from radarsim.cli.output import print_lines
from radarsim.cli.progress import with_bar
from radarsim.errors import MapError, PresetError, escape_unprintable, expected_one_of
from radarsim.plans import RARE, Form, Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.trials import TrialResult


def _read_names(text: str) -> tuple[str, ...]:
    """Read names separated by commas, without duplicates."""
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise ValueError(f"{text!r}, expected names separated by commas")
    return tuple(dict.fromkeys(names))


Names: TypeAlias = Annotated[tuple[str, ...], Form("NAME,...", _read_names)]


def trials(
    maps: Annotated[
        tuple[str, ...], Option(is_argument=True, metavar="MAP", words="maps")
    ] = (),
    *,
    algorithms: Names = ("bug1", "bug2"),
    sensors: Names = ("radar",),
    seeds: Annotated[int, Ge(1), Option(metavar="K")] = 3,
    as_json: Json = False,
    rules: Annotated[Names, RARE] = ("share",),
    workers: Annotated[int | None, Ge(1), RARE] = None,
) -> None:
    """Run navigation algorithms on several maps, and score them.

    The scores are computed from true poses.

    Args:
        maps: Maps that have a trial; by default the shipped maps made for trials.
        algorithms: Algorithms to compare.
        sensors: Sensor presets to compare; each must cover a full circle.
        seeds: Repeat each trial with seeds 0 to K - 1.
        as_json: Print JSON instead of text.
        rules: Bumper rules to compare; see --rule of 'radarsim navigate'.
        workers: Number of processes; by default one per core.
    """
    from radarsim.autonomy.evaluation.task_runner import in_order, run_tasks
    from radarsim.autonomy.evaluation.trials import MAPS, run_trial

    names = maps or MAPS
    _check(names, algorithms, sensors, rules)
    todo = [
        (map_, algorithm, sensor, seed, rule)
        for map_, algorithm, rule, sensor, seed in product(
            names, algorithms, rules, sensors, range(seeds)
        )
    ]
    processes = min(workers or process_cpu_count(), len(todo))
    began = time.perf_counter()
    running = run_tasks(run_trial, todo, workers=processes)
    with raise_on_signals(), closing(running):
        scores = in_order(with_bar(running, "trials", len(todo)))
    duration = time.perf_counter() - began
    if as_json:
        click.echo(json.dumps([score.to_dict() for score in scores], allow_nan=False))
        return
    Console().print(_table(scores))
    click.echo(
        "means of the true path and its ratio to the shortest; touches are totals"
    )
    for score in scores:
        if not score.is_correct:
            print_lines([_failure_text(score)])
    by = "1 process" if processes == 1 else f"{processes} processes"
    trials_in = "1 trial" if len(scores) == 1 else f"{len(scores)} trials"
    click.echo(f"{trials_in} in {duration:.1f} s by {by}")


def _check(
    maps: Sequence[str],
    algorithms: Sequence[str],
    sensors: Sequence[str] = (),
    rules: Sequence[str] = (),
) -> None:
    from radarsim.autonomy.evaluation.trials import MAPS, config_with_sensor, load_trial

    for name in maps:
        try:
            load_trial(name)
        except MapError as error:
            if name in MAPS or Path(name).exists():
                raise
            text = f"{error}; maps made for trials are {list(MAPS)}"
            raise MapError([text]) from None
    for hint, names, enum in (
        ("--algorithms", algorithms, Algorithm),
        ("--rules", rules, Rule),
    ):
        known = [each.value for each in enum]
        for name in names:
            if name not in known:
                text = expected_one_of(name, known)
                raise click.BadParameter(text, param_hint=hint)
    for name in sensors:
        try:
            config_with_sensor(name)
        except PresetError as error:
            raise click.BadParameter(str(error), param_hint="--sensors") from None


def _table(scores: Sequence[TrialResult]) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for column in ("map", "algorithm", "rule", "sensor"):
        table.add_column(column, no_wrap=True)
    for column in ("success", "path m", "ratio", "touches", "time s", "circuits"):
        table.add_column(column, justify="right")
    groups: dict[tuple[str, str, str, str], list[TrialResult]] = {}
    for score in scores:
        key = (score.map, score.algorithm, score.rule, score.sensor)
        groups.setdefault(key, []).append(score)
    for key, group in groups.items():
        # Each row of the table shows sums and means over trials with different seeds.
        path, shortest = fmean(s.path_length for s in group), group[0].shortest_path
        ratio = "no path"
        if shortest is not None:
            ratio = f"{path / shortest:.2f}" if path else "-"
        table.add_row(
            *(Text(escape_unprintable(name)) for name in key),
            f"{sum(s.is_correct for s in group)}/{len(group)}",
            f"{path:.2f}",
            ratio,
            f"{sum(s.collisions for s in group)}",
            f"{fmean(s.time for s in group):.1f}",
            f"{fmean(s.circuits for s in group):.1f}",
        )
    return table


def _failure_text(score: TrialResult) -> str:
    collisions = f"collisions: {score.collisions}" if score.collisions else ""
    reasons = "; ".join(filter(None, (score.outcome, score.note, collisions)))
    by = f"{score.algorithm} {score.rule}"
    trial = f"{score.map} {by} {score.sensor} seed {score.seed}"
    return f"{trial}: {reasons}"
