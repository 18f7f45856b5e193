import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from parts import volume

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces, box, cylinder, octahedron, sphere
from radarsim.scene.topology import connect_faces, is_closed

Mesh = tuple[Floats, Faces]
SIZE = st.floats(1e-3, 1e3)


def plane_distances(mesh: Mesh) -> Floats:
    """Distance of each face's plane from the origin, positive if wound outward."""
    vertices, faces = mesh
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    distances: Floats = np.einsum("ij,ij->i", a, normals)
    distances /= np.linalg.norm(normals, axis=1)
    return distances


SHAPES = [
    pytest.param(lambda: box(1.0, 2.0, 3.0), 8, 12, id="box"),
    pytest.param(lambda: sphere(1.5), 642, 1280, id="sphere"),
    pytest.param(lambda: cylinder(0.1, 2.0), 130, 256, id="cylinder"),
    pytest.param(lambda: octahedron(0.1), 6, 8, id="octahedron"),
]


@pytest.mark.parametrize(("make", "vertices", "faces"), SHAPES)
def test_shapes_are_closed_connected_and_oriented_outward(
    make: Callable[[], Mesh], vertices: int, faces: int
) -> None:
    mesh = make()
    assert mesh[0].shape == (vertices, 3)
    assert mesh[1].shape == (faces, 3)
    assert [array.dtype.name for array in mesh] == ["float64", "int32"]
    assert is_closed(mesh[1])
    assert connect_faces(mesh[1]).components == 1
    assert (plane_distances(mesh) > 0).all()


@given(SIZE, SIZE, SIZE)
def test_box_has_its_volume_and_extents(x: float, y: float, z: float) -> None:
    mesh = box(x, y, z)
    assert volume(*mesh) == pytest.approx(x * y * z)
    assert np.ptp(mesh[0], axis=0) == pytest.approx([x, y, z])
    assert mesh[0].mean(axis=0) == pytest.approx([0, 0, 0])


@given(SIZE)
def test_sphere_is_inscribed_to_half_a_percent(radius: float) -> None:
    mesh = sphere(radius)
    assert np.linalg.norm(mesh[0], axis=1) == pytest.approx(np.full(642, radius))
    assert plane_distances(mesh).min() > (1 - 0.0046) * radius
    assert volume(*mesh) == pytest.approx(4 / 3 * math.pi * radius**3, rel=0.01)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_sphere_is_exact_on_the_axes(axis: int, sign: int) -> None:
    point = np.zeros(3)
    point[axis] = sign * 2.0
    assert np.linalg.norm(sphere(2.0)[0] - point, axis=1).min() < 1e-12


@given(SIZE, SIZE)
def test_cylinder_is_inscribed(radius: float, height: float) -> None:
    vertices, faces = cylinder(radius, height)
    rim = vertices[:128]
    assert np.hypot(rim[:, 0], rim[:, 1]) == pytest.approx(np.full(128, radius))
    assert np.abs(vertices[:, 2]) == pytest.approx(np.full(130, height / 2))
    polygon = 64 / 2 * math.sin(2 * math.pi / 64) * radius**2
    assert volume(vertices, faces) == pytest.approx(polygon * height)


def test_shapes_do_not_share_their_arrays() -> None:
    first = sphere(1.0)
    first[0][:] = 0
    first[1][:] = 0
    assert sphere(1.0)[0].any()
    assert sphere(1.0)[1].any()
