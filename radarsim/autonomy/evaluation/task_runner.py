"""Run many independent tasks in processes of this machine or of a dask cluster.

A failed task does not end the other tasks. joblib's backend for dask waits forever for
a task whose workers have died, and for a scheduler that has stopped. So this module
waits for the futures of dask itself.
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
CHECK_INTERVAL: Final = 1.0  # s between two checks whether there are workers
_EXTRA: Final = "cluster"
_CONNECTING: Final = 30  # s; timeout of the connection
_WITHOUT_WORKERS: Final = 120  # s; timeout without any workers
_REGISTRATIONS: Final = 5  # attempts to prepare all workers
_AHEAD: Final = 2  # queued batches for each thread
# An adaptive cluster starts workers only while tasks are queued. So batches for at
# least this number of threads are queued, even before there are workers.
_LEAST_THREADS: Final = 8

Arguments: TypeAlias = tuple[Any, ...]
Value = TypeVar("Value")
# number of the task, return value, and error message, which is empty without an error
TaskResult: TypeAlias = tuple[int, Value | None, str]


def run_tasks(
    function: Callable[..., Value],
    tasks: Sequence[Arguments],
    *,
    workers: int,
    prepare: Callable[[], object] = int,
) -> Generator[TaskResult[Value], None, None]:
    """Run tasks in parallel, and yield each result as soon as it is available.

    Closing the generator early ends the running tasks. A task whose process crashes
    fails without affecting other tasks.

    Args:
        function: The function.
        tasks: Arguments of the function for each task.
        workers: Number of processes; with one, all tasks run in this process.
        prepare: Called in each process before its first task; has to be picklable.
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
            # Each crash is followed by new processes, since the old pool would keep
            # unsent tasks and would not prepare the processes that it starts.
            with _processes(workers, prepare) as parallel:
                for result in _run_together(parallel, function, left, begun):
                    del left[result[0]]
                    yield result
        except BrokenProcessPool:
            if suspects.issuperset(left):  # the task ran alone
                yield from ((number, None, LOST) for number in left)
                continue
            # It is unknown which task crashed, so each started task runs again, alone.
            suspects.update(left.keys() & begun)
            groups.append({key: left[key] for key in left if key not in suspects})
            groups.extend({key: left[key]} for key in left if key in suspects)


def _run_together(
    parallel: Parallel,
    function: Callable[..., Value],
    tasks: dict[int, Arguments],
    begun: list[int],
) -> Iterator[TaskResult[Value]]:
    """Run tasks until a process crashes; ``begun`` gets the number of each."""

    def calls() -> Iterator[Any]:
        for number, arguments in [*tasks.items()]:
            begun.append(number)
            yield delayed(run_task)(function, number, arguments)

    with starting_workers():
        results = parallel(calls())
        # Without a pause, joblib may shut down while its thread is still sending tasks,
        # and the thread would fail.
        time.sleep(0.1)
    yield from results


@contextmanager
def _processes(workers: int, prepare: Callable[[], object]) -> Iterator[Parallel]:
    """Open a pool of processes, which are started when the first tasks arrive."""
    # joblib warns if tasks end early, and if it restarts a worker because of high
    # memory use. These warnings are not shown.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"joblib\.")
    with TemporaryDirectory(prefix="radarsim-") as folder:
        # The workers read the pickled function ``prepare`` from a file. With a pipe,
        # they would start one after the other.
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
        finally:  # ends processes before the file is removed
            get_reusable_executor(kill_workers=True).shutdown()


def _prepare(file: Path) -> None:
    joblib.load(file)()


def run_task(
    function: Callable[..., Value], number: int, arguments: Arguments
) -> TaskResult[Value]:
    """Run a task; return its number, its return value, and its error message."""
    try:
        return number, function(*arguments), ""
    except RadarsimError as error:
        return number, None, str(error)
    except Exception as error:  # noqa: BLE001 - a failed task must not end the others
        return number, None, f"{type(error).__name__}: {error}"


def in_order(results: Iterable[TaskResult[Value]]) -> list[Value]:
    """Return the return values of tasks, sorted by the numbers of the tasks.

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
    """Run tasks on a dask cluster, and yield each result as soon as it is available.

    Workers may join, leave and restart.

    Args:
        address: Address of the scheduler, such as ``tcp://10.0.0.1:8786``.
        function: The function.
        tasks: Arguments of the function for each task.
        size: Number of tasks sent to a worker at once.
        prepare: Called in each worker before its first task; has to be picklable.
        report: Called with messages for the user.

    Raises:
        MissingPackage: If distributed is not installed.
        SweepError: If the cluster cannot be reached, a worker has another version of
            radarsim or cannot import it, there are no workers for too long, or the
            scheduler stops.
    """
    distributed = import_optional("distributed", _EXTRA)
    try:
        client = distributed.Client(address, timeout=_CONNECTING)
    except (OSError, ValueError, TimeoutError) as error:
        raise SweepError(f"--scheduler {address}: {error}") from error
    with client:
        prepare_workers(distributed, client, prepare)
        # ``pure=False`` makes dask run equal tasks
        # again instead of returning old results.
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
    """Prepare all workers of a cluster, including workers that join it later."""

    class Preparation(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "radarsim-tasks"

        def setup(self, worker: Any) -> None:
            del worker
            prepare()

    for attempt in reversed(range(_REGISTRATIONS)):
        try:
            client.register_plugin(Preparation())
        # ``distributed`` re-raises errors of its plugin, such as a version mismatch.
        except SweepError:
            raise
        except Exception as error:
            # A worker that has died meanwhile does not count as a failed preparation.
            if isinstance(error, OSError) and attempt:
                time.sleep(CHECK_INTERVAL)
                continue
            # Any other error means that the worker cannot import radarsim.
            text = f"a worker cannot run radarsim: {error}"
            raise SweepError(text) from error
        return


def count_threads(client: Any, address: str, report: Callable[[str], None]) -> int:
    """Wait until a cluster has a worker; return the number of threads of all workers.

    Raises:
        SweepError: If there is no worker for too long, or the scheduler has stopped.
    """
    try:
        if not client.nthreads():
            limit = f"up to {_WITHOUT_WORKERS} s"
            report(f"{address} has no workers; waiting {limit} for one")
            client.wait_for_workers(1, timeout=_WITHOUT_WORKERS)
        return sum(client.nthreads().values())
    except TimeoutError:
        why = f"no workers for {_WITHOUT_WORKERS} s, expected at least one"
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
    """Run tasks in batches, with only a few batches queued at any time.

    Args:
        executor: An executor whose processes are prepared for the function.
        function: A module-level function.
        tasks: Arguments of the function for each task.
        size: Number of tasks in a batch.
        count_threads: Returns the number of worker threads, as soon as there is one;
            raises if no more results can be expected.
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
                # The cluster has stopped, or it has restarted and lost the batch.
                threads = count_threads()
                left = chain([batch], left)
            # Errors of tasks are part of the results, so this error comes from the
            # cluster: it has given up the batch because the workers died.
            except Exception as error:  # noqa: BLE001
                if len(batch) > 1:
                    left = chain(([one] for one in batch), left)
                else:
                    yield batch[0][0], None, f"{LOST}: {error}"


def _run_batch(
    function: Callable[..., Value], batch: list[tuple[int, Arguments]]
) -> list[TaskResult[Value]]:
    return [run_task(function, number, task) for number, task in batch]
