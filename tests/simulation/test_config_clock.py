import pytest

from radarsim.simulation.config import TICK, seconds, ticks_of


def test_the_time_of_a_tick_has_no_rounding_in_its_digits() -> None:
    assert [repr(seconds(n)) for n in (0, 1, 7, 29, 30, 360_010)] == [
        *("0.0", "0.01", "0.07", "0.29", "0.3", "3600.1")
    ]


@pytest.mark.parametrize(
    ("interval", "ticks"),
    [
        pytest.param(0.1, 10, id="tenth of a second"),
        pytest.param(0.3, 30, id="three tenths"),
        pytest.param(0.004, 1, id="less than a tick"),
        pytest.param(TICK, 1, id="a tick"),
    ],
)
def test_an_interval_is_whole_ticks(interval: float, ticks: int) -> None:
    assert ticks_of(interval) == ticks
