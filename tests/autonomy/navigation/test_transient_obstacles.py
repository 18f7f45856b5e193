"""What vanishes near the robot from one scan to the next is kept for a while."""

import numpy as np
import pytest

from radarsim.autonomy.navigation.hidden_obstacles import (
    KEPT_FOR,
    TransientObstacles,
)
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Pose2

POSE = Pose2(1.0, -1.0, 0.5)
BEARINGS = np.radians(np.arange(360.0) - 180.0)


def scan(
    time: float, bearing_deg: int = 0, range_: float = 5.0, pose: Pose2 = POSE
) -> Observation:
    """Return a scan of far things, in which three beams end nearer."""
    ranges = np.full(360, 5.0)
    ranges[180 + bearing_deg - 1 : 180 + bearing_deg + 2] = range_
    return Observation(time, pose, BEARINGS, ranges)


def test_what_a_scan_shows_near_and_the_next_looks_through_stays_for_a_while() -> None:
    vanished = TransientObstacles()
    shown = scan(0.0, 30, 0.5)
    assert vanished.add_to(shown) is shown
    seen = vanished.add_to(scan(0.1))
    assert seen.ranges[180 + 30] == pytest.approx(0.5, abs=0.001)
    assert (seen.ranges < 5.0).sum() == pytest.approx(12, abs=2)
    # from elsewhere it is at the same place
    turned = vanished.add_to(scan(0.2, pose=Pose2(1.0, -1.0, 0.5 + np.radians(90))))
    assert turned.ranges[180 - 60] == pytest.approx(0.5, abs=0.001)
    assert (vanished.add_to(scan(KEPT_FOR)).ranges < 5.0).any()
    assert not (vanished.add_to(scan(KEPT_FOR + 0.2)).ranges < 5.0).any()


@pytest.mark.parametrize(
    ("range_", "now"),
    [
        pytest.param(0.8, scan(0.1), id="far away"),
        pytest.param(0.5, scan(0.1, 45, 0.5), id="moved aside"),
        pytest.param(0.5, scan(0.1, 30, 0.7), id="moved away"),
    ],
)
def test_what_moves_or_is_far_away_is_not_kept(range_: float, now: Observation) -> None:
    vanished = TransientObstacles()
    vanished.add_to(scan(0.0, 30, range_))
    assert vanished.add_to(now).ranges.tolist() == now.ranges.tolist()


def test_nothing_has_vanished_where_no_beam_looks() -> None:
    vanished = TransientObstacles()
    vanished.add_to(scan(0.0, 30, 0.5))
    now = Observation(0.1, POSE, BEARINGS[:150], np.full(150, 5.0))
    assert vanished.add_to(now).ranges.tolist() == now.ranges.tolist()
