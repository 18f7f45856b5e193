import functools

import pytest

from radarsim.autonomy.navigation.algorithms import Algorithm
from radarsim.lab.figures.runs import CLOSED, OPEN, draw_bug, run

drawn_bug = functools.cache(draw_bug)
BUGS = (Algorithm.BUG1, Algorithm.BUG2)


@pytest.mark.slow
def test_bug2_fails_at_a_closed_box() -> None:
    found = run(CLOSED, Algorithm.BUG2, 0)
    assert found.outcome == "no_path"
    assert found.monitor is not None
    assert found.monitor.collisions == 0
    assert found.monitor.path_length == pytest.approx(20, abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", BUGS)
@pytest.mark.parametrize("seed", [0, 1])
def test_upper_run_succeeds_and_lower_run_fails(
    algorithm: Algorithm, seed: int
) -> None:
    drawn = drawn_bug(seed, algorithm=algorithm)
    left, right = drawn.details.split("On the right")
    assert "On the left: goal reached after" in left
    assert "no path after" in right
    assert "touched something 0 times" in right
    drawing = drawn.drawing
    reached, failed = drawing.axes
    assert "reaches its goal" in reached.get_title("left")
    assert "no path" in failed.get_title("left")
    assert reached.viewLim.bounds == failed.viewLim.bounds


@pytest.mark.slow
def test_captions_tell_what_the_algorithms_do_differently() -> None:
    captions = [drawn_bug(0, algorithm=algorithm).caption for algorithm in BUGS]
    one, two = (caption.split(". ") for caption in captions)
    assert len(one) == len(two) == 2
    assert one[0] != two[0]
    assert one[1] != two[1]


@pytest.mark.slow
def test_bug1_circumnavigates_and_drives_farther_than_bug2() -> None:
    one, two = (run(OPEN, algorithm, 0) for algorithm in BUGS)
    assert (one.circuits, two.circuits) == (1, 0)
    assert one.monitor is not None
    assert two.monitor is not None
    assert one.monitor.path_length > two.monitor.path_length
    goals = one.mission.goals[-1], two.mission.goals[-1]
    assert max(one.monitor.distance(goals[0]), two.monitor.distance(goals[1])) < 0.5
