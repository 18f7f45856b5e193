import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box

WALL = box(1, 9, 9)
TRACER = Tracer([Part("wall", Material("wall"), WALL[0] + [3.5, 0, 0], WALL[1])])


def rays(**changed: Any) -> Rays:
    """Return three rays ahead, some columns changed."""
    ahead = np.tile([1.0, 0, 0], (3, 1))
    return replace(
        Rays.uniform(np.zeros((3, 3)), ahead, max_range=9.0, power=1.0), **changed
    )


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
            {"class_index": np.zeros(3, np.int64)},
            "RaySource.class_index is an array int64[3],"
            " expected an array u1[r] where r = 3",
            id="wide medium",
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
