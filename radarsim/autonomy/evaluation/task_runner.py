"""Run many independent tasks in several processes, here or on a dask cluster.

A task that fails ends no other. joblib has a backend for dask, which waits for ever for
a task whose workers have died, and for a scheduler that is gone. So the futures of dask
are waited for here.
"""

import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from itertools import chain, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeAlias, TypeVar

import joblib
from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor

from radarsim.errors import RadarsimError, SweepError, import_optional
from radarsim.processes import start_worker, starting_workers

LOST: Final = "the worker process was killed or crashed, expected a result"
CHECK_INTERVAL: Final = 1.0  # s between two looks at whether there are workers
_EXTRA: Final = "cluster"
_CONNECTING: Final = 30  # s
_WITHOUT_WORKERS: Final = 120  # s that a cluster may have no workers
_REGISTRATIONS: Final = 5  # attempts to prepare all workers
_AHEAD: Final = 2  # batches for each thread that wait to be run
# An adaptive cluster starts workers for tasks that wait: it has to see some of them.
_LEAST_THREADS: Final = 8

Arguments: TypeAlias = tuple[Any, ...]
Value = TypeVar("Value")
# Number of a task, what the function returned, and why it failed, empty if it did not.
TaskResult: TypeAlias = tuple[int, Value | None, str]


def run_tasks(
    function: Callable[..., Value],
    tasks: Sequence[Arguments],
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
    tasks: dict[int, Arguments],
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
    function: Callable[..., Value], number: int, arguments: Arguments
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


def run_on_cluster(
    address: str,
    function: Callable[..., Value],
    tasks: Sequence[Arguments],
    size: int,
    prepare: Callable[[], object],
    report: Callable[[str], None],
) -> Generator[TaskResult[Value], None, None]:
    """Run tasks on a dask cluster, and yield each result as soon as there is one.

    Workers may come, go and restart.

    Args:
        address: Address of its scheduler, such as ``tcp://10.0.0.1:8786``.
        function: The function.
        tasks: Its arguments in each task.
        size: Number of tasks that a worker is given at once.
        prepare: Called in each worker before its first task; can be pickled.
        report: Called with what a user should know.

    Raises:
        MissingPackage: If distributed is not installed.
        SweepError: If there is no such cluster, one of its workers has another version
            of radarsim, or none at all, there are no workers for too long, or the
            scheduler is gone.
    """
    distributed = import_optional("distributed", _EXTRA)
    try:
        client = distributed.Client(address, timeout=_CONNECTING)
    except (OSError, ValueError, TimeoutError) as error:
        raise SweepError(f"--scheduler {address}: {error}") from error
    with client:
        prepare_workers(distributed, client, prepare)
        # Not pure: dask would give equal tasks the result of an earlier run.
        executor = client.get_executor(pure=False)
        yield from run_batches(
            executor,
            function,
            tasks,
            size,
            lambda: count_threads(client, address, report),
        )


def prepare_workers(
    distributed: Any, client: Any, prepare: Callable[[], object]
) -> None:
    """Prepare all workers, and those that will join."""

    class Preparation(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "radarsim-tasks"

        def setup(self, worker: Any) -> None:
            del worker
            prepare()

    for attempt in reversed(range(_REGISTRATIONS)):
        try:
            client.register_plugin(Preparation())
        # distributed passes on what its plugin raises, here that of another version.
        except SweepError:
            raise
        except Exception as error:
            # A worker that has died meanwhile is none that cannot run it.
            if isinstance(error, OSError) and attempt:
                time.sleep(CHECK_INTERVAL)
                continue
            # whatever keeps a worker from importing radarsim
            text = f"a worker cannot run radarsim: {error}"
            raise SweepError(text) from error
        return


def count_threads(client: Any, address: str, report: Callable[[str], None]) -> int:
    """Return how many threads the workers have, as soon as there is one.

    Raises:
        SweepError: If there is none for too long, or the scheduler is gone.
    """
    try:
        if not client.nthreads():
            limit = f"up to {_WITHOUT_WORKERS} s"
            report(f"{address} has no workers; waiting {limit} for one")
            client.wait_for_workers(1, timeout=_WITHOUT_WORKERS)
        return sum(client.nthreads().values())
    except TimeoutError:
        why = f"no workers for {_WITHOUT_WORKERS} s, expected some"
    except (OSError, RuntimeError) as error:
        why = f"the connection is lost: {error}"
    kept = "results so far are kept for --resume"
    raise SweepError(f"--scheduler {address}: {why}; {kept}")


def run_batches(
    executor: Executor,
    function: Callable[..., Value],
    tasks: Iterable[Arguments],
    size: int,
    count_threads: Callable[[], int],
) -> Iterator[TaskResult[Value]]:
    """Run tasks in batches; only a few batches wait at any time.

    Args:
        executor: An executor of processes that have what the function needs.
        function: A function of a module.
        tasks: Its arguments in each task.
        size: Number of tasks in a batch.
        count_threads: Returns how many threads the workers have, as soon as there is
            one; raises if no results can be expected any more.
    """
    numbered = enumerate(tasks)
    left = iter(lambda: list(islice(numbered, size)), [])
    running: dict[Future[list[TaskResult[Value]]], list[tuple[int, Arguments]]] = {}
    threads = 0
    while True:
        at_once = _AHEAD * max(threads, _LEAST_THREADS)
        for batch in islice(left, at_once - len(running)):
            running[executor.submit(_run_batch, function, batch)] = batch
        if not running:
            return
        done, _ = wait(running, CHECK_INTERVAL, return_when=FIRST_COMPLETED)
        if not done or not threads:
            threads = count_threads()
        for future in done:
            batch = running.pop(future)
            try:
                yield from future.result()
            except CancelledError:
                # The cluster has been restarted and has forgotten it, or is gone.
                threads = count_threads()
                left = chain([batch], left)
            # What a task raises is its result: this is what a cluster raises that has
            # given a batch up, as its workers have died of it.
            except Exception as error:  # noqa: BLE001
                if len(batch) > 1:
                    left = chain(([one] for one in batch), left)
                else:
                    yield batch[0][0], None, f"{LOST}: {error}"


def _run_batch(
    function: Callable[..., Value], batch: list[tuple[int, Arguments]]
) -> list[TaskResult[Value]]:
    return [run_task(function, number, task) for number, task in batch]
