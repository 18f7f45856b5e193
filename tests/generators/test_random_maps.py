"""Random maps and the raster that judges runs on them."""

import math
from collections import Counter
from dataclasses import replace

import pytest
from random_trials import Expectation, load_random_map, raster_truth

from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.generators.random_maps import (
    FAMILIES,
    Block,
    Disc,
    RandomMap,
    make_random_map,
)
from radarsim.simulation.map_warnings import is_connected


def _gate(width: float, **changed: object) -> RandomMap:
    """Return a closed yard, cut in half by a wall with a gate."""
    half = (8 - width) / 2
    walls = [Block(0, sign * (width + half) / 2, 0.2, half) for sign in (-1, 1)]
    walls += [Block(0, sign * 4, 12, 0.2) for sign in (-1, 1)]
    walls += [Block(sign * 6, 0, 0.2, 8) for sign in (-1, 1)]
    map_ = RandomMap(0, "boxes", tuple(walls), math.inf, (-3.0, 0.0), (3.0, 0.0))
    return replace(map_, **changed)  # type: ignore[arg-type]


def test_same_number_gives_the_same_map_and_families_take_turns() -> None:
    maps = [make_random_map(number) for number in range(14)]
    assert maps == [make_random_map(number) for number in range(14)]
    assert [map_.family for map_ in maps] == [*FAMILIES, *FAMILIES]
    assert maps[0].solids != maps[7].solids


@pytest.mark.parametrize("number", range(7))
def test_map_file_agrees_with_the_raster(number: int) -> None:
    map_ = make_random_map(number)
    scene = load_random_map(map_)
    truth = raster_truth(map_, 0.5, 0.0)
    assert scene.trial is not None
    assert scene.trial.goal == pytest.approx(map_.goal, abs=1e-3)
    path = shortest_path(scene, map_.start, map_.goal, 0.37)
    assert (path is None) == (truth.shortest is None)
    if path is not None and truth.shortest is not None:
        assert truth.shortest == pytest.approx(path[0], rel=0.035, abs=0.1)
    if truth.expectation is Expectation.REACHED:
        assert is_connected(scene, map_.start, map_.goal, 0.65)


@pytest.mark.parametrize(
    ("width", "reach", "expected"),
    [
        (1.6, 0.0, Expectation.REACHED),
        (1.3, 0.0, Expectation.EITHER),
        (1.6, 0.2, Expectation.EITHER),
        (2.0, 0.2, Expectation.REACHED),
        (0.6, 0.0, Expectation.EITHER),
        (0.4, 0.0, Expectation.NO_PATH),
    ],
)
def test_expectation_depends_on_the_width_of_the_gate(
    width: float, reach: float, expected: Expectation
) -> None:
    assert raster_truth(_gate(width), 0.5, reach).expectation is expected


def test_start_or_goal_at_a_wall_is_too_near() -> None:
    for changed in ({"start": (-5.5, 0.0)}, {"goal": (3.0, 3.5)}):
        truth = raster_truth(_gate(2.0, **changed), 0.5, 0.0)
        assert truth.expectation is Expectation.TOO_NEAR


def test_path_around_a_disc_is_as_long_as_tangents_and_arc() -> None:
    map_ = RandomMap(
        0, "trunks", (Disc(0, 0, 0.63),), math.inf, (-4.0, 0.0), (4.0, 0.0)
    )
    angle = math.acos(1 / 4)
    exact = 2 * math.sqrt(15) + (math.pi - 2 * angle)
    shortest = raster_truth(map_, 0.5, 0.0).shortest
    assert shortest == pytest.approx(exact, rel=0.03)


def test_first_maps_have_all_expectations_that_matter() -> None:
    counts = Counter(
        raster_truth(make_random_map(number), 0.5, 0.0).expectation
        for number in range(14)
    )
    assert counts[Expectation.REACHED] >= 7
    assert counts[Expectation.NO_PATH] >= 1
