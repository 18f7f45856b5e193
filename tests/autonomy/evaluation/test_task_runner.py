"""Tasks run in any number of processes, fail alone, and draw by their parameters."""

import os
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

import pytest

from radarsim.autonomy.evaluation import task_runner
from radarsim.autonomy.evaluation.task_runner import (
    TaskResult,
    in_order,
    run_tasks,
    run_tasks_in,
    task_generator,
    task_key,
)
from radarsim.errors import MapError, RadarsimError


def square(number: int) -> int:
    if number == 2:
        raise MapError(["two: expected another number"])
    return 7 // (number - 3) + number * number


def square_or_crash(number: int) -> int:
    if number == 2:
        os._exit(3)
    return number * number


def test_failed_task_is_a_result_with_its_error() -> None:
    done = list(run_tasks(square, range(5), workers=1))
    assert [each.number for each in done] == [0, 1, 2, 3, 4]
    assert done[4] == TaskResult(4, 23)
    assert done[2] == TaskResult(2, None, "two: expected another number")
    assert done[3].error.startswith("ZeroDivisionError: ")
    with pytest.raises(RadarsimError, match="two: expected"):
        done[2].unwrap()


@pytest.mark.parametrize("batch", [1, 2, 9])
def test_executor_gives_the_same_results(batch: int) -> None:
    alone = list(run_tasks(square, range(5), workers=1))
    with ThreadPoolExecutor(2) as pool:
        done = run_tasks_in(pool, square, range(5), workers=2, batch=batch)
        assert list(in_order(done)) == alone


class GivingUp(Executor):
    """Runs nothing, as a cluster whose workers die of each task but the first."""

    def submit(
        self, function: Callable[..., Any], /, *args: Any, **_: Any
    ) -> Future[Any]:
        future: Future[Any] = Future()
        if args[-1][0][0] == 0:
            future.set_result(function(*args))
        else:
            future.set_exception(ValueError("four workers have died"))
        return future


def test_task_that_a_cluster_gives_up_is_lost_alone() -> None:
    done = list(in_order(run_tasks_in(GivingUp(), square, range(2), workers=1)))
    assert done[0] == TaskResult(0, -3)
    assert done[1].value is None
    assert done[1].error.endswith("expected a result: four workers have died")


def test_of_a_batch_that_a_cluster_gives_up_one_task_is_lost() -> None:
    class Deadly(ThreadPoolExecutor):
        def submit(self, function: Any, /, *args: Any, **_: Any) -> Future[Any]:
            if 4 in [number for number, _ in args[-1]]:
                function = GivingUp().submit(function, args[-1]).result
                return super().submit(function)
            return super().submit(function, *args)

    with Deadly(2) as pool:
        done = list(in_order(run_tasks_in(pool, square, range(9), workers=2, batch=3)))
    alone = list(run_tasks(square, range(9), workers=1))
    assert done[:4] + done[5:] == alone[:4] + alone[5:]
    assert done[4].error.endswith("four workers have died")


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

    checked: list[int] = []
    with Restarted(2) as pool:
        running = run_tasks_in(
            pool,
            square,
            range(9),
            workers=2,
            batch=2,
            check_workers=lambda: checked.append(1),
        )
        done = list(in_order(running))
    assert done == list(run_tasks(square, range(9), workers=1))
    assert len(checked) == 3


def test_workers_are_looked_at_while_results_are_awaited(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def check() -> None:
        raise RadarsimError("no workers")

    monkeypatch.setattr(task_runner, "CHECK_INTERVAL", 0.01)
    waiting = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        running = run_tasks_in(
            pool, waiting.wait, [9.0], workers=1, check_workers=check
        )
        with pytest.raises(RadarsimError, match="no workers"):
            next(running)
        waiting.set()


@pytest.mark.slow
def test_task_that_crashes_its_process_fails_alone() -> None:
    running = run_tasks(square_or_crash, range(6), workers=2)
    done = sorted(running, key=lambda each: each.number)
    assert [each.value for each in done] == [0, 1, None, 9, 16, 25]
    assert "crashed" in done[2].error


def test_results_in_order_come_as_soon_as_it_is_their_turn() -> None:
    yielded = in_order(TaskResult(number, number) for number in (1, 0, 3, 2))
    assert [each.number for each in yielded] == [0, 1, 2, 3]


def test_draws_depend_on_the_parameters_alone() -> None:
    def draw(seed: int, **parameters: Any) -> float:
        return float(task_generator(seed, parameters).random())

    assert draw(0, map="room", side=25) == draw(0, side=25, map="room")
    others = {draw(0, map="room", side=s) for s in (25, 50)}
    others |= {draw(1, map="room", side=25), draw(0, map="room", side="25")}
    assert len(others) == 4
    assert task_key({"a": 1, "b": [2]}) == task_key({"b": [2], "a": 1})
    assert task_key({"a": 1}) != task_key({"a": 1.5})
