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


def test_one_object_is_its_only_copy() -> None:
    (copy,) = place_copies(entry(position=[1, 2, 3]))
    assert (copy.name, copy.position.tolist(), copy.scale) == ("bush", [1, 2, 3], 1)
    assert list(copy_names("bush", None)) == ["bush"]


def test_repeated_objects_are_along_a_line() -> None:
    repeat = {"count": 3, "step": [0, 2, 0.5]}
    copies = place_copies(entry(position=[1, 0, 0], repeat=repeat))
    assert [copy.name for copy in copies] == ["bush_1", "bush_2", "bush_3"]
    places = [copy.position.tolist() for copy in copies]
    assert places == [[1, 0, 0], [1, 2, 0.5], [1, 4, 1]]


@given(st.integers(0, 2**64), st.integers(1, 50))
def test_scattered_objects_are_in_their_area(seed: int, count: int) -> None:
    copies = place_copies(scatter(seed=seed, count=count, scale=[0.5, 2]))
    places = np.array([copy.position for copy in copies])
    assert [copy.name for copy in copies] == list(copy_names("bush", count))
    assert (places >= [-5, 1, 0.6]).all()
    assert (places <= [5, 3, 0.6]).all()
    assert all(0.5 <= copy.scale <= 2 for copy in copies)


def places(copies: ObjectEntry) -> list[tuple[float, ...]]:
    return [(*copy.position, copy.scale) for copy in place_copies(copies)]


def test_same_seed_gives_the_same_positions_and_another_one_others() -> None:
    assert places(scatter()) == places(scatter())
    assert not set(places(scatter())) & set(places(scatter(seed=2)))


def test_larger_count_does_not_move_the_first_copies() -> None:
    few = places(scatter(min_distance=0.3, scale=[1, 2]))
    assert places(scatter(min_distance=0.3, scale=[1, 2], count=30))[:20] == few


def test_scattered_objects_have_at_least_the_minimum_distance() -> None:
    spots = np.array(places(scatter(min_distance=0.7)))[:, :2]
    gaps = np.linalg.norm(spots[:, None] - spots[None], axis=2)
    assert (gaps[~np.eye(20, dtype=bool)] >= 0.7).all()


def test_full_area_is_an_error() -> None:
    with pytest.raises(BuildError, match=r"after \d copies, expected 20"):
        place_copies(scatter(min_distance=3))
