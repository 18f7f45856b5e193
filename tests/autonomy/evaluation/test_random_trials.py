"""Trials on random maps: what counts as right, and a sample of runs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from radarsim.autonomy.evaluation.random_trials import (
    RandomTrialResult,
    RandomTrialSpec,
    all_random_trials,
    raster_truth,
    read_results,
    run_random_trial,
)
from radarsim.autonomy.evaluation.task_runner import as_line, split_tasks
from radarsim.generators.random_maps import SAFETY_DISTANCE, Block, RandomMap

DONE = RandomTrialResult(
    number=3,
    algorithm="bug2",
    expected="reached",
    outcome="reached",
    collisions=0,
    path_length=14.20049,
    shortest_path=12.1,
    time=55.0,
)


@pytest.mark.parametrize(
    ("expected", "outcome", "is_correct"),
    [
        ("reached", "reached", True),
        ("reached", "no_path", False),
        ("no_path", "no_path", True),
        ("no_path", "reached", False),
        ("either", "reached", True),
        ("either", "no_path", True),
        ("either", "failed", False),
    ],
)
def test_right_is_what_the_raster_allows(
    expected: str, outcome: str, is_correct: bool
) -> None:
    result = replace(DONE, expected=expected, outcome=outcome)
    assert result.correct is is_correct
    assert not replace(result, collisions=1).correct


@pytest.mark.parametrize(
    ("gap", "expected"),
    [
        pytest.param(1.6, "reached", id="wide"),
        pytest.param(0.9, "either", id="for a disc of half the diagonal"),
        pytest.param(0.65, "either", id="for the hull"),
        pytest.param(0.4, "no_path", id="for nothing"),
    ],
)
def test_what_is_expected_follows_from_the_gap(gap: float, expected: str) -> None:
    walls = [Block(0.0, side * (gap / 2 + 5.0), 0.3, 10.0) for side in (-1.0, 1.0)]
    ends = [Block(x, 0.0, 0.2, 20.3) for x in (-5.0, 5.0)]
    sides = [Block(0.0, y, 10.2, 0.2) for y in (-10.0, 10.0)]
    solids = (*walls, *ends, *sides)
    map_ = RandomMap(0, "boxes", solids, math.inf, (-3.0, 0.0), (3.0, 0.0))
    assert raster_truth(map_, SAFETY_DISTANCE, 0.0).expectation == expected


def test_only_trials_without_a_line_are_run(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    assert read_results(file) == []
    file.write_text(as_line(DONE.to_dict()))
    (done,) = read_results(file)
    assert done["path_length"] == 14.2
    assert done["correct"] is True
    keys = ("number", "algorithm")
    left, results = split_tasks(all_random_trials(4, ["bug1", "bug2"]), [done], keys)
    assert len(left) == 7
    assert RandomTrialSpec(3, "bug2") not in left
    assert results == [done]


def test_other_file_is_no_result(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    for text in ("hello\n", "[1]\n", '{"number": 1}\n'):
        file.write_text(text)
        with pytest.raises(ValueError, match=r"notes\.txt:1: expected the result"):
            read_results(file)


def test_sensors_and_side_beams_take_turns() -> None:
    kinds = {
        (spec.family, spec.sensor, spec.side_offset)
        for spec in (RandomTrialSpec(number, "bug1") for number in range(42))
    }
    assert len(kinds) == 42
    assert RandomTrialSpec(2, "bug1").reach == pytest.approx(0.2)
    assert RandomTrialSpec(1, "bug1").reach == 0.0


@pytest.mark.slow("sampled")
@pytest.mark.parametrize("number", range(20))
def test_random_map_is_told_rightly_and_nothing_touched(number: int) -> None:
    algorithm = ("bug1", "tangentbug", "bug2", "planned")[number % 4]
    result = run_random_trial(RandomTrialSpec(number, algorithm))
    assert result.correct, json.dumps(result.to_dict())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "algorithm"),
    [
        pytest.param(21, "bug2", id="long circuit, during which the yaw drifts"),
        pytest.param(188, "bug2", id="hit in a gap, whose other side it circled"),
        pytest.param(182, "bug2", id="the same gap again on the same hand"),
        pytest.param(58, "bug2", id="another obstacle followed away from the line"),
        pytest.param(
            357, "bug2", id="others circled beyond a gap, and not what was hit"
        ),
        pytest.param(
            108, "bug1", id="gap where it changed to what it had circled before"
        ),
        pytest.param(350, "bug1", id="leave point missed, first obstacle hit again"),
        pytest.param(248, "bug1", id="noise in a corner, where it stood"),
        pytest.param(151, "planned", id="way around beyond the first grid"),
        pytest.param(95, "tangentbug", id="boundary left where it could not go on"),
        pytest.param(50, "tangentbug", id="boundary that the robot lost sight of"),
        pytest.param(318, "tangentbug", id="gap entered that is closed from inside"),
        pytest.param(
            384, "tangentbug", id="turning between an edge ahead and one behind"
        ),
    ],
)
def test_map_that_was_told_wrongly_once(number: int, algorithm: str) -> None:
    result = run_random_trial(RandomTrialSpec(number, algorithm))
    assert result.correct, json.dumps(result.to_dict())
