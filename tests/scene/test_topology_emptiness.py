import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces, box, cylinder, sphere
from radarsim.scene.topology import count_empty, is_closed, weld_vertices

Mesh = tuple[Floats, Faces]
QUAD = (
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)


def stack(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(faces).astype(np.int32)


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    return mesh[0] + [x, y, z], mesh[1]


def back(mesh: Mesh) -> Mesh:
    return mesh[0], np.ascontiguousarray(mesh[1][:, ::-1])


def both(mesh: Mesh) -> Mesh:
    return stack(mesh, back(mesh))


def mirrored(mesh: Mesh) -> Mesh:
    """Mirror it on the plane x = -0.5, so that the diagonals of boxes meet there."""
    vertices = mesh[0] * [-1, 1, 1] - [1, 0, 0]
    return vertices, np.ascontiguousarray(mesh[1][:, ::-1])


CUBE = box(1, 1, 1)


@pytest.mark.parametrize(
    "mesh",
    [
        pytest.param(CUBE, id="box"),
        pytest.param(sphere(0.01), id="sphere"),
        pytest.param(cylinder(0.0005, 100), id="wire"),
        pytest.param(box(1000, 1000, 0.001), id="plate"),
        pytest.param(moved(box(0.01, 0.01, 0.0001), 999, 999), id="leaf far away"),
        pytest.param(stack(box(3, 3, 3), back(CUBE)), id="cavity"),
        pytest.param(stack(CUBE, CUBE), id="the same twice"),
        pytest.param(stack(CUBE, mirrored(CUBE)), id="common wall"),
        pytest.param(stack(CUBE, moved(CUBE, 1)), id="wall with other diagonals"),
        pytest.param(stack(CUBE, moved(CUBE, 1, 1)), id="common edge"),
        pytest.param(stack(box(3, 3, 3), both(CUBE)), id="walls inside"),
        pytest.param(stack(CUBE, CUBE, back(CUBE)), id="one way once more"),
        pytest.param((np.zeros((0, 3)), np.zeros((0, 3), np.int32)), id="nothing"),
    ],
)
def test_what_encloses_a_volume_is_not_empty(mesh: Mesh) -> None:
    assert count_empty(*weld_vertices(*mesh)) == (0, 0)


@pytest.mark.parametrize(
    ("mesh", "twice", "flat"),
    [
        pytest.param(both(QUAD), 2, 0, id="leaf"),
        pytest.param(both(sphere(1)), 1280, 0, id="sphere"),
        pytest.param(stack(both(QUAD), both(QUAD)), 4, 0, id="leaf of four sides"),
        pytest.param(stack(moved(CUBE, 5), both(CUBE)), 12, 0, id="beside a volume"),
        pytest.param(
            stack(CUBE, both(moved(QUAD, 0.5, -0.5, 0.5))), 2, 0, id="overhang"
        ),
        pytest.param(
            stack(box(3, 3, 3), back(box(2, 2, 2)), both(CUBE)), 12, 0, id="in a cavity"
        ),
        pytest.param(
            stack(QUAD, back((QUAD[0][[1, 2, 3, 0]], QUAD[1]))),
            0,
            4,
            id="the back has other diagonals",
        ),
        pytest.param(
            (sphere(1)[0] * [1, 1, 1e-12], sphere(1)[1]), 0, 1280, id="nearly flat"
        ),
    ],
)
def test_sheets_are_empty(mesh: Mesh, twice: int, flat: int) -> None:
    vertices, faces = weld_vertices(*mesh)
    assert is_closed(faces)
    assert count_empty(vertices, faces) == (twice, flat)


@given(st.permutations(range(20)), st.integers(0, 2))
def test_the_order_of_faces_and_corners_does_not_matter(
    order: list[int], shift: int
) -> None:
    vertices, faces = weld_vertices(*stack(both(QUAD), both(moved(QUAD, 9)), CUBE))
    shuffled = np.ascontiguousarray(np.roll(faces[order], shift, axis=1))
    assert count_empty(vertices, shuffled) == (4, 0)
