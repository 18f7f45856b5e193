"""Run many independent tasks on several cores, or on a cluster.

A task is what a function gets, and it returns a result. Both have to be picklable; a
task that is plain data has a key and a random generator of its own. What a task draws
then depends on nothing but its parameters: not on the order of tasks, on the number of
processes, or on what other tasks there are.

Logs of results are files of JSON lines that are only ever added to.

A run that is killed leaves at most an incomplete last line. Readers leave it out, and
the next run cuts it off.
"""

import hashlib
import json
from collections.abc import (
    Callable,
    Collection,
    Generator,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final, Generic, TypeAlias, TypeVar

import numpy as np

from radarsim.errors import RadarsimError
from radarsim.files import write_atomically
from radarsim.processes import worker_pool
from radarsim.rng import generator_for

AHEAD: Final = 2  # batches for each worker that wait to be run
CHECK_INTERVAL: Final = 1.0  # s between two looks at whether there are workers
LOST: Final = "its process was killed or crashed, expected a result"

Result: TypeAlias = Mapping[str, Any]


def read_log(file: Path, keys: Collection[str], expected: str) -> list[dict[str, Any]]:
    """Read the results of earlier runs; there are none if the file does not exist.

    Args:
        file: The log.
        keys: Keys that each result has.
        expected: What a line is, for the message about one that is not.

    Raises:
        OSError: If the file exists and cannot be read.
        ValueError: If it has other lines; it names the first.
    """
    if not file.exists():
        return []
    results: list[dict[str, Any]] = []
    with file.open(encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(lines, 1):
            if not line.endswith("\n"):  # the run was killed while it wrote
                continue
            try:
                result = json.loads(line)
            except ValueError:
                result = None
            if not isinstance(result, dict) or not {*result} >= {*keys}:
                raise ValueError(f"{file}:{number}: expected {expected}")
            results.append(result)
    return results


@contextmanager
def opened_log(file: Path | None) -> Iterator[Callable[[Result], None]]:
    """Open a log to add results to it, each of which is on the disk at once.

    Args:
        file: The log, which is created if necessary; None for none.

    Yields:
        A function that adds a result.

    Raises:
        OSError: If the file cannot be written.
    """
    if file is not None and file.exists():
        data = file.read_bytes()
        complete = data.rfind(b"\n") + 1
        if complete < len(data):  # a line of a run that was killed
            write_atomically({file: data[:complete]})
    with nullcontext() if file is None else file.open("a", encoding="utf-8") as log:

        def add(result: Result) -> None:
            if log is not None:
                log.write(as_line(result))
                log.flush()

        yield add


def as_line(result: Result) -> str:
    """Return a result as a line of JSON."""
    return json.dumps(result, allow_nan=False) + "\n"


Task = TypeVar("Task")
Value = TypeVar("Value")
Batch = list[tuple[int, Task]]


@dataclass(frozen=True, slots=True)
class TaskResult(Generic[Value]):
    """What became of a task.

    Attributes:
        number: Index of the task.
        value: What the function returned; None if it failed.
        error: Why it failed; empty if it did not.
    """

    number: int
    value: Value | None
    error: str = ""

    def unwrap(self) -> Value:
        """Return the value.

        Raises:
            RadarsimError: If the task failed.
        """
        if self.value is None:
            raise RadarsimError(self.error)
        return self.value


def canonical_json(parameters: Mapping[str, Any]) -> str:
    """Return parameters as JSON, the same in whatever order they come."""
    return json.dumps(
        parameters, sort_keys=True, allow_nan=False, separators=(",", ":")
    )


def task_key(parameters: Mapping[str, Any]) -> str:
    """Return the key of a task, 32 hexadecimal digits."""
    return hashlib.sha256(canonical_json(parameters).encode()).hexdigest()[:32]


def task_generator(seed: int, parameters: Mapping[str, Any]) -> np.random.Generator:
    """Create the random generator of a task.

    Args:
        seed: Seed of all tasks, at least 0.
        parameters: Parameters of the task, in any order.
    """
    return generator_for(seed, "task", canonical_json(parameters))


def run_tasks(
    function: Callable[[Task], Value],
    tasks: Sequence[Task],
    *,
    workers: int,
    batch: int = 1,
    prepare: Callable[..., None] | None = None,
    settings: tuple[Any, ...] = (),
) -> Generator[TaskResult[Value], None, None]:
    """Run tasks, and yield each result as soon as there is one.

    Closing the generator early terminates the tasks that still run. A task whose
    process crashes fails, and no other with it.

    Args:
        function: A function of a module.
        tasks: The tasks.
        workers: Number of processes; with one, all tasks run in this process.
        batch: Number of tasks that a process is given at once.
        prepare: A function of a module that is called in each process before its first
            task.
        settings: Its arguments.
    """
    left = iter(_batches(tasks, batch))
    if workers == 1:
        if prepare is not None:
            prepare(*settings)
        for each in left:
            for one in each:
                yield from _run_batch(function, [one])
        return
    while True:
        suspects: list[Batch[Task]] = []
        with worker_pool(workers, prepare, *settings) as pool:
            yield from _run_batches(pool, function, left, workers * AHEAD, suspects)
        if not suspects:
            return
        for one in (one for each in suspects for one in each):
            with worker_pool(1, prepare, *settings) as pool:
                yield _run_alone(pool, function, one)


def run_tasks_in(
    executor: Executor,
    function: Callable[[Task], Value],
    tasks: Sequence[Task],
    *,
    workers: int,
    batch: int = 1,
    check_workers: Callable[[], object] = lambda: None,
) -> Generator[TaskResult[Value], None, None]:
    """Run tasks in an executor, and yield each result as soon as there is one.

    Args:
        executor: An executor of processes that have what the function needs.
        function: A function of a module.
        tasks: The tasks.
        workers: Number of its processes.
        batch: Number of tasks that a process is given at once.
        check_workers: Called again and again while results are awaited; raises if none
            can be expected any more.
    """
    suspects: list[Batch[Task]] = []
    left = iter(_batches(tasks, batch))
    yield from _run_batches(
        executor, function, left, workers * AHEAD, suspects, check_workers
    )
    for number, _ in (one for each in suspects for one in each):
        yield TaskResult(number, None, LOST)


def _run_batches(
    executor: Executor,
    function: Callable[[Task], Value],
    left: Iterator[Batch[Task]],
    at_once: int,
    suspects: list[Batch[Task]],
    check_workers: Callable[[], object] = lambda: None,
) -> Iterator[TaskResult[Value]]:
    """Run batches of tasks in an executor; end early if one of its processes crashes.

    Args:
        executor: The executor.
        function: A function of a module.
        left: The batches; those that are begun are taken from it.
        at_once: Number of batches that are submitted at any time.
        suspects: Gets the batches that were begun when a process crashed.
        check_workers: As in ``run_tasks_in``.
    """
    # Few batches wait at any time: all that have begun when a process crashes are run
    # again, each alone.
    running: dict[Future[list[TaskResult[Value]]], Batch[Task]] = {}
    while not suspects:
        for batch in islice(left, at_once - len(running)):
            try:
                running[executor.submit(_run_batch, function, batch)] = batch
            except BrokenExecutor:
                suspects.append(batch)
                break
        if not running:
            return
        done, _ = wait(running, CHECK_INTERVAL, return_when=FIRST_COMPLETED)
        if not done:
            check_workers()
        for future in done:
            batch = running.pop(future)
            try:
                results = future.result()
            except BrokenExecutor:
                suspects.append(batch)
            except CancelledError:
                # The cluster has been restarted, and forgets what was submitted, or it
                # is gone.
                check_workers()
                left = chain([batch], left)
            # What a task raises is its result: this is what a cluster raises that has
            # given a batch up, as its workers have died of it.
            except Exception as error:  # noqa: BLE001
                if len(batch) > 1:
                    left = chain(([one] for one in batch), left)
                else:
                    yield TaskResult(batch[0][0], None, f"{LOST}: {error}")
            else:
                yield from results
    # A process that crashes breaks the whole pool, and nobody knows which task it was:
    # all that had begun may be, and are run again, each alone.
    suspects.extend(running.values())


def in_order(results: Iterable[TaskResult[Value]]) -> Iterator[TaskResult[Value]]:
    """Yield results in the order of their tasks, each as soon as it is its turn."""
    early: dict[int, TaskResult[Value]] = {}
    turn = 0
    for result in results:
        early[result.number] = result
        while turn in early:
            yield early.pop(turn)
            turn += 1


def _batches(tasks: Sequence[Task], size: int) -> Iterator[Batch[Task]]:
    numbered = enumerate(tasks)
    while batch := list(islice(numbered, size)):
        yield batch


def _run_batch(
    function: Callable[[Task], Value], batch: Batch[Task]
) -> list[TaskResult[Value]]:
    return [_run(function, number, task) for number, task in batch]


def _run(
    function: Callable[[Task], Value], number: int, task: Task
) -> TaskResult[Value]:
    try:
        return TaskResult(number, function(task))
    except RadarsimError as error:
        return TaskResult(number, None, str(error))
    except Exception as error:  # noqa: BLE001 - one task that fails ends no other
        return TaskResult(number, None, f"{type(error).__name__}: {error}")


def _run_alone(
    executor: Executor, function: Callable[[Task], Value], one: tuple[int, Task]
) -> TaskResult[Value]:
    """Run a task in a process of its own, which it may crash."""
    try:
        (result,) = executor.submit(_run_batch, function, [one]).result()
    except BrokenExecutor:
        return TaskResult(one[0], None, LOST)
    return result
