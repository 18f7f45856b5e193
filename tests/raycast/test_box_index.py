"""Rays meet the same boxes, whether these are tried one by one or found by sector."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.nearest_box import nearest_box

from radarsim.geometry import Floats
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer

TRACER = Tracer([])


def expected(rays: Rays, boxes: Boxes) -> tuple[list[float], list[int]]:
    table = boxes.table(np.zeros(3))
    found = [
        nearest_box(table, int(carrier), origin, direction, reach)
        for carrier, origin, direction, reach in zip(
            *(rays.carrier_id, rays.origins, rays.directions, rays.max_range),
            strict=True,
        )
    ]
    return [t if part >= 0 else np.inf for t, part in found], [p for _, p in found]


def assert_equal(rays: Rays, boxes: Boxes) -> None:
    traces = TRACER.trace(rays, boxes)
    assert (traces.ranges.tolist(), traces.parts.tolist()) == expected(rays, boxes)


def random_boxes(rng: np.random.Generator, count: int, spread: float) -> Boxes:
    """Create boxes in a square of ``spread`` m; some at one place, some very far."""
    rows = np.zeros((count, 8))
    rows[:, :2] = rng.uniform(-spread, spread, (count, 2))
    rows[:, 2] = rng.choice([0.0, np.pi / 2, 0.3, -2.0], count)
    rows[:, 4] = rng.uniform(0.1, 1.0, count)
    rows[:, 5:7] = rng.choice([0.25, 0.31, 2.0], (count, 2))
    rows[:, 7] = rng.permutation(count)
    rows[1::7] = [*rows[0, :7].tolist(), 0]
    rows[1::7, 7] = count + np.arange(len(rows[1::7]))
    rows[2::9, 0] = rng.choice([1e3, 1e9, 1e200], len(rows[2::9]))
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


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32),
    count=st.sampled_from([1, 7, 8, 40, 150]),
    spread=st.sampled_from([0.1, 3.0, 30.0]),
    apart=st.sampled_from([0.0, 0.05, 0.4, 2.0]),
)
def test_nearest_box_is_that_of_all_boxes_in_turn(
    seed: int, count: int, spread: float, apart: float
) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    boxes = random_boxes(rng, count, spread)
    places = rng.uniform(-spread, spread, (3, 3)) * [1.0, 1.0, 0.2]
    places[0, :2] = boxes.rows[0, :2]  # within a box
    places[1, :2] = boxes.rows[-1, :2] + [0.7, 0.0]  # beside one
    places[:, 2] += 0.3
    assert_equal(rays_from(rng, places, apart, 30), boxes)


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
