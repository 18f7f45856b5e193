import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.rng import generator_for
from radarsim.scene.build import MAX_ATTEMPTS, BuildError, copy_names, place_copies
from radarsim.scene.map_schema import ObjectEntry


def entry(**keys: Any) -> ObjectEntry:
    given = {"name": "bush", "sphere": 1.0, "material": "leaf", **keys}
    context = {"materials": ["leaf"], "folder": Path()}
    return ObjectEntry.model_validate(given, context=context)


def scatter(**keys: Any) -> ObjectEntry:
    given = {"count": 20, "area": [[-5, 1], [5, 3]], "seed": 1, **keys}
    return entry(position=[0, 0, 0.6], scatter=given)


@given(st.integers(0, 2**64), st.integers(1, 50))
def test_scattered_objects_are_in_their_area(seed: int, count: int) -> None:
    copies = place_copies(scatter(seed=seed, count=count, scale=[0.5, 2]))
    places = np.array([position for _, position, _ in copies])
    assert [name for name, *_ in copies] == list(copy_names("bush", count))
    assert (places >= [-5, 1, 0.6]).all()
    assert (places <= [5, 3, 0.6]).all()
    assert all(0.5 <= scale <= 2 for *_, scale in copies)


def places(copies: ObjectEntry) -> list[tuple[float, ...]]:
    return [(*position, scale) for _, position, scale in place_copies(copies)]


def test_same_seed_gives_the_same_positions_and_another_one_others() -> None:
    assert places(scatter()) == places(scatter())
    assert not set(places(scatter())) & set(places(scatter(seed=2)))


def test_larger_count_does_not_move_the_first_copies() -> None:
    few = places(scatter(min_distance=0.3, scale=[1, 2]))
    assert places(scatter(min_distance=0.3, scale=[1, 2], count=30))[:20] == few


def test_full_area_is_an_error() -> None:
    with pytest.raises(BuildError, match=r"after \d copies, expected 20"):
        place_copies(scatter(min_distance=3))


def crowd(count: int, min_distance: float, half: float) -> ObjectEntry:
    """Return objects in a square, of all sizes."""
    area = [[-half, -half], [half, half]]
    more = {"scale": [0.5, 2], "min_distance": min_distance}
    return scatter(count=count, area=area, seed=5, **more)


@pytest.mark.parametrize(
    ("count", "min_distance", "half"),
    [
        pytest.param(200, 0.0, 5.0, id="anywhere"),
        pytest.param(200, 1.0, 10.0, id="apart"),
        pytest.param(60, 3.0, 14.0, id="dense"),
        pytest.param(50, 1e-9, 5.0, id="hardly apart"),
        pytest.param(60, 3e-6, 1.4e-5, id="dense, in a tiny area"),
        pytest.param(50, 1e-300, 1e-9, id="hardly apart, in a tiny area"),
    ],
)
def test_places_are_those_of_comparing_all_pairs(
    count: int, min_distance: float, half: float
) -> None:
    rng = generator_for(5, "scatter", "bush")
    expected = np.full((count, 2), np.inf)
    scales = []
    for number in range(count):
        for _ in range(MAX_ATTEMPTS):
            position = rng.uniform(np.full(2, -half), np.full(2, half))
            distances = np.linalg.norm(expected[:number] - position, axis=1)
            if distances.min(initial=np.inf) >= min_distance:
                break
        expected[number] = position
        scales.append(rng.uniform(0.5, 2))
    copies = place_copies(crowd(count, min_distance, half))
    assert [place[:2].tolist() for _, place, _ in copies] == expected.tolist()
    assert [scale for *_, scale in copies] == scales


def test_tiny_area_takes_as_long_as_a_large_one() -> None:
    def duration(scale: float) -> float:
        copies = crowd(3000, 1e-3 * scale, scale)
        start = time.process_time()
        place_copies(copies)
        return time.process_time() - start

    large = min(duration(100.0) for _ in range(3))
    assert min(duration(1e-4) for _ in range(3)) < 10 * large  # 1000 times if it fails
