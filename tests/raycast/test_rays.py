import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from parts import layer, rays_ahead

from radarsim.errors import EngineError
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material

TRACER = Tracer([layer("wall", Material("wall"), 3, 4)])


def rays(**changed: Any) -> Rays:
    """Return three rays ahead, some columns changed."""
    return replace(rays_ahead(3, max_range=9.0, power=1.0), **changed)


@pytest.mark.parametrize("names", [("directions",), ("origins", "directions")])
def test_columns_of_other_lengths_are_rejected(names: tuple[str, ...]) -> None:
    with pytest.raises(EngineError, match=r"float64\[2, 3\]|inconsistent lengths"):
        TRACER.trace(rays(**dict.fromkeys(names, np.zeros((2, 3)))))


@pytest.mark.parametrize(
    ("column", "place", "number"),
    [
        ("origins", (1, 2), math.nan),
        ("directions", (1, 0), math.inf),
        ("directions", (1, 1), 1.0),
        *(("max_range", 1, number) for number in (-1.0, math.inf)),
        ("power", 1, math.nan),
        ("class_index", 1, 2),
    ],
)
def test_invalid_rays_are_named(column: str, place: Any, number: float) -> None:
    wrong = rays()
    getattr(wrong, column)[place] = number
    with pytest.raises(
        EngineError, match=r"^ray 1 from .* class \d of 2: expected fin"
    ):
        TRACER.trace(wrong)


@pytest.mark.parametrize(
    "origins",
    [
        pytest.param(np.zeros((3, 6))[:, ::2], id="every other column"),
        pytest.param(np.zeros((3, 3), order="F"), id="columns first"),
        pytest.param(np.broadcast_to(np.zeros(3), (3, 3)), id="one row thrice"),
    ],
)
def test_columns_may_have_any_memory_layout(origins: np.ndarray) -> None:
    assert TRACER.trace(rays(origins=origins)).ranges.tolist() == [3.0, 3.0, 3.0]


def test_split_undoes_concatenate() -> None:
    one, other = rays(), rays(max_range=np.array([9.0, 2.0, 9.0]))
    apart = TRACER.trace(Rays.concatenate([one, other])).split([3, 3])
    assert [type(piece) for piece in apart] == [Traces, Traces]
    assert [piece.ranges.tolist() for piece in apart] == [[3, 3, 3], [3, math.inf, 3]]
