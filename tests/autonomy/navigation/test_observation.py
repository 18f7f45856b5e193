import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.navigation.observation import Observation, ScanClock
from radarsim.geometry import Pose2


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
