"""Times that go on, whatever a server stamps."""

import math
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from radarsim.navigation.observation import ScanClock

TIMES = st.floats(0.0, 1e4).map(lambda time: round(time, 2))


@given(st.lists(TIMES, min_size=1, unique=True), st.lists(TIMES, min_size=1))
def test_stamps_that_advance_are_the_times(
    stamps: list[float], clock: list[float]
) -> None:
    readings = iter(sorted(clock * len(stamps)))
    times = ScanClock(lambda: next(readings))
    told = [times.time_of(stamp) for stamp in sorted(stamps)]
    assert told == sorted(stamps)


@given(st.lists(TIMES, min_size=1), st.sampled_from([0.0, 7.5, math.nan]))
def test_where_they_stand_still_or_are_missing_the_clock_counts(
    clock: list[float], stamp: float
) -> None:
    readings = iter(sorted(clock))
    times = ScanClock(lambda: next(readings))
    told = [times.time_of(stamp) for _ in clock]
    passed = [time - told[0] for time in told]
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
    told = [times.time_of(stamp) for stamp in stamps]
    assert all(math.isfinite(time) for time in told)
    assert all(one <= two for one, two in pairwise(told))
