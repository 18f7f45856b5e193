import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from radarsim.autonomy.navigation.grid_search import flood_fill, shortest_path
from radarsim.geometry import Floats

COSTS = arrays(
    np.float64, (5, 6), elements=st.sampled_from([1.0, 2.0, 5.0, math.inf, math.inf])
)
STARTS = st.tuples(st.integers(0, 4), st.integers(0, 5))


def cheapest(cost: Floats, start: tuple[int, int]) -> Floats:
    """Return the cost of the path to each cell, by relaxing until nothing changes."""
    best = np.full(cost.shape, math.inf)
    best[start] = 0.0
    for _ in range(cost.size):
        padded = np.pad(best, 1, constant_values=math.inf)
        for down in range(3):
            for across in range(3):
                step = math.hypot(down - 1, across - 1)
                if not step:
                    continue
                aside = padded[down : down + 5, across : across + 6]
                best = np.minimum(best, aside + step * cost)
    return best


def length(path: NDArray[np.int64], cost: Floats) -> float:
    steps = np.hypot(*np.diff(path, axis=0).T)
    return float(
        sum(s * cost[tuple(cell)] for s, cell in zip(steps, path[1:], strict=True))
    )


@settings(max_examples=25)
@given(cost=COSTS, start=STARTS, end=STARTS)
def test_path_is_the_cheapest(
    cost: Floats, start: tuple[int, int], end: tuple[int, int]
) -> None:
    targets = np.zeros(cost.shape, np.bool_)
    targets[end] = True
    expected = cheapest(cost, start)[end]
    path = shortest_path(cost, start, targets)
    if math.isinf(expected):
        assert len(path) == 0
        return
    assert tuple(path[0]) == start
    assert tuple(path[-1]) == end
    assert np.abs(np.diff(path, axis=0)).max(initial=0) <= 1
    assert length(path, cost) == pytest.approx(expected)


@settings(max_examples=25)
@given(cost=COSTS, start=STARTS)
def test_path_leads_to_the_nearest_target(cost: Floats, start: tuple[int, int]) -> None:
    targets = np.zeros(cost.shape, np.bool_)
    targets[::2, ::3] = True
    expected = cheapest(cost, start)[targets].min()
    path = shortest_path(cost, start, targets)
    assert (
        length(path, cost) == pytest.approx(expected)
        if len(path)
        else math.isinf(expected)
    )


@settings(max_examples=25)
@given(cost=COSTS, start=STARTS)
def test_flood_fill_is_what_paths_reach(cost: Floats, start: tuple[int, int]) -> None:
    found = flood_fill(np.isfinite(cost), start)
    assert (found == np.isfinite(cheapest(cost, start))).all()
