"""The cells of the ray fan that are divided around thin objects."""

import math

import numpy as np
import pytest
from fmcw_scenes import radar

from radarsim.addons.fmcw.ray_fan import cell_edges, plain_fan, refined_fan
from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats, Pose3

SETTINGS = radar().settings
COLUMNS = SETTINGS.azimuths * SETTINGS.rays_across
BEAM = math.radians(SETTINGS.beamwidth_az_deg)
POSE = Pose3(1, 2, 1.5, 0.02, -0.03, 0.7)


def divided(bounds: Floats, first: int = 0, count: int = COLUMNS) -> np.ndarray:
    """Return the numbers of parts in both angles, (2, columns, rows)."""
    across, up = np.ones((2, count, SETTINGS.rays_up), np.int64)
    place = POSE.position()[None], POSE.rotation()
    numbers = cell_edges(SETTINGS), BEAM, first, COLUMNS
    engine.divide_cells(bounds, *place, *numbers, across, up)
    return np.stack([across, up])


def expected(bounds: Floats) -> np.ndarray:
    """Return what ``divided`` should return."""
    found = np.ones((2, COLUMNS, SETTINGS.rays_up), np.int64)
    edges, rows = cell_edges(SETTINGS), np.arange(SETTINGS.rays_up + 1)
    width, added = 2 * math.pi / COLUMNS, 0
    distances = np.linalg.norm(bounds.mean(axis=1) - POSE.position(), axis=1)
    for box in bounds[np.argsort(distances, kind="stable")]:
        corners = np.array([box[each, (0, 1, 2)] for each in np.ndindex(2, 2, 2)])
        seen = (corners - POSE.position()) @ POSE.rotation()
        middle = seen.mean(axis=0)
        # Clockwise angles from the middle; no box is around the antenna.
        sides = np.arctan2(middle[1], middle[0]) - np.arctan2(seen[:, 1], seen[:, 0])
        sides = (sides + math.pi) % (2 * math.pi) - math.pi
        start = sides.min() - np.arctan2(middle[1], middle[0])
        heights = np.arctan2(seen[:, 2], np.hypot(seen[:, 0], seen[:, 1]))
        low, high = np.interp([heights.min(), heights.max()], edges, rows)
        wide, tall = np.ptp(sides) / width, high - low
        if not (min(wide, BEAM / width) * tall < 32 and tall > 0):
            continue
        first, last = math.floor(start / width), math.floor(start / width + wide)
        parts = min(math.ceil(10 / wide), 40), min(math.ceil(8 / tall), 40)
        bottom, top = math.floor(low), math.ceil(high)
        added += (last - first + 1) * (top - bottom) * parts[0] * parts[1]
        if added > 100_000:
            break
        patch = np.ix_(np.arange(first, last + 1) % COLUMNS, np.arange(bottom, top))
        for angle, count in zip(found, parts, strict=True):
            angle[patch] = np.maximum(angle[patch], count)
    return found


def posts(count: int, seed: int) -> Floats:
    """Return the bounding boxes of posts around the antenna."""
    random = np.random.default_rng(seed)
    angle, distance = 2 * math.pi * random.random(count), random.uniform(3, 80, count)
    x, y = POSE.x + distance * np.cos(angle), POSE.y + distance * np.sin(angle)
    feet = np.column_stack([x, y, random.uniform(-1, 2, count)])
    return np.stack([feet, feet + random.uniform(0.05, 2, (count, 3))], axis=1)


@pytest.mark.parametrize("count", [0, 1, 40, 1500])
def test_cells_around_posts_are_divided(count: int) -> None:
    bounds = posts(count, count)
    found = divided(bounds)
    assert (found == expected(bounds)).all()
    assert (found > 1).any() == (count > 0)
    # The parts of the circle have the same cells as the whole.
    for first, columns in ((0, 8), (COLUMNS - 40, 40), (COLUMNS // 2, 1)):
        part = found[:, first : first + columns]
        assert (divided(bounds, first, columns) == part).all()


def test_solid_angles_of_divided_cells_add_up() -> None:
    rows = range(SETTINGS.azimuths)
    place = POSE.position(), POSE.rotation()
    fan = refined_fan(SETTINGS, posts(40, 0), *place, rows)
    plain = plain_fan(SETTINGS)
    assert len(fan.weights) > len(plain.weights)
    assert (np.diff(fan.column) >= 0).all()
    assert fan.weights.sum() == pytest.approx(plain.weights.sum(), rel=0.02)


def test_columns_beyond_the_circle_are_refused() -> None:
    for first in (-1, COLUMNS):
        with pytest.raises(EngineError, match="inconsistent lengths"):
            divided(posts(1, 0), first)
