import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.autonomy.mapping.occupancy_grid import distance_field
from radarsim.geometry import Floats
from radarsim.rng import generator_for


def expected_distances(cells: NDArray[np.bool_], reach: float) -> Floats:
    rows, columns = np.nonzero(cells)
    found = np.full(cells.shape, np.inf)
    for i, j in np.ndindex(*cells.shape):
        apart = np.hypot(rows - i, columns - j)
        found[i, j] = apart[apart <= reach].min(initial=np.inf)
    return found


@given(
    seed=st.integers(0, 10**6),
    share=st.sampled_from([0.0, 0.01, 0.1, 0.9]),
    reach=st.floats(0, 15),
    shape=st.tuples(st.integers(1, 25), st.integers(1, 25)),
)
def test_distance_field_holds_distances_to_the_nearest_cell(
    seed: int, share: float, reach: float, shape: tuple[int, int]
) -> None:
    cells = generator_for(seed, "cells").random(shape) < share
    assert distance_field(cells, reach) == pytest.approx(
        expected_distances(cells, reach)
    )


def test_all_distances_are_infinite_without_true_cells() -> None:
    assert distance_field(np.zeros((0, 0), np.bool_), 3.0).shape == (0, 0)
