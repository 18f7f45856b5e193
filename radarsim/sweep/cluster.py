"""Sweeps on a dask cluster that runs already, here or elsewhere.

joblib has a backend for dask, which waits for ever for a task whose workers have died,
and for a scheduler that is gone. So its futures are waited for here.
"""

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    wait,
)
from itertools import chain, islice
from typing import Any, Final, TypeVar

from radarsim import __version__
from radarsim.autonomy.evaluation.task_runner import LOST, TaskResult, run_task
from radarsim.errors import SweepError, import_optional
from radarsim.scene.scene import Scene
from radarsim.sweep.file import Parameters
from radarsim.sweep.tasks import Row, prepare_worker, run_sweep_task

CHECK_INTERVAL: Final = 1.0  # s between two looks at whether there are workers
_EXTRA: Final = "cluster"
_CONNECTING: Final = 30  # s
_WITHOUT_WORKERS: Final = 120  # s that a cluster may have no workers
_REGISTRATIONS: Final = 5  # attempts to prepare all workers
_AHEAD: Final = 2  # batches for each thread that wait to be run
# An adaptive cluster starts workers for tasks that wait: it has to see some of them.
_LEAST_THREADS: Final = 8

Task = TypeVar("Task")
Value = TypeVar("Value")


def run_on_cluster(
    address: str,
    scenes: Mapping[str, Scene],
    tasks: Iterable[Parameters],
    size: int,
    report: Callable[[str], None],
) -> Generator[TaskResult[list[Row]], None, None]:
    """Run tasks on a cluster, and yield each result as soon as there is one.

    Workers may come, go and restart.

    Args:
        address: Address of its scheduler, such as ``tcp://10.0.0.1:8786``.
        scenes: From ``load_scenes``; the workers get them.
        tasks: The tasks.
        size: Number of tasks that a worker is given at once.
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
        prepare_workers(distributed, client, scenes)
        # Not pure: dask would give equal tasks the result of an earlier run.
        executor = client.get_executor(pure=False)
        yield from run_batches(
            executor,
            run_sweep_task,
            tasks,
            size,
            lambda: count_threads(client, address, report),
        )


def prepare_workers(distributed: Any, client: Any, scenes: Mapping[str, Scene]) -> None:
    """Prepare all workers, and those that will join."""

    class Preparation(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "radarsim-sweep"

        def setup(self, worker: Any) -> None:
            del worker
            prepare_worker(__version__, scenes)

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
        why = f"it is gone: {error}"
    kept = "results so far are kept for --resume"
    raise SweepError(f"--scheduler {address}: {why}; {kept}")


def run_batches(
    executor: Executor,
    function: Callable[[Task], Value],
    tasks: Iterable[Task],
    size: int,
    count_threads: Callable[[], int],
) -> Iterator[TaskResult[Value]]:
    """Run tasks in batches, few of which wait at any time.

    Args:
        executor: An executor of processes that have what the function needs.
        function: A function of a module.
        tasks: The tasks.
        size: Number of tasks in a batch.
        count_threads: Returns how many threads the workers have, as soon as there is
            one; raises if no results can be expected any more.
    """
    numbered = enumerate(tasks)
    left = iter(lambda: list(islice(numbered, size)), [])
    running: dict[Future[list[TaskResult[Value]]], list[tuple[int, Task]]] = {}
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
    function: Callable[[Task], Value], batch: list[tuple[int, Task]]
) -> list[TaskResult[Value]]:
    return [run_task(function, number, (task,)) for number, task in batch]
