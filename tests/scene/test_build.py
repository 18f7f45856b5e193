from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.scene.build import BuildError, copy_names, place_copies
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
