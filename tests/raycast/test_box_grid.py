"""Rays meet the same boxes, whether these are tried one by one or found by cell."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from oracles.nearest_box import nearest_box

from radarsim.geometry import Floats
from radarsim.raycast.rays import Boxes, Rays
from radarsim.raycast.tracer import Tracer

TRACER = Tracer([])


def expected(rays: Rays, boxes: Boxes) -> tuple[list[float], list[int]]:
    table = boxes.table(np.zeros(3))
    rows = np.array(table.tolist()).reshape(-1, 10)
    found = [
        nearest_box(rows, int(carrier), origin, direction, reach)
        for carrier, origin, direction, reach in zip(
            *(rays.carrier_id, rays.origins, rays.directions, rays.max_range),
            strict=True,
        )
    ]
    return [t if part >= 0 else np.inf for t, part in found], [p for _, p in found]


def assert_equal(rays: Rays, boxes: Boxes) -> None:
    traces = TRACER.trace(rays, boxes)
    assert (traces.ranges.tolist(), traces.parts.tolist()) == expected(rays, boxes)


def random_boxes(
    rng: np.random.Generator, count: int, spread: float, far: float = 0.0
) -> Boxes:
    """Create boxes in a square of ``spread`` m; some of them ``far`` away."""
    rows = np.zeros((count, 8))
    rows[:, :2] = rng.uniform(-spread, spread, (count, 2))
    rows[:, 2] = rng.choice([0.0, np.pi / 2, 0.3, -2.0], count)
    rows[:, 4] = rng.uniform(0.1, 1.0, count)
    rows[:, 5:7] = rng.choice([0.25, 0.31, 2.0], (count, 2))
    rows[:, 7] = rng.permutation(count)
    rows[1::7] = [*rows[0, :7].tolist(), 0]
    rows[1::7, 7] = count + np.arange(len(rows[1::7]))
    rows[2::9, 0] += far
    return Boxes(rows)


def directions(rng: np.random.Generator, count: int) -> Floats:
    """Create directions all around: level, along axes, tilted, and up and down."""
    angles = rng.uniform(-np.pi, np.pi, count)
    angles[::5] = rng.choice([0.0, np.pi / 2, np.pi, -np.pi / 2], len(angles[::5]))
    up = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-1.5, 1.5, count))
    level = np.cos(up)
    rows = np.column_stack([level * np.cos(angles), level * np.sin(angles), np.sin(up)])
    rows[3::11] = [0.0, 0.0, -1.0]
    rows[4::11] = [1e-9, -1e-9, 1.0]
    rows[5::11] = [0.0, 1.0, 0.0]
    return rows


def rays_from(rng: np.random.Generator, places: Floats, spread: float, n: int) -> Rays:
    """Create ``n`` rays around each place, at most ``spread`` m from it."""
    starts = np.repeat(places, n, axis=0)
    starts = starts + rng.uniform(-spread, spread, starts.shape) * [1.0, 1.0, 0.1]
    ways = directions(rng, len(starts))
    rays = Rays.uniform(starts, ways, max_range=30.0)
    rays.carrier_id[:] = np.repeat(rng.integers(-1, 5, len(places)), n)
    rays.max_range[::13] = 0.5
    return rays


def grid_of(boxes: Boxes) -> tuple[Floats, float, NDArray[np.int64]]:
    """Return the lower corner and the cells' size of the grid, m, and its borders."""
    middles, radii = boxes.rows[:, :2], np.hypot(*boxes.rows[:, 5:7].T)[:, None] + 2e-6
    low, high = (middles - radii).min(axis=0), (middles + radii).max(axis=0)
    area, count = np.prod(high - low), len(middles)
    squares = 4.0 * (radii**2).sum()
    size = max(np.sqrt(max(area, squares) / count), (high - low).max() / count)
    return low, float(size), np.arange(int((high - low).max() / size) + 2)


def places_around(rng: np.random.Generator, boxes: Boxes, spread: float) -> Floats:
    """Create places in boxes and near them, on borders of cells, and far outside."""
    places = rng.uniform(-spread, spread, (7, 3)) * [1.0, 1.0, 0.2]
    low, size, borders = grid_of(boxes)
    border = rng.choice(borders, 2)
    places[0, :2] = boxes.rows[0, :2]
    places[1, :2] = boxes.rows[-1, :2] + [0.7, 0.0]
    places[2, :2] = np.clip(low + border * size, -1e12, 1e12)
    places[3, 0] = np.clip(low[0] + border[0] * size, -1e12, 1e12)
    places[4, :2] += [-1.5 * spread, spread]
    places[5, 1] -= 20.0
    places[6, :2] = rng.choice([-1e12, -2e5, -9e4, 9e4, 1e12], 2)
    places[:, 2] += 0.3
    return places


