import math

import pytest

from radarsim.lab.bench.addons import turning_radar


@pytest.mark.slow
def test_radar_turns_beside_plain_robots() -> None:
    late, turns, share = turning_radar(1.0, robots=2)
    # A busy machine is late, and then makes up for several turns at once.
    assert late.value >= 0
    assert turns.value > 0
    assert math.isfinite(share.value)
    assert [row.unit for row in (late, turns, share)] == ["ms", "1/s", "%"]
