import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Pose2, Pose3
from radarsim.navigation.observation import Observation, from_centre

ANGLES = np.radians(np.arange(-179.5, 180.0))


@given(
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-math.pi, math.pi),
    st.integers(0, 359),
)
def test_an_end_of_a_beam_is_the_same_place_from_the_centre(
    x: float, y: float, yaw: float, beam: int
) -> None:
    ranges = np.full(360, 3.0)
    bearings, reach = from_centre(ranges, ANGLES, Pose3(x, y, 0.2, yaw=yaw), 80.0)
    angle = ANGLES[beam] + yaw
    seen = (x + 3 * math.cos(angle), y + 3 * math.sin(angle))
    told = reach[beam] * np.array([math.cos(bearings[beam]), math.sin(bearings[beam])])
    assert told == pytest.approx(seen, abs=1e-9)
    assert np.all((bearings >= -math.pi) & (bearings < math.pi))


def test_what_did_not_come_back_is_infinitely_far_and_keeps_its_bearing() -> None:
    ranges = np.array([80.0, 79.0, 85.0])
    angles = np.array([-math.pi, 0.0, 1.0])
    bearings, reach = from_centre(ranges, angles, Pose3(0.2, 0, 0.2), 80.0)
    assert reach.tolist() == [math.inf, pytest.approx(79.2), math.inf]
    assert bearings == pytest.approx([-math.pi, 0, 1.0], abs=1e-3)


def test_points_are_where_beams_ended_on_the_map() -> None:
    observation = Observation(
        0.0,
        Pose2(1.0, 2.0, math.pi / 2),
        np.array([0.0, 1.0]),
        np.array([3.0, math.inf]),
    )
    assert observation.points() == pytest.approx(np.array([[1.0, 5.0]]))
