import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from local_shapes import shape_around

from radarsim.autonomy.mapping.scan_matching import PointMap
from radarsim.geometry import Floats
from radarsim.rng import generator_for

FINEST, LEVELS = 0.1, 5  # m; sizes of cells
MIN_WEIGHT = 2.0
places = st.floats(-20, 20)


def map_of(*parts: Floats) -> PointMap:
    points = PointMap()
    for part in parts:
        points.add(part)
    return points


def along_a_line(angle: float, spacing: float) -> Floats:
    """Return points on a line through the origin, 6 m both ways."""
    return np.outer(np.arange(-6, 6, spacing), [math.cos(angle), math.sin(angle)])


def bump(x: float) -> float:
    """Return the quadratic B-spline."""
    if abs(x) <= 0.5:
        return 0.75 - x * x
    return 0.5 * max(1.5 - abs(x), 0.0) ** 2


def expected_shape(points: Floats, x: float, y: float) -> tuple[float, ...] | None:
    """Compute the shape by its definition, point by point."""
    for level in range(LEVELS):
        size = FINEST * 2**level
        cell_centers = (np.floor(points / size) + 0.5) * size
        steps = (cell_centers - (x, y)) / size
        weights = np.array([bump(dx) * bump(dy) for dx, dy in steps])
        # Which window counts must not depend on the order of a sum.
        assume(abs(weights.sum() - MIN_WEIGHT) > 1e-9)
        if weights.sum() >= MIN_WEIGHT:
            share = weights / weights.sum()
            mean = share @ points
            off = points - mean
            spread = (off * share[:, None]).T @ off
            return (*(mean - (x, y)), spread[0, 0], spread[0, 1], spread[1, 1])
    return None


def test_empty_map_has_no_shapes() -> None:
    assert len(PointMap()) == 0
    assert not shape_around(PointMap().table, 0.0, 0.0).found


@given(seed=st.integers(0, 10**6), x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_shapes_match_the_definition(seed: int, x: float, y: float) -> None:
    points = generator_for(seed, "points").uniform(-3, 3, (200, 2))
    found, *shape = shape_around(map_of(points).table, x, y)
    expected = expected_shape(points, x, y)
    assert found == (expected is not None)
    if expected is not None:
        assert shape == pytest.approx(list(expected), abs=1e-9)


@given(angle=st.floats(-1.5, 1.5), spacing=st.floats(0.02, 0.3))
def test_line_is_found_at_its_position(angle: float, spacing: float) -> None:
    table = map_of(along_a_line(angle, spacing)).table
    nx, ny = -math.sin(angle), math.cos(angle)
    found, a, b, xx, xy, yy = shape_around(table, 0.03 * nx, 0.03 * ny)
    assert found
    assert a * nx + b * ny == pytest.approx(-0.03, abs=1e-9)
    across = nx * nx * xx + 2 * nx * ny * xy + ny * ny * yy
    assert across == pytest.approx(0.0, abs=1e-9)


def test_window_is_smaller_for_dense_points_than_for_sparse_ones() -> None:
    def length(spacing: float) -> float:
        shape = shape_around(map_of(along_a_line(0.0, spacing)).table, 0.0, 0.0)
        return math.sqrt(shape.xx)

    assert length(0.01) < 0.1
    assert length(0.01) < length(0.1) < length(0.3)


@given(x=places, y=places)
def test_position_far_from_all_points_has_no_shape(x: float, y: float) -> None:
    table = map_of(along_a_line(0.3, 0.05) + 50.0).table
    assert not shape_around(table, x, y).found


@given(seed=st.integers(0, 10**6), cut=st.integers(0, 3000))
def test_points_added_in_parts_give_the_same_map(seed: int, cut: int) -> None:
    points = generator_for(seed, "points").uniform(-9, 9, (3000, 2))
    whole, parts = map_of(points), map_of(points[:cut], points[cut:])
    assert len(whole) == len(parts)
    for x, y in points[:5].tolist():
        one = shape_around(whole.table, x, y)
        other = shape_around(parts.table, x, y)
        assert one == pytest.approx(other, abs=1e-12)