@settings(max_examples=50)
@given(
    seed=st.integers(0, 2**32),
    count=st.sampled_from([1, 7, 8, 40, 150]),
    spread=st.sampled_from([0.0, 0.1, 3.0, 30.0, 1000.0]),
    far=st.sampled_from([0.0, 0.0, 50.0, 9e4, 1e9, 1e200]),
    apart=st.sampled_from([0.0, 0.05, 2.0]),
    reach=st.sampled_from([0.5, 30.0, 1e6, 1e13]),
    shape=st.sampled_from([[1.0, 1.0], [0.0, 1.0], [1.0, 0.01]]),
    largest=st.sampled_from([None, 0.0, 2.0, 50.0]),
)
def test_nearest_box_is_that_of_all_boxes_in_turn(
    *,
    seed: int,
    count: int,
    spread: float,
    far: float,
    apart: float,
    reach: float,
    shape: list[float],
    largest: float | None,
) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    boxes = random_boxes(rng, count, spread, far)
    boxes.rows[:, :2] *= shape
    if largest is not None:
        boxes.rows[:, 5:7] = rng.uniform(0.0, 1.0, (count, 2)) ** 8 * largest
    rays = rays_from(rng, places_around(rng, boxes, spread), apart, 20)
    rays.max_range[:] = reach
    rays.max_range[::13] = 0.0
    # Some straight at a box, from wherever they start.
    goals = boxes.rows[rng.integers(0, count, 20), :3] * [1.0, 1.0, 0.0]
    ahead = np.minimum(goals, 1e9) - rays.origins[-20:]
    rays.directions[-20:] = ahead / np.linalg.norm(ahead, axis=1)[:, None]
    assert_equal(rays, boxes)
    # Ranges are inclusive.
    ranges = TRACER.trace(rays, boxes).ranges
    rays.max_range[:] = np.where(np.isfinite(ranges), ranges, reach)
    assert_equal(rays, boxes)


@pytest.mark.parametrize("slope", [0.0, 5e-324, -1e-310, 1e-200, -1e-150, 1e-9])
@pytest.mark.parametrize("turned", [False, True])
def test_rays_along_the_borders_of_cells_meet_what_is_there(
    slope: float, turned: bool
) -> None:
    rows = np.array([[4.0 * x, 4.0 * y] for x in range(4) for y in range(4)])
    boxes = Boxes(
        np.column_stack([rows, np.zeros((16, 2)), np.ones((16, 3)), range(16)])
    )
    low, size, columns = grid_of(boxes)
    count = len(columns)
    assert count > 4
    borders = low[0] + columns * size
    starts = np.column_stack([borders, np.full(count, -3.0), np.full(count, 0.5)])
    ways = np.tile([slope, 1.0, 0.0], (count, 1))
    if turned:
        starts, ways = starts[:, [1, 0, 2]], ways[:, [1, 0, 2]]
    both = np.vstack([starts, starts + 9 * ways, starts])
    up = np.tile([slope, -slope, 1.0], (count, 1))
    rays = Rays.uniform(both, np.vstack([ways, -ways, up]), max_range=20.0)
    rays.origins[-count:, 1] = borders  # upwards from where borders cross
    assert_equal(Rays.concatenate([rays, rays]), boxes)


@pytest.mark.parametrize("turn", np.linspace(0.0, 2 * np.pi, 33).tolist())
def test_edges_of_boxes_are_found_from_every_side(turn: float) -> None:
    """Rays that just meet the corners of boxes, and rays that just miss them."""
    around = np.linspace(0.0, 2 * np.pi, 25)[:-1] + turn
    rows = np.zeros((24, 8))
    rows[:, 0], rows[:, 1], rows[:, 2] = 5 * np.cos(around), 5 * np.sin(around), around
    rows[:, 4], rows[:, 5], rows[:, 6], rows[:, 7] = 1.0, 0.25, 0.31, np.arange(24)
    corner = np.arctan2(0.31, 4.75)
    angles = (
        around[:, None] + corner * np.array([-1, -1 + 1e-12, 1 - 1e-12, 1])
    ).ravel()
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    rays = Rays.uniform(np.full((len(ways), 3), [0, 0, 0.5]), ways, max_range=9.0)
    assert_equal(rays, Boxes(rows))
    found = TRACER.trace(rays, Boxes(rows)).parts.reshape(24, 4)
    assert found[:, 1].tolist() == found[:, 2].tolist() == list(range(24))
