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


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        pytest.param(
            {"directions": np.zeros((2, 3))},
            "RaySource.directions is an array float64[2, 3],"
            " expected an array f8[o,3] where o = 3",
            id="too few directions",
        ),
        pytest.param(
            {"origins": np.zeros((2, 3)), "directions": np.zeros((2, 3))},
            "trace_rays was called with lengths or indices that do not belong together",
            id="too few origins",
        ),
    ],
)
def test_invalid_columns_are_rejected(changed: dict[str, Any], text: str) -> None:
    with pytest.raises(EngineError) as caught:
        TRACER.trace(rays(**changed))
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("column", "place", "number"),
    [
        pytest.param("origins", (1, 2), math.nan, id="nan origin"),
        pytest.param("directions", (1, 0), math.inf, id="infinite direction"),
        pytest.param("directions", (1, 1), 1.0, id="long direction"),
        pytest.param("max_range", 1, -1.0, id="negative reach"),
        pytest.param("max_range", 1, math.inf, id="infinite reach"),
        pytest.param("power", 1, math.nan, id="nan power"),
        pytest.param("class_index", 1, 2, id="third medium"),
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
