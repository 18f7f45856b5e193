"""Tasks run in any number of processes, and fail alone."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from processes import has_ended

from radarsim.autonomy.evaluation.task_runner import in_order, run_tasks
from radarsim.errors import MapError, RadarsimError

NUMBERS = [(number,) for number in range(6)]


def square(number: int) -> int:
    if number == 2:
        raise MapError(["two: expected another number"])
    return 7 // (number - 3) + number * number


def square_or_die(number: int) -> int:
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def create_file(folder: Path) -> None:
    (folder / str(os.getpid())).open("x").close()


def test_failed_task_is_a_result_with_its_error() -> None:
    done = list(run_tasks(square, NUMBERS, workers=1))
    assert [number for number, _, _ in done] == [0, 1, 2, 3, 4, 5]
    assert done[4] == (4, 23, "")
    assert done[2] == (2, None, "two: expected another number")
    assert done[3][2].startswith("ZeroDivisionError: ")
    with pytest.raises(RadarsimError, match="two: expected"):
        in_order(done)


@pytest.mark.slow
def test_processes_give_the_same_results_of_any_function() -> None:
    prepared: list[int] = []  # of each process
    run = lambda number: (square(number), len(prepared))  # noqa: E731
    one, two = (
        sorted(run_tasks(run, NUMBERS, workers=workers, prepare=each))
        for workers, each in ((1, int), (2, int))
    )
    assert two == one


@pytest.mark.slow
def test_each_process_is_prepared_once(tmp_path: Path) -> None:
    prepare = partial(create_file, tmp_path)
    workers = {
        pid for _, pid, _ in run_tasks(os.getpid, [()] * 9, workers=2, prepare=prepare)
    }
    prepared = {int(path.name) for path in tmp_path.iterdir()}
    assert os.getpid() not in workers
    assert workers <= prepared


@pytest.mark.slow
def test_task_that_kills_its_process_fails_alone() -> None:
    done = sorted(run_tasks(square_or_die, NUMBERS, workers=2))
    assert [value for _, value, _ in done] == [0, 1, None, 9, 16, 25]
    assert "killed or crashed" in done[2][2]


def prepare_process() -> None:
    os.environ["IS_PREPARED"] = "yes"


def die_once(number: int, first: Path) -> str:
    """Return whether the process was prepared; the first of one number dies."""
    time.sleep(0.1)
    if number == 4 and not first.exists():
        first.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.environ.get("IS_PREPARED", "no")


def test_all_tasks_run_in_prepared_processes_after_one_was_killed(
    tmp_path: Path,
) -> None:
    tasks = [(number, tmp_path / "died") for number in range(12)]
    done = run_tasks(die_once, tasks, workers=2, prepare=prepare_process)
    assert sorted(done) == [(number, "yes", "") for number in range(12)]


def test_results_are_put_in_order() -> None:
    assert in_order([(1, 10, ""), (0, 5, ""), (2, 0, "")]) == [5, 10, 0]


PARENT = """
import os, sys, time
from radarsim.autonomy.evaluation.task_runner import run_tasks

def run(duration):
    time.sleep(duration)
    return os.getpid()

running = run_tasks(run, [(0.0,), (300.0,), (300.0,)], workers=2)
try:
    print(next(running)[1], flush=True)
    next(running)
except KeyboardInterrupt:
    sys.exit(130)
"""


def started(program: str) -> subprocess.Popen[bytes]:
    """Start a program in a session of its own, whose processes get Ctrl-C together."""
    return subprocess.Popen(
        (sys.executable, "-c", program),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_workers_end_with_the_main_process(number: int, code: int) -> None:
    with started(PARENT) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        if number == signal.SIGINT:
            os.killpg(parent.pid, number)  # as a terminal does
        else:
            parent.kill()
        _, errors = parent.communicate(timeout=60)
    assert parent.returncode == code
    if number == signal.SIGINT:
        assert errors == b""
    assert has_ended(worker)


STARTING = """
import time
from radarsim.autonomy.evaluation.task_runner import run_tasks

running = run_tasks(time.sleep, [(60.0,)] * 2, workers=2)
print("go", flush=True)
try:
    next(running)
except KeyboardInterrupt:
    pass
"""


@pytest.mark.parametrize("delay", [0.05, 0.2])
def test_ctrl_c_while_workers_start_prints_nothing(delay: float) -> None:
    with started(STARTING) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        time.sleep(delay)
        os.killpg(parent.pid, signal.SIGINT)  # as a terminal does
        _, errors = parent.communicate(timeout=60)
    assert (parent.returncode, errors) == (0, b"")
