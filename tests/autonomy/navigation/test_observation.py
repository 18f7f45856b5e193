import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.navigation.observation import Observation, ScanClock, from_centre
from radarsim.geometry import Pose2, Pose3

ANGLES = np.radians(np.arange(-179.5, 180.0))


@given(
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-math.pi, math.pi),
    st.integers(0, 359),
)
def test_beam_end_is_the_same_point_from_the_centre(
    x: float, y: float, yaw: float, beam: int
) -> None:
    ranges = np.full(360, 3.0)
    bearings, lengths = from_centre(ranges, ANGLES, Pose3(x, y, 0.2, yaw=yaw), 80.0)
    angle = ANGLES[beam] + yaw
    seen = (x + 3 * math.cos(angle), y + 3 * math.sin(angle))
    result = lengths[beam] * np.array(
        [math.cos(bearings[beam]), math.sin(bearings[beam])]
    )
    assert result == pytest.approx(seen, abs=1e-9)
    assert np.all((bearings >= -math.pi) & (bearings < math.pi))


def test_beam_without_return_is_infinite_and_keeps_its_bearing() -> None:
    ranges = np.array([80.0, 79.0, 85.0])
    angles = np.array([-math.pi, 0.0, 1.0])
    bearings, lengths = from_centre(ranges, angles, Pose3(0.2, 0, 0.2), 80.0)
    assert lengths.tolist() == [math.inf, pytest.approx(79.2), math.inf]
    assert bearings == pytest.approx([-math.pi, 0, 1.0], abs=1e-3)


def test_points_are_beam_ends_in_the_map_frame() -> None:
    observation = Observation(
        0.0,
        Pose2(1.0, 2.0, math.pi / 2),
        np.array([0.0, 1.0]),
        np.array([3.0, math.inf]),
    )
    assert observation.points() == pytest.approx(np.array([[1.0, 5.0]]))


TIMES = st.floats(0.0, 1e4).map(lambda time: round(time, 2))


@given(st.lists(TIMES, min_size=1, unique=True), st.lists(TIMES, min_size=1))
def test_advancing_time_stamps_are_the_times(
    stamps: list[float], clock: list[float]
) -> None:
    readings = iter(sorted(clock * len(stamps)))
    times = ScanClock(lambda: next(readings))
    result = [times.time_of(stamp) for stamp in sorted(stamps)]
    assert result == sorted(stamps)


@given(st.lists(TIMES, min_size=1), st.sampled_from([0.0, 7.5, math.nan]))
def test_clock_counts_where_time_stamps_stand_still_or_are_missing(
    clock: list[float], stamp: float
) -> None:
    readings = iter(sorted(clock))
    times = ScanClock(lambda: next(readings))
    result = [times.time_of(stamp) for _ in clock]
    passed = [time - result[0] for time in result]
    assert all(
        math.isclose(one, reading - min(clock), abs_tol=1e-6)
        for one, reading in zip(passed, sorted(clock), strict=True)
    )


@given(st.lists(st.one_of(TIMES, st.just(math.nan)), min_size=2), st.data())
def test_times_never_go_back(stamps: list[float], data: st.DataObject) -> None:
    count = len(stamps)
    clock = data.draw(st.lists(TIMES, min_size=count, max_size=count))
    readings = iter(sorted(clock))
    times = ScanClock(lambda: next(readings))
    result = [times.time_of(stamp) for stamp in stamps]
    assert all(math.isfinite(time) for time in result)
    assert all(one <= two for one, two in pairwise(result))
