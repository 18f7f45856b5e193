"""``radarsim trials``: score navigation on maps.

With ``--random`` they run on random maps, with ``--barn`` on worlds of the BARN
benchmark, and each trial is written as a line of JSON.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from statistics import fmean, median
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

import click
from annotated_types import Ge
from rich.console import Console
from rich.table import Table
from rich.text import Text

from radarsim.autonomy.navigation.algorithms import Algorithm, Rule
from radarsim.cli.compile_progress import compile_now, with_bar, with_compile_progress
from radarsim.cli.fields import Json, OutputFile
from radarsim.cli.files import check_writable
from radarsim.cli.output import print_lines
from radarsim.errors import MapError, PresetError, escape_unprintable, expected_one_of
from radarsim.plans import RARE, Form, Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.trials import TrialResult, TrialSpec


Spec = TypeVar("Spec")


def run_random(
    count: int,
    algorithms: Sequence[str],
    output: Path | None,
    workers: int,
) -> None:
    """Run the trials that are left, write a line for each, and print a summary.

    Args:
        count: Number of maps.
        algorithms: Algorithms, each of which runs on each map.
        output: File of the lines; those that it holds already are not run again.
        workers: Number of processes.
    """
    from radarsim.autonomy.evaluation.random_trials import (
        all_random_trials,
        read_results,
        run_random_trial,
    )
    from radarsim.autonomy.evaluation.task_runner import split_tasks

    specs = all_random_trials(count, algorithms)
    earlier = _read_earlier(output, read_results)
    todo, results = split_tasks(specs, earlier, ("number", "algorithm"))
    results += _run_logged(run_random_trial, todo, output, workers)
    results.sort(key=lambda each: (each["number"], algorithms.index(each["algorithm"])))
    Console().print(_random_table(results))
    for each in results:
        if not each["correct"]:
            print_lines([_random_failure(each)])


def run_barn(
    folder: Path,
    algorithms: Sequence[str],
    sensors: Sequence[str],
    output: Path | None,
    workers: int,
) -> None:
    """Run trials on the worlds of a folder as ``run_random`` does.

    Args:
        folder: The folder.
        algorithms: Algorithms, each of which runs on each world.
        sensors: Sensors, likewise.
        output: File of the lines; those that it holds already are not run again.
        workers: Number of processes.
    """
    from radarsim.autonomy.evaluation.barn_trials import (
        all_barn_trials,
        read_barn_results,
        run_barn_trial,
    )
    from radarsim.autonomy.evaluation.task_runner import split_tasks

    earlier = _read_earlier(output, read_barn_results)
    specs = all_barn_trials(folder, algorithms, sensors)
    todo, results = split_tasks(specs, earlier, ("number", "algorithm", "sensor"))
    # Before any trial, so that a wrong file is not found after minutes.
    for spec in {spec.number: spec for spec in todo}.values():
        spec.read()
    results += _run_logged(run_barn_trial, todo, output, workers)
    results.sort(key=lambda each: (each["algorithm"], each["sensor"], each["number"]))
    Console().print(_barn_table(results))
    for each in results:
        if not each["success"]:
            touches = f"touches: {each['collisions']}" if each["collisions"] else ""
            reasons = "; ".join(filter(None, (each["outcome"], each["note"], touches)))
            by = f"{each['algorithm']} {each['sensor']}"
            print_lines([f"world {each['number']} {by}: {reasons}"])


def _read_earlier(
    output: Path | None, read: Callable[[Path], list[dict[str, Any]]]
) -> list[dict[str, Any]]:
    if output is None:
        return []
    check_writable(output, "--output")
    try:
        return read(output)
    except (OSError, ValueError) as error:
        raise click.BadParameter(str(error), param_hint="--output") from None


def _run_logged(
    function: Callable[[Spec], Any],
    todo: Sequence[Spec],
    output: Path | None,
    workers: int,
) -> list[dict[str, Any]]:
    """Run trials, add a line for each to a file, and return what the lines hold."""
    from radarsim.autonomy.evaluation.task_runner import opened_log, run_tasks

    if not todo:
        return []
    # Once, instead of in each process.
    compile_now()
    results = []
    running = run_tasks(function, todo, workers=min(workers, len(todo)))
    with raise_on_signals(), closing(running), opened_log(output) as add:
        for result in with_bar(running, "trials", len(todo)):
            results.append(result.unwrap().to_dict())
            add(results[-1])
    return results


def _barn_table(results: Sequence[dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("algorithm", no_wrap=True)
    table.add_column("sensor", no_wrap=True)
    for column in ("success", "reached", "touches", "ratio", "score"):
        table.add_column(column, justify="right")
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for each in results:
        groups.setdefault((each["algorithm"], each["sensor"]), []).append(each)
    for key, group in groups.items():
        reached = [each for each in group if each["outcome"] == "reached"]
        ratios = [
            each["path_length"] / each["shortest_path"]
            for each in reached
            if each["shortest_path"] is not None
        ]
        table.add_row(
            *(Text(escape_unprintable(name)) for name in key),
            f"{sum(each['success'] for each in group)}/{len(group)}",
            f"{len(reached)}/{len(group)}",
            str(sum(each["collisions"] for each in group)),
            f"{median(ratios):.2f}" if ratios else "-",
            f"{fmean(each['barn_score'] for each in group):.3f}",
        )
    return table


def _random_table(results: Sequence[dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("family", no_wrap=True)
    for column in ("correct", "false no path", "touches", "failed"):
        table.add_column(column, justify="right")
    groups: dict[str, list[dict[str, Any]]] = {}
    for each in results:
        groups.setdefault(each["family"], []).append(each)
    if len(groups) > 1:
        groups["all"] = list(results)
    for name, group in groups.items():
        endings = Counter((each["outcome"], each["expected"]) for each in group)
        table.add_row(
            name,
            f"{sum(each['correct'] for each in group)}/{len(group)}",
            str(endings["no_path", "reached"]),
            str(sum(each["collisions"] for each in group)),
            str(sum(each["outcome"] == "failed" for each in group)),
        )
    return table


def _random_failure(result: dict[str, Any]) -> str:
    collisions = f"collisions: {result['collisions']}" if result["collisions"] else ""
    told = f"{result['outcome']}, expected {result['expected']}"
    reasons = "; ".join(filter(None, (told, result["note"], collisions)))
    name = f"map {result['number']} ({result['family']}) {result['algorithm']}"
    sensor = f"{result['sensor']} N = {result['side_offset']}"
    return f"{name} {sensor}: {reasons}"


def _read_names(text: str) -> tuple[str, ...]:
    """Read names with commas between them; each counts once."""
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise ValueError(f"{text!r}, expected names")
    return tuple(dict.fromkeys(names))


Names: TypeAlias = Annotated[tuple[str, ...], Form("NAME,...", _read_names)]


@with_compile_progress
def trials(
    maps: Annotated[
        tuple[str, ...], Option(is_argument=True, metavar="MAP", words="maps")
    ] = (),
    *,
    algorithms: Names = ("bug1", "bug2"),
    sensors: Names | None = None,
    seeds: Annotated[int, Ge(1), Option(metavar="K")] = 3,
    random: Annotated[int | None, Ge(1)] = None,
    barn: Annotated[Path | None, Option(metavar="FOLDER")] = None,
    output: OutputFile = None,
    as_json: Json = False,
    rules: Annotated[Names, RARE] = ("share",),
    workers: Annotated[int | None, Ge(1), RARE] = None,
) -> None:
    """Run navigators on several maps, and score them.

    They are scored by the ground truth.

    Args:
        maps: Maps that have a trial; by default all that are made for trials.
        algorithms: Algorithms to compare.
        sensors: Sensor presets, which see all the way round; by default radar, and
            laser with --barn.
        seeds: Repeat each trial with seeds 0 to K - 1.
        random: Run on random maps 0 to N - 1 instead: radar and laser alternate.
        barn: Run on worlds of the BARN benchmark instead: world_N.world and
            path_N.npy.
        output: With --random and --barn: add a line of JSON for each trial; those that
            are in the file are not run again.
        as_json: Print JSON, for programs.
        rules: Rules of the bumpers to compare.
        workers: Number of processes; one for each core by default.
    """
    from radarsim.autonomy.evaluation.trials import MAPS, all_trials

    workers = workers or process_cpu_count()
    if random is not None or barn is not None:
        mode = "--random" if random is not None else "--barn"
        refused = {
            "--rules": rules != (Rule.SHARE,),
            "MAP": bool(maps),
            "--barn": None not in (random, barn),
            "--sensors": random is not None and sensors is not None,
        }
        for hint, is_given in refused.items():
            if is_given:
                raise click.BadParameter(f"not with {mode}", param_hint=hint)
        if as_json:
            text = f"not with {mode}, whose --output is JSON"
            raise click.BadParameter(text, param_hint="--json")
        _check((), algorithms, sensors or ())
        if random is not None:
            run_random(random, algorithms, output, workers)
        elif barn is not None:
            run_barn(barn, algorithms, sensors or ("laser",), output, workers)
        return
    if output is not None:
        text = "expected with --random or --barn"
        raise click.BadParameter(text, param_hint="--output")
    sensors = sensors or ("radar",)
    names = maps or MAPS
    _check(names, algorithms, sensors, rules)
    todo = all_trials(names, algorithms, sensors, seeds, rules)
    _run(todo, min(workers, len(todo)), as_json=as_json)


def _run(todo: Sequence[TrialSpec], processes: int, *, as_json: bool) -> None:
    from radarsim.autonomy.evaluation.trials import run_trials

    # before the clock runs, and once instead of in each process
    compile_now()
    began = time.perf_counter()
    with raise_on_signals(), closing(run_trials(todo, workers=processes)) as running:
        scores = list(with_bar(running, "trials", len(todo)))
    duration = time.perf_counter() - began
    if as_json:
        click.echo(json.dumps([score.to_dict() for score in scores], allow_nan=False))
        return
    Console().print(_table(scores))
    click.echo(
        "path in truth, ratio to the shortest; means, but touches are all that were"
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
            text = f"{error}; those made for trials are {list(MAPS)}"
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
        # sums and means over the seeds
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
