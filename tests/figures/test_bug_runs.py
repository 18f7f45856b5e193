import pytest

from radarsim.figures.bug_runs import CLOSED, OPEN, draw_bug, run
from radarsim.navigation.options import Algorithm


def test_bug2_fails_at_a_closed_box() -> None:
    found = run(CLOSED, Algorithm.BUG2, 0)
    assert found.outcome == "no_path"
    assert found.collisions == 0
    assert found.length == pytest.approx(20, abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", list(Algorithm))
@pytest.mark.parametrize("seed", [0, 1])
def test_upper_run_succeeds_and_lower_run_fails(
    algorithm: Algorithm, seed: int
) -> None:
    drawn = draw_bug(seed, algorithm=algorithm)
    above, below = drawn.caption.split("Below, where")
    assert "Above: goal reached after" in above
    assert "no path after" in below
    assert "touched something 0 times" in below
    titles = [drawing.axes[0].get_title() for drawing in drawn.drawings]
    name = algorithm.value.capitalize()
    assert titles == [
        f"{name} in {OPEN}: goal reached",
        f"{name} in {CLOSED}: no path",
    ]


@pytest.mark.slow
def test_bug1_circumnavigates_and_drives_farther_than_bug2() -> None:
    one, two = (run(OPEN, algorithm, 0) for algorithm in Algorithm)
    assert (one.circuits, two.circuits) == (1, 0)
    assert one.length > two.length
    assert max(one.off, two.off) < 0.5
