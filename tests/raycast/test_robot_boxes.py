import math

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.raycast.rays import Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer

# x, y, yaw, low, high, half length, half width, number
ROW = [5.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25, 3.0]


def first_hit(
    row: list[float],
    origin: tuple[float, float, float],
    ray_direction: tuple[float, float, float],
) -> tuple[float, int]:
    rays = Rays.uniform(
        np.array([origin], float), np.array([ray_direction], float), max_range=100.0
    )
    found = Tracer([]).trace(rays, Boxes(np.array([row])))
    return float(found.ranges[0]), int(found.parts[0])


@pytest.mark.parametrize(
    ("row", "origin", "ray_direction", "expected"),
    [
        pytest.param(ROW, (0, 0, 0.5), (1, 0, 0), (4.5, 3), id="front"),
        pytest.param(ROW, (9, 0, 0.5), (-1, 0, 0), (3.5, 3), id="back"),
        pytest.param(ROW, (5, 4, 0.5), (0, -1, 0), (3.75, 3), id="side"),
        pytest.param(ROW, (5, 0, 3), (0, 0, -1), (2.0, 3), id="top"),
        pytest.param(ROW, (0, 0, 1.5), (1, 0, 0), (math.inf, -1), id="above it"),
        pytest.param(ROW, (0, 0.3, 0.5), (1, 0, 0), (math.inf, -1), id="beside it"),
        pytest.param(ROW, (9, 0, 0.5), (1, 0, 0), (math.inf, -1), id="behind the ray"),
        pytest.param(ROW, (5, 0, 0.5), (1, 0, 0), (0.5, 3), id="from within"),
        pytest.param(ROW, (0, 0.25, 0.5), (1, 0, 0), (4.5, 3), id="along a face"),
        pytest.param(
            [*ROW[:2], math.pi / 2, *ROW[3:]],
            (0, 0, 0.5),
            (1, 0, 0),
            (4.75, 3),
            id="turned",
        ),
        pytest.param(
            [*ROW[:2], math.pi / 4, 0, 1, 0.5, 0.5, 3.0],
            (0, 0, 0.5),
            (1, 0, 0),
            (5 - math.sqrt(0.5), 3),
            id="corner first",
        ),
    ],
)
def test_box_is_hit_at_its_face(
    row: list[float],
    origin: tuple[float, float, float],
    ray_direction: tuple[float, float, float],
    expected: tuple[float, int],
) -> None:
    assert first_hit(row, origin, ray_direction) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        pytest.param(
            np.zeros((2, 7)), "boxes of shape (2, 7), expected (n, 8)", id="short rows"
        ),
        pytest.param(np.zeros(8), "boxes of shape (8,), expected (n, 8)", id="one row"),
        pytest.param(
            np.array([ROW, [*ROW[:7], math.nan]]),
            "boxes[1] is [5.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25, nan],"
            " expected finite numbers",
            id="nan",
        ),
    ],
)
def test_invalid_boxes_are_rejected(rows: np.ndarray, text: str) -> None:
    with pytest.raises(EngineError) as caught:
        Boxes(rows)
    assert str(caught.value) == text
