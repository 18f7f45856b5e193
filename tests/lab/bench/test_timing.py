import json
import time
from functools import partial

import pytest

from radarsim.lab.bench.run import STEPS, run_all
from radarsim.lab.bench.timing import BenchmarkRow, compare, measure


def spin(rounds: int) -> int:
    return sum(range(rounds))


def test_twice_the_work_takes_about_twice_as_long() -> None:
    for _ in range(10):  # other processes disturb single measurements
        result = compare(lambda: spin(20_000), lambda: spin(10_000), seconds=0.2)
        if 1.5 < result.ratio < 2.7:
            return
    pytest.fail(f"{result}, expected a ratio of about 2")


def test_time_of_this_thread_can_be_compared() -> None:
    result = compare(
        lambda: time.sleep(0.01), lambda: spin(10), seconds=0, clock=time.thread_time
    )
    assert 0 < result.subject < 0.01


def test_a_measurement_is_a_time() -> None:
    assert 0 < measure(lambda: spin(10), seconds=0.01) < 1


@pytest.mark.parametrize(
    ("value", "limit", "within"),
    [(1.0, None, None), (1.0, 1.0, True), (1.1, 1.0, False)],
)
def test_row_states_whether_it_keeps_its_limit(
    value: float, limit: float | None, within: bool | None
) -> None:
    row = BenchmarkRow("a", "name", value, "x", limit)
    assert row.within is within
    assert json.loads(json.dumps(row.to_dict()))["within"] is within


def test_all_steps_run_in_turn_and_report_progress(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in STEPS:
        rows = [BenchmarkRow("a", f"{name} {i}", 1.0, "x") for i in range(3)]
        monkeypatch.setitem(STEPS, name, (partial(iter, rows), 2))
    described: list[tuple[str, int, int]] = []
    rows = run_all(lambda *what: described.append(what))
    assert len(rows) == 3 * len(STEPS)
    done = [what[1] for what in described]
    assert done == sorted(done)
    assert described[-1] == ("done", 2 * len(STEPS), 2 * len(STEPS))
