import math

import numpy as np
import pytest
from parts import Triple

from radarsim.errors import EngineError
from radarsim.raycast.rays import Boxes, Rays
from radarsim.raycast.tracer import Tracer

# x, y, yaw, low, high, half length, half width, number
ROW = [5.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25, 3.0]


@pytest.mark.parametrize(
    ("changed", "origin", "direction", "t"),
    [
        pytest.param({}, (0, 0, 0.5), (1, 0, 0), 4.5, id="front"),
        pytest.param({}, (9, 0, 0.5), (-1, 0, 0), 3.5, id="back"),
        pytest.param({}, (5, 4, 0.5), (0, -1, 0), 3.75, id="side"),
        pytest.param({}, (5, 0, 3), (0, 0, -1), 2.0, id="top"),
        pytest.param({}, (0, 0, 1.5), (1, 0, 0), math.inf, id="above it"),
        pytest.param({}, (0, 0.3, 0.5), (1, 0, 0), math.inf, id="next to it"),
        pytest.param({}, (9, 0, 0.5), (1, 0, 0), math.inf, id="behind the ray"),
        pytest.param({}, (5, 0, 0.5), (1, 0, 0), 0.5, id="from within"),
        pytest.param({}, (0, 0.25, 0.5), (1, 0, 0), 4.5, id="along a face"),
        pytest.param({2: math.pi / 2}, (0, 0, 0.5), (1, 0, 0), 4.75, id="turned"),
    ],
)
def test_box_is_hit_at_its_face(
    changed: dict[int, float], origin: Triple, direction: Triple, t: float
) -> None:
    row = [changed.get(i, number) for i, number in enumerate(ROW)]
    rays = Rays.uniform(np.array([origin]), np.array([direction]), max_range=100.0)
    found = Tracer([]).trace(rays, Boxes(np.array([row])))
    assert found.ranges.tolist() == pytest.approx([t])
    assert found.parts.tolist() == [3 if math.isfinite(t) else -1]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (np.zeros((2, 7)), "boxes of shape (2, 7), expected (n, 8)"),
        (np.zeros(8), "boxes of shape (8,), expected (n, 8)"),
        (
            np.array([ROW, [*ROW[:7], math.nan]]),
            "boxes[1] is [5.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25, nan],"
            " expected finite numbers",
        ),
    ],
    ids=["short rows", "one row", "nan"],
)
def test_invalid_boxes_are_rejected(rows: np.ndarray, text: str) -> None:
    with pytest.raises(EngineError) as caught:
        Boxes(rows)
    assert str(caught.value) == text
