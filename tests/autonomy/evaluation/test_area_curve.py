"""Known area over time: samples, and when shares of the floor were known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.evaluation.map_score import FloorPart
from radarsim.autonomy.evaluation.mapping_run import MOST_SAMPLES, AreaCurve
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.navigation.runner import TripMeter


class GrowingGrid(OccupancyGrid):
    """A grid with a given number of sensed cells."""

    def __init__(self) -> None:
        super().__init__(0.1)
        self.count = 0

    def sensed_cells(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        return np.ones((1, self.count), np.bool_)


class KnownFloor(FloorPart):
    """Floor of 1000 cells."""

    def __init__(self) -> None:
        pass

    def coverage(self, grid: OccupancyGrid) -> float:
        return float(grid.sensed_cells().sum()) / 1000


def curve_of(counts: list[int], *, step: float = 0.1) -> AreaCurve:
    curve, grid, trip = AreaCurve(), GrowingGrid(), TripMeter()
    curve.floor = KnownFloor()
    for k, grid.count in enumerate(counts):
        trip.time, trip.length = k * step, 0.5 * k * step
        curve.add(trip, grid)
    curve.add(trip, grid, last=True)
    return curve


@given(st.lists(st.integers(0, 9), min_size=1, max_size=300), st.sampled_from([0.1, 3]))
def test_samples_are_few_and_in_order_and_end_with_the_last(
    gains: list[int], step: float
) -> None:
    counts = np.cumsum(gains).tolist()
    curve = curve_of(counts, step=step)
    times = [sample.time for sample in curve.samples]
    assert times == sorted(set(times))
    assert len(times) <= MOST_SAMPLES
    assert curve.samples[0].area == pytest.approx(counts[0] * 0.01)
    assert curve.samples[-1].area == pytest.approx(counts[-1] * 0.01)


def test_long_runs_are_sampled_less_often_but_shares_are_exact_to_a_second() -> None:
    curve = curve_of([k // 2 for k in range(2001)], step=1.0)
    assert MOST_SAMPLES / 2 <= len(curve.samples) <= MOST_SAMPLES
    assert curve.reached == {
        "0.5": {"time": 1000.0, "path_length": 500.0},
        "0.9": {"time": 1800.0, "path_length": 900.0},
        "0.99": {"time": 1980.0, "path_length": 990.0},
    }
    assert curve.to_dict()["reachable_coverage"][0] == 0


def test_without_a_scene_nothing_is_reported_of_the_floor() -> None:
    curve, grid, trip = AreaCurve(), GrowingGrid(), TripMeter()
    curve.add(trip, grid)
    assert set(curve.to_dict()) == {"time", "path_length", "area"}
    assert math.isnan(curve.samples[0].reachable)
    assert curve.reached == {"0.5": None, "0.9": None, "0.99": None}
