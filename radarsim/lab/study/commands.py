"""``radarsim study``: compare radar and lasers on the same tasks."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click
from annotated_types import Ge

from radarsim import __version__
from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.cli.compile_progress import compile_now, with_bar, with_compile_progress
from radarsim.cli.output import print_lines, print_message
from radarsim.errors import describe_os_error
from radarsim.plans import RARE, Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.lab.study.maps import StudyTask


@with_compile_progress
def study(
    name: Annotated[Literal["radar-vs-laser"], Option(is_argument=True)],
    *,
    output: Annotated[Path, Option(names=("-o", "--output"), metavar="OUT")],
    seeds: Annotated[int | None, Ge(1), Option(metavar="K")] = None,
    quick: bool = False,
    algorithm: Annotated[Algorithm, RARE] = Algorithm.PLANNED,
    workers: Annotated[int | None, Ge(1), RARE] = None,
) -> int:
    """Compare radar and lasers on the same maps.

    They drive and map there; OUT gets index.html with a figure, and runs.csv with a
    row for each run.

    Args:
        name: The study: radar-vs-laser.
        output: A folder; runs that are in it are not run again.
        seeds: Maps of each kind, from seeds 0 to K - 1; by default 10, or 1 with
            --quick.
        quick: Only smoke, as a test.
        algorithm: Algorithm that drives to the goals.
        workers: Number of processes; one for each core by default.
    """
    from radarsim.lab.study.maps import KINDS, QUICK, study_tasks
    from radarsim.lab.study.page import PAGE, read_runs, write_study

    assert name == "radar-vs-laser"  # there is no other yet
    seeds = seeds or (1 if quick else 10)
    tasks = study_tasks(seeds, algorithm, QUICK if quick else KINDS)
    try:
        output.mkdir(parents=True, exist_ok=True)
        runs = read_runs(output)
    except OSError as error:
        text = f"cannot use {output}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="--output") from None
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--output") from None
    left = [task for task in tasks if task not in runs]
    if left:
        runs |= _run(output, left, workers or process_cpu_count())
    if missing := [task for task in tasks if task not in runs]:
        print_message(
            f"{len(missing)} of {len(tasks)} runs failed, so there is no page"
        )
        return 1
    rows = [runs[task] for task in tasks]
    print_lines(write_study(output, rows, algorithm=algorithm, seeds=seeds))
    print_lines([output / PAGE])
    return 0


def _run(
    out: Path, tasks: list[StudyTask], workers: int
) -> dict[StudyTask, dict[str, Any]]:
    """Run tasks, and write each row as soon as there is one; a signal keeps these."""
    from radarsim.autonomy.evaluation.task_runner import opened_log, run_tasks
    from radarsim.lab.study.maps import run_study_task
    from radarsim.lab.study.page import LOG

    # Before the workers start, each of which would compile the same in silence.
    compile_now("mapping")
    rows: dict[StudyTask, dict[str, Any]] = {}
    workers = min(workers, len(tasks))
    try:
        with (
            raise_on_signals(),
            opened_log(out / LOG) as add,
            closing(run_tasks(run_study_task, tasks, workers=workers)) as running,
        ):
            for result in with_bar(running, "runs", len(tasks)):
                task = tasks[result.number]
                if result.value is None:
                    text = f"{task.map} {task.sensor} seed {task.seed}: {result.error}"
                    print_message(text)
                else:
                    add({"version": __version__, **result.value})
                    rows[task] = result.value
    except (KeyboardInterrupt, SystemExit):
        done = f"{len(rows)} of {len(tasks)} runs done"
        print_message(f"{done}; go on with the same command")
        raise
    return rows
