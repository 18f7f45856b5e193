"""Random maps: what counts as right there, and a sample of runs."""

import math

import pytest
from random_trials import random_trial_errors, raster_truth

from radarsim.generators.random_maps import SAFETY_DISTANCE, Block, RandomMap


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


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_random_map_gets_the_right_verdict_and_nothing_is_touched(number: int) -> None:
    algorithm = ("bug1", "tangentbug", "bug2", "planned")[number % 4]
    assert not random_trial_errors(number, algorithm)


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
def test_map_that_once_got_a_wrong_verdict(number: int, algorithm: str) -> None:
    assert not random_trial_errors(number, algorithm)
