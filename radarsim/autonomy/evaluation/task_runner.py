"""Run many independent tasks in several processes; one that fails ends no other."""

import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeAlias, TypeVar

import joblib
from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor

from radarsim.errors import RadarsimError
from radarsim.processes import start_worker, starting_workers

LOST: Final = "its process was killed or crashed, expected a result"

Value = TypeVar("Value")
# Number of a task, what the function returned, and why it failed, empty if it did not.
TaskResult: TypeAlias = tuple[int, Value | None, str]


def run_tasks(
    function: Callable[..., Value],
    tasks: Sequence[tuple[Any, ...]],
    *,
    workers: int,
    prepare: Callable[[], object] = int,
) -> Generator[TaskResult[Value], None, None]:
    """Run tasks, and yield each result as soon as there is one.

    Closing the generator early ends the tasks that still run. A task whose process
    crashes fails, and no other with it.

    Args:
        function: The function.
        tasks: Its arguments in each task.
        workers: Number of processes; with one, all tasks run in this process.
        prepare: Called in each process before its first task; can be pickled.
    """
    if workers == 1:
        prepare()
        yield from (run_task(function, *each) for each in enumerate(tasks))
        return
    groups = [dict(enumerate(tasks))]
    suspects: set[int] = set()
    while groups:
        left = groups.pop()
        begun: list[int] = []
        try:
            # What broke would keep tasks that it had not sent, and start processes that
            # are not prepared.
            with _processes(workers, prepare) as parallel:
                for result in _run_together(parallel, function, left, begun):
                    del left[result[0]]
                    yield result
        except BrokenProcessPool:
            if suspects.issuperset(left):  # it ran alone
                yield from ((number, None, LOST) for number in left)
                continue
            # Nobody knows whose process crashed: what had begun runs again, each alone.
            suspects.update(left.keys() & begun)
            groups.append({key: left[key] for key in left if key not in suspects})
            groups.extend({key: left[key]} for key in left if key in suspects)


def _run_together(
    parallel: Parallel,
    function: Callable[..., Value],
    tasks: dict[int, tuple[Any, ...]],
    begun: list[int],
) -> Iterator[TaskResult[Value]]:
    """Run tasks until a process crashes; ``begun`` gets the numbers of those begun."""

    def calls() -> Iterator[Any]:
        for number, arguments in [*tasks.items()]:
            begun.append(number)
            yield delayed(run_task)(function, number, arguments)

    with starting_workers():
        results = parallel(calls())
        # A thread of joblib fails if it ends before it has sent the tasks.
        time.sleep(0.1)
    yield from results


@contextmanager
def _processes(workers: int, prepare: Callable[[], object]) -> Iterator[Parallel]:
    """Open processes, which start with the first tasks."""
    # joblib warns of runs that are ended early, and of workers that it starts again as
    # they use much memory.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"joblib\.")
    with TemporaryDirectory(prefix="radarsim-") as folder:
        # Not through a pipe: each worker would start when the one before has read it.
        file = Path(folder) / "prepare.joblib"
        joblib.dump(prepare, file)
        try:
            with Parallel(
                workers,
                return_as="generator_unordered",
                max_nbytes=None,
                initializer=start_worker,
                initargs=(os.getpid(), partial(_prepare, file)),
            ) as parallel:
                yield parallel
        finally:  # else the processes would stay, or start when the file has gone
            get_reusable_executor(kill_workers=True).shutdown()


def _prepare(file: Path) -> None:
    joblib.load(file)()


def run_task(
    function: Callable[..., Value], number: int, arguments: tuple[Any, ...]
) -> TaskResult[Value]:
    """Run a task."""
    try:
        return number, function(*arguments), ""
    except RadarsimError as error:
        return number, None, str(error)
    except Exception as error:  # noqa: BLE001 - one task that fails ends no other
        return number, None, f"{type(error).__name__}: {error}"


def in_order(results: Iterable[TaskResult[Value]]) -> list[Value]:
    """Return the values of tasks in the order of the tasks.

    Raises:
        RadarsimError: If a task has failed.
    """
    values: dict[int, Any] = {}
    for number, value, error in results:
        if error:
            raise RadarsimError(error)
        values[number] = value
    return [values[number] for number in sorted(values)]
