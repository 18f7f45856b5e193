"""Tasks on a cluster, whose workers may come, go, restart and die of a task."""

import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

import pytest

from radarsim.autonomy.evaluation import task_runner
from radarsim.autonomy.evaluation.task_runner import run_batches
from radarsim.errors import RadarsimError, SweepError

distributed = pytest.importorskip("distributed")


def square(number: int) -> int:
    return 7 // (number - 3) + number * number  # 3 fails


def squares(executor: Executor, size: int) -> list[tuple[int, int | None, str]]:
    """Run nine tasks in batches."""
    tasks = ((number,) for number in range(9))
    return sorted(run_batches(executor, square, tasks, size, lambda: 1))


ALONE = squares(ThreadPoolExecutor(1), 1)


@pytest.mark.parametrize("size", [2, 9])
def test_batches_do_not_change_results(size: int) -> None:
    assert [each[0] for each in ALONE] == [*range(9)]
    assert ALONE[3][2].startswith("ZeroDivisionError: ")
    with ThreadPoolExecutor(2) as pool:
        assert squares(pool, size) == ALONE


class Deadly(ThreadPoolExecutor):
    """Gives a batch up, as a cluster whose workers die of task 4."""

    def submit(self, function: Any, /, *args: Any, **_: Any) -> Future[Any]:
        if 4 in [number for number, _ in args[-1]]:
            future: Future[Any] = Future()
            future.set_exception(ValueError("four workers have died"))
            return future
        return super().submit(function, *args)


@pytest.mark.parametrize("size", [1, 3])
def test_of_a_batch_that_a_cluster_gives_up_one_task_is_lost(size: int) -> None:
    with Deadly(2) as pool:
        done = squares(pool, size)
    assert done[:4] + done[5:] == ALONE[:4] + ALONE[5:]
    assert done[4][1] is None
    assert done[4][2].endswith("expected a result: four workers have died")


def test_what_a_cluster_has_forgotten_is_run_again() -> None:
    class Restarted(ThreadPoolExecutor):
        forgets = 3

        def submit(self, function: Any, /, *args: Any, **_: Any) -> Future[Any]:
            future = super().submit(function, *args)
            if self.forgets:
                self.forgets -= 1
                future = Future()
                future.cancel()
                future.set_running_or_notify_cancel()
            return future

    with Restarted(2) as pool:
        assert squares(pool, 2) == ALONE


def test_workers_are_looked_at_while_results_are_awaited(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks = iter([1])

    def count_threads() -> int:
        for threads in looks:
            return threads
        raise RadarsimError("no workers")

    monkeypatch.setattr(task_runner, "CHECK_INTERVAL", 0.01)
    waiting = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        running = run_batches(pool, waiting.wait, [(9.0,)], 1, count_threads)
        with pytest.raises(RadarsimError, match="no workers"):
            next(running)
        waiting.set()


class Client:
    """A client of distributed whose scheduler is gone, or has no workers."""

    def __init__(self, *, is_gone: bool) -> None:
        self.is_gone = is_gone

    def nthreads(self) -> dict[str, int]:
        if self.is_gone:
            raise distributed.comm.CommClosedError("no connection")
        return {}

    def wait_for_workers(self, count: int, timeout: float) -> None:
        raise distributed.client.WorkerStartTimeoutError(0, count, timeout)


@pytest.mark.parametrize(
    ("is_gone", "why"),
    [(True, "the connection is lost: no connection"), (False, "no workers for 120 s")],
)
def test_cluster_without_workers_ends_the_sweep(*, is_gone: bool, why: str) -> None:
    printed: list[str] = []
    with pytest.raises(SweepError, match=f"^--scheduler tcp://me:1: {why}.*; results"):
        task_runner.count_threads(Client(is_gone=is_gone), "tcp://me:1", printed.append)
    assert len(printed) == 1 - is_gone


class Registering:
    """A client of distributed with workers that die while they receive a task."""

    def __init__(self, deaths: int) -> None:
        self.deaths = deaths

    def register_plugin(self, _: object) -> None:
        self.deaths -= 1
        if self.deaths >= 0:
            raise distributed.comm.CommClosedError("it has died")


def test_worker_that_dies_while_it_registers_ends_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(task_runner, "CHECK_INTERVAL", 0.0)
    task_runner.prepare_workers(distributed, Registering(2), list)
    with pytest.raises(SweepError, match="cannot run radarsim: it has died"):
        task_runner.prepare_workers(distributed, Registering(99), list)
