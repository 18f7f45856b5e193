import pytest

from radarsim.robots.robot import Battery


@pytest.mark.parametrize(
    ("elapsed", "endless", "mortal"),
    [
        pytest.param(0.0, 1200, 1200, id="full"),
        pytest.param(0.1, 1199, 1199, id="a tenth later"),
        pytest.param(0.1 + 0.2 + 0.7, 1199, 1199, id="a second later"),
        pytest.param(sum([0.01] * 100), 1199, 1199, id="a hundred ticks later"),
        pytest.param(1199.0, 1, 1, id="last second"),
        pytest.param(1199.5, 1, 0, id="last half second"),
        pytest.param(1200.0, 1, 0, id="empty"),
        pytest.param(5000.0, 1, 0, id="long after"),
    ],
)
def test_seconds_left(elapsed: float, endless: int, mortal: int) -> None:
    assert Battery(1200.0).seconds_left(elapsed) == endless
    assert Battery(1200.0, runs_out=True).seconds_left(elapsed) == mortal


def test_only_a_battery_that_runs_out_gets_empty() -> None:
    assert not Battery(3600.0).is_empty(1e6)
    assert Battery(1200.0, runs_out=True).is_empty(1200.0)
    assert not Battery(1200.0, runs_out=True).is_empty(1198.9)
