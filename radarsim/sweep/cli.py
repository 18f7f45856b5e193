"""``radarsim sweep``: run scans, trials or maps for all combinations of parameters."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import click
from annotated_types import Ge

from radarsim import __version__
from radarsim.cli.output import print_lines, print_message
from radarsim.cli.progress import with_bar
from radarsim.plans import RARE, Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.task_runner import TaskResult
    from radarsim.scene.scene import Scene
    from radarsim.sweep.file import Parameters, SweepFile
    from radarsim.sweep.results import SweepFolder

_BATCHES: Final = {"scan": 16, "trial": 1, "map": 1}  # least tasks for a process


def sweep(
    file: Annotated[str, Option(is_argument=True, metavar="FILE")],
    *,
    output: Annotated[Path, Option(names=("-o", "--output"), metavar="OUT")],
    resume: bool = False,
    dry_run: bool = False,
    workers: Annotated[int | None, Ge(1), RARE] = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS", is_rare=True)] = None,
) -> int:
    """Run scans, trials or mapping for all combinations of parameter values.

    The results are written to one table.

    Args:
        file: A sweep file or the name of a shipped sweep.
        output: Folder for the results.
        resume: Continue an interrupted sweep.
        dry_run: Only check the file and count its tasks.
        workers: Number of processes; by default one per core.
        scheduler: Address of the scheduler of a running dask cluster.
    """
    from radarsim.errors import import_optional
    from radarsim.sweep.file import read_sweep
    from radarsim.sweep.results import (
        ABOUT,
        EXTRA,
        LOG,
        TABLE,
        SweepFolder,
        sweep_tasks,
    )
    from radarsim.sweep.tasks import load_scenes

    path, wanted = read_sweep(file)
    if workers is not None and scheduler is not None:
        text = "expected only one of --workers and --scheduler"
        raise click.BadParameter(text)
    scenes = load_scenes(path, wanted)
    tasks = sweep_tasks(wanted, scenes)
    folder = SweepFolder(output)
    if dry_run:
        print_lines([_count(wanted, len(tasks))])
        return 0
    # A missing package is reported before the tasks run, not when the table is written.
    import_optional("pyarrow", EXTRA)
    folder.open(path, wanted, tasks, resume=resume)
    for number in folder.damaged:
        print_message(f"{output / LOG}:{number}: damaged, the task is run again")
    done = folder.lines.keys() - folder.errors.keys()
    left = {key: tasks[key] for key in tasks if key not in done}
    began = time.perf_counter()
    if left:
        batch = _BATCHES[wanted.kind]
        running = _start([*left.values()], scenes, batch, workers, scheduler)
        with raise_on_signals(), closing(running):
            _collect(folder, [*left], running)
    folder.write(path, wanted, tasks)
    failed = [folder.errors[key] for key in tasks if key in folder.errors]
    if failed:
        text = f"{len(failed)} of {len(tasks)} tasks failed, the first: {failed[0]}"
        print_message(text)
    spent = f"{_count(wanted, len(left))} in {time.perf_counter() - began:.1f} s"
    print_lines([spent, output / TABLE, output / ABOUT])
    return int(bool(failed))


def _start(
    tasks: list[Parameters],
    scenes: dict[str, Scene],
    batch: int,
    workers: int | None,
    scheduler: str | None,
) -> Generator[TaskResult[Any], None, None]:
    """Start all tasks, in local processes or on a cluster, and return their results.

    ``batch`` is the least number of tasks for a process.
    """
    from radarsim.autonomy.evaluation.task_runner import run_on_cluster, run_tasks
    from radarsim.sweep.tasks import prepare_worker, run_sweep_task

    todo = [(task,) for task in tasks]
    prepare = partial(prepare_worker, __version__, scenes)
    if scheduler is not None:
        return run_on_cluster(
            scheduler, run_sweep_task, todo, batch, prepare, print_message
        )
    processes = min(workers or process_cpu_count(), -(-len(todo) // batch))
    return run_tasks(run_sweep_task, todo, workers=processes, prepare=prepare)


def _count(wanted: SweepFile, tasks: int) -> str:
    text = "1 task" if tasks == 1 else f"{tasks} tasks"
    if wanted.kind != "scan":
        return text
    scans = tasks * wanted.count
    return f"{text}, {scans} scan" + "s" * (scans != 1)


def _collect(
    folder: SweepFolder, keys: list[str], running: Iterator[TaskResult[Any]]
) -> None:
    """Log each result once its task has ended, so that an interrupt loses no result."""
    done = 0
    try:
        for number, rows, error in with_bar(running, "tasks", len(keys)):
            folder.add(keys[number], {"error": error} if error else {"rows": rows})
            done += 1
    except (KeyboardInterrupt, SystemExit):
        print_message(f"{done} of {len(keys)} tasks done; continue with --resume")
        raise
