import pytest

from radarsim.benchmark.radars import turning_radar


@pytest.mark.slow
def test_radar_turns_beside_plain_robots() -> None:
    late, turns, share = turning_radar(1.0, robots=2)
    assert late.value >= 0
    # a busy machine may be late at the end of the second
    assert 0 <= turns.value < 6
    assert share.unit == "%"
