import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.crossings import (
    AXES_SIZE,
    LINE_SIZE,
    cross_triangle,
    project_line,
)
from radarsim.scene import shapes

UNIT = st.floats(-1, 1).map(lambda x: round(x, 3))
POINTS = st.tuples(UNIT, UNIT, UNIT).map(np.array)
# Few places, so that lines often go through corners, edges and along faces.
GRID = st.tuples(*[st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0])] * 3).map(np.array)


def crossings(
    corners: Floats, origin: Floats, ray_direction: Floats
) -> list[tuple[int, float]]:
    """Cross all triangles, (F, 9); give the turns and distances of those crossed."""
    line, axes = np.zeros(LINE_SIZE), np.zeros(AXES_SIZE, np.uint64)
    project_line(
        np.asarray(origin, float),
        ray_direction / np.linalg.norm(ray_direction),
        line,
        axes,
    )
    found = (cross_triangle(line, axes, row) for row in corners)
    return [(turn, t) for turn, t in found if turn]


def triangles(solid: tuple[Floats, NDArray[np.int32]]) -> Floats:
    vertices, faces = solid
    corners: Floats = vertices[faces].reshape(-1, 9)
    return corners


BRICK = triangles(shapes.box(1, 1, 1))
BALL = triangles(shapes._icosahedron())


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_line_enters_by_the_front_and_leaves_by_the_back(
    axis: int, sign: float
) -> None:
    ray_direction = np.zeros(3)
    ray_direction[axis] = sign
    beside = np.roll([0.0, 0.1, 0.2], axis)
    found = crossings(BRICK, beside - 3 * ray_direction, ray_direction)
    assert sorted(t for _, t in found) == pytest.approx([2.5, 3.5])
    assert [turn for turn, _ in sorted(found, key=lambda f: f[1])] == [1, -1]


def test_crossings_behind_the_origin_have_negative_distances() -> None:
    found = crossings(BRICK, np.array([0, 0.1, 0.2]), np.array([1.0, 0, 0]))
    assert sorted(found) == [pytest.approx((-1, 0.5)), pytest.approx((1, -0.5))]


def test_line_in_the_plane_of_a_triangle_does_not_cross_it() -> None:
    face = np.array([[0.0, 0, 0, 1, 0, 0, 0, 1, 0]])
    assert crossings(face, np.array([-1, 0.25, 0]), np.array([1.0, 0, 0])) == []


@pytest.mark.parametrize("corners", [BRICK, BALL], ids=["brick", "ball"])
@settings(deadline=None)  # the first call compiles
@given(origin=GRID, end=GRID)
def test_closed_surface_is_entered_as_often_as_left_along_any_line(
    corners: Floats, origin: Floats, end: Floats
) -> None:
    assume(np.any(origin != end))
    assert sum(turn for turn, _ in crossings(corners, origin, end - origin)) == 0


@settings(deadline=None)  # the first call compiles
@given(origin=POINTS, end=POINTS, by=POINTS, scale=st.sampled_from([1.0, 1 / 3, 500.0]))
def test_lines_through_corners_enter_as_often_as_they_leave(
    origin: Floats, end: Floats, by: Floats, scale: float
) -> None:
    moved = BALL * scale + np.tile(by, 3) * 400
    corner = moved[5, :3]
    start = corner + (origin - end) * scale
    assume(np.linalg.norm(corner - start) > 1e-3 * scale)
    assert sum(turn for turn, _ in crossings(moved, start, corner - start)) == 0


@pytest.mark.parametrize("ray_direction", list(itertools.product([-1, 0, 1], repeat=3)))
def test_line_through_the_edges_and_corners_of_a_fan_crosses_it_once(
    ray_direction: tuple[int, int, int],
) -> None:
    direction = np.array(ray_direction, float)
    if not direction.any():
        return
    # From the middle every such line meets a corner, an edge or a diagonal.
    ahead = [t for _, t in crossings(BRICK, np.zeros(3), direction) if t >= 0]
    assert ahead == [pytest.approx(0.5 * np.linalg.norm(direction))]


@settings(deadline=None)  # the first call compiles
@given(st.lists(POINTS, min_size=3, max_size=3), POINTS, POINTS)
def test_crossing_is_within_the_triangle(
    points: list[Floats], origin: Floats, end: Floats
) -> None:
    assume(np.linalg.norm(end - origin) > 1e-3)
    ray_direction = (end - origin) / np.linalg.norm(end - origin)
    along = [float((p - origin) @ ray_direction) for p in points]
    for _, t in crossings(np.concatenate(points)[None], origin, ray_direction):
        assert min(along) - 1e-9 <= t <= max(along) + 1e-9


def test_triangle_without_area_is_never_crossed() -> None:
    for corners in ([0.0] * 9, [0.0, 0, 0, 1, 1, 1, 2, 2, 2], [1.0, 0, 0] * 3):
        for ray_direction in ([1.0, 0, 0], [1.0, 1, 1], [0.0, 0, -1]):
            assert (
                crossings(np.array([corners]), np.zeros(3), np.array(ray_direction))
                == []
            )


def test_python_and_machine_code_agree() -> None:
    rng = np.random.Generator(np.random.PCG64(3))
    compiled: list[Any] = [project_line, cross_triangle]
    plain_aim, plain_cross = (function.py_func for function in compiled)
    for _ in range(50):
        ray_direction = rng.normal(size=3)
        ray_direction /= np.linalg.norm(ray_direction)
        corners = rng.normal(size=9)
        line, axes = np.zeros(LINE_SIZE), np.zeros(AXES_SIZE, np.uint64)
        project_line(np.zeros(3), ray_direction, line, axes)
        other, other_axes = np.zeros(LINE_SIZE), np.zeros(AXES_SIZE, np.uint64)
        plain_aim(np.zeros(3), ray_direction, other, other_axes)
        assert line.tolist() == other.tolist()
        assert plain_cross(line, axes, corners) == cross_triangle(line, axes, corners)
        assert math.isfinite(cross_triangle(line, axes, corners)[1])
