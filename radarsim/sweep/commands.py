"""``radarsim sweep``: scans, trials or maps for all combinations of parameters."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import click
from annotated_types import Ge

from radarsim import __version__
from radarsim.cli.compile_progress import compile_now, with_bar, with_compile_progress
from radarsim.cli.output import print_lines, print_message
from radarsim.plans import RARE, Option
from radarsim.processes import process_cpu_count, raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.task_runner import TaskResult
    from radarsim.scene.scene import Scene
    from radarsim.sweep.file import SweepFile
    from radarsim.sweep.folder import SweepFolder, SweepTask

    Running = Generator[TaskResult[list[dict[str, Any]]], None, None]

_BATCHES: Final = {"scan": 16, "trial": 1, "map": 1}  # tasks that a worker gets at once
# Of a cluster's worker: each message takes its scheduler some 10 ms.
_MESSAGES: Final = 4


@with_compile_progress
def sweep(
    file: Annotated[str, Option(is_argument=True, metavar="FILE")],
    *,
    output: Annotated[Path, Option(names=("-o", "--output"), metavar="OUT")],
    resume: bool = False,
    dry_run: bool = False,
    workers: Annotated[int | None, Ge(1), RARE] = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS", is_rare=True)] = None,
) -> int:
    """Scan, drive or map for all combinations of values.

    Writes one table of the results, and the figure that the file asks for.

    Args:
        file: A sweep file, or a shipped sweep.
        output: A folder for the results.
        resume: Go on with a sweep that was stopped.
        dry_run: Check the file, and count its tasks.
        workers: Number of processes; one for each core by default.
        scheduler: Scheduler of a dask cluster that runs already.
    """
    from radarsim.errors import import_optional
    from radarsim.presets.sensors import has_fmcw
    from radarsim.sweep.file import read_sweep
    from radarsim.sweep.folder import (
        ABOUT,
        EXTRA,
        FIGURE,
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
    # Before anything runs: without it, hours of work would end in no table.
    import_optional("pyarrow", EXTRA)
    folder.open(path, wanted, tasks, resume=resume)
    for number in folder.damaged:
        print_message(f"{output / LOG}:{number}: damaged, its task is run again")
    left = [task for task in tasks if not folder.has(task)]
    began = time.perf_counter()
    if left:
        has_radar = any(has_fmcw(name) for name in wanted.sensor["name"])
        parts = {"mapping": wanted.kind == "map", "fmcw": has_radar}
        compile_now(*(part for part, is_needed in parts.items() if is_needed))
        batch = _BATCHES[wanted.kind]
        with _running(left, scenes, scheduler, workers, batch) as running:
            _collect(folder, left, running)
    folder.write(path, wanted, tasks)
    failed, why = folder.first_failure(tasks)
    if failed:
        print_message(f"{failed} of {len(tasks)} tasks failed, the first: {why}")
    spent = f"{_count(wanted, len(left))} in {time.perf_counter() - began:.1f} s"
    print_lines([spent, output / TABLE, output / ABOUT])
    if wanted.figure is not None:
        print_lines([output / FIGURE])
    return int(failed > 0)


def _count(wanted: SweepFile, tasks: int) -> str:
    text = "1 task" if tasks == 1 else f"{tasks} tasks"
    if wanted.kind != "scan":
        return text
    scans = tasks * wanted.count
    return f"{text}, {scans} scan" + "s" * (scans != 1)


@contextmanager
def _running(
    tasks: list[SweepTask],
    scenes: dict[str, Scene],
    scheduler: str | None,
    workers: int | None,
    batch: int,
) -> Iterator[Running]:
    """Run tasks in processes of this machine, or on a cluster."""
    from radarsim.autonomy.evaluation.task_runner import run_tasks, run_tasks_in
    from radarsim.sweep.tasks import (
        connect_cluster,
        prepare_worker,
        run_sweep_task,
    )

    todo = [task.parameters for task in tasks]
    with raise_on_signals():
        if scheduler is not None:
            with connect_cluster(scheduler, scenes, print_message) as cluster:
                threads = cluster.wait_for_workers()
                batch = max(batch, len(todo) // (_MESSAGES * threads))
                with closing(
                    run_tasks_in(
                        cluster.executor,
                        run_sweep_task,
                        todo,
                        workers=threads,
                        batch=batch,
                        check_workers=cluster.count_threads,
                    )
                ) as running:
                    yield running
            return
        # A worker takes seconds to start; more of them than batches would get nothing.
        count = min(workers or process_cpu_count(), -(-len(todo) // batch))
        with closing(
            run_tasks(
                run_sweep_task,
                todo,
                workers=count,
                batch=batch,
                prepare=prepare_worker,
                settings=(__version__, scenes),
            )
        ) as running:
            yield running


def _collect(folder: SweepFolder, tasks: list[SweepTask], running: Running) -> None:
    """Log each result as soon as there is one; an interrupt keeps what is there."""
    from radarsim.autonomy.evaluation.task_runner import as_line, opened_log
    from radarsim.sweep.folder import LOG, with_checksum

    done = 0
    try:
        with opened_log(folder.path / LOG) as add:
            for result in with_bar(running, "tasks", len(tasks)):
                task = tasks[result.number]
                value: dict[str, Any] = {"rows": result.value}
                if result.value is None:
                    value = {"error": result.error}
                line = with_checksum(
                    {"version": __version__, "task": task.key, **value}
                )
                # To the file first: a kill between the two loses nothing that memory
                # has.
                add(line)
                folder.lines[task.key] = as_line(line)
                done += 1
    except (KeyboardInterrupt, SystemExit):
        print_message(f"{done} of {len(tasks)} tasks done; go on with --resume")
        raise
