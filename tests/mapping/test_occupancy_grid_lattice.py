import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import MappingError
from radarsim.mapping.occupancy_grid import GROWTH_STEP, GridFrame

SIZE = 0.05
metres = st.floats(-40, 40)
points = st.tuples(metres, metres)


def holding(*places: tuple[float, float]) -> GridFrame:
    frame = GridFrame(SIZE)
    for place in places:
        frame = frame.extended_to(place, place)
    return frame


@given(places=st.lists(points, min_size=1, max_size=6))
def test_it_holds_all_that_it_has_grown_to(places: list[tuple[float, float]]) -> None:
    frame = holding(*places)
    assert all(frame.cell(x, y) is not None for x, y in places)


@given(places=st.lists(points, min_size=1, max_size=6), place=points)
def test_what_it_holds_already_changes_nothing(
    places: list[tuple[float, float]], place: tuple[float, float]
) -> None:
    frame = holding(*places, place)
    assert frame.extended_to(place, place) == frame


@given(places=st.lists(points, min_size=1, max_size=6), place=points)
def test_a_cell_keeps_its_place_and_what_is_in_it(
    places: list[tuple[float, float]], place: tuple[float, float]
) -> None:
    small = holding(place)
    cells = np.zeros(small.shape, np.int8)
    row, column = small.cell(*place) or (-1, -1)
    cells[row, column] = 7
    large = small
    for other in places:
        large = large.extended_to(other, other)
    moved = small.copy_into(cells, large)
    assert moved[large.cell(*place)] == 7
    assert moved.sum() == 7


@given(place=points)
def test_middles_are_in_their_cells(place: tuple[float, float]) -> None:
    frame = holding(place)
    x, y = frame.cell_centers()
    row, column = frame.cell(*place) or (-1, -1)
    assert abs(x[column] - place[0]) <= SIZE / 2 + 1e-9
    assert abs(y[row] - place[1]) <= SIZE / 2 + 1e-9
    assert frame.origin == pytest.approx((x[0] - SIZE / 2, y[0] - SIZE / 2))


def test_it_grows_by_many_cells_at_once() -> None:
    frame = holding((0.0, 0.0))
    assert frame.shape == (GROWTH_STEP, GROWTH_STEP)
    assert frame.extended_to((-0.01, 0), (0, 0)).shape == (GROWTH_STEP, 2 * GROWTH_STEP)


def test_outside_there_is_no_cell() -> None:
    assert GridFrame(SIZE).cell(0, 0) is None
    assert holding((0.0, 0.0)).cell(-0.01, 0) is None


@pytest.mark.parametrize("far", [1e4, math.inf, math.nan])
def test_a_place_too_far_away_is_an_error(far: float) -> None:
    with pytest.raises((MappingError, ValueError, OverflowError)):
        GridFrame(SIZE).extended_to((0.0, 0.0), (far, 0.0))


def test_an_area_too_large_is_an_error() -> None:
    side = SIZE * 8000
    frame = GridFrame(SIZE).extended_to((0.0, 0.0), (side, side))
    assert frame.shape > (8000, 8000)
    with pytest.raises(MappingError, match=r"in cells of 0\.\d+ m, expected at most"):
        frame.extended_to((-side, 0.0), (0.0, 0.0))
