import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces, Mesh, box, concatenate, cylinder, sphere
from radarsim.scene.topology import (
    Labels,
    connect_faces,
    count_degenerate,
    is_closed,
    orient_outward,
    weld_vertices,
)

QUAD = (
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)
CUBE = box(1, 1, 1)


def count_open_edges(faces: Faces) -> int:
    return connect_faces(faces).open_edges


def label_components(faces: Faces) -> Labels:
    return connect_faces(faces).labels


def stack(*meshes: Mesh) -> Mesh:
    return concatenate(meshes)


def cube(size: float = 1.0, at: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    vertices, faces = box(size, size, size)
    return vertices + at, faces


def inside_out(mesh: Mesh) -> Mesh:
    return mesh[0], np.ascontiguousarray(mesh[1][:, ::-1])


def volume(vertices: Floats, faces: Faces) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def oriented_volume(mesh: Mesh) -> float:
    oriented = orient_outward(*mesh)
    assert oriented is not None
    assert is_closed(oriented[0])
    return volume(mesh[0], oriented[0])


def test_welding_closes_a_soup_of_triangles() -> None:
    vertices, faces = cube()
    soup = vertices[faces].reshape(-1, 3)
    loose = np.arange(36, dtype=np.int32).reshape(-1, 3)
    assert count_open_edges(loose) == 36
    merged, joined = weld_vertices(soup, loose)
    assert (len(merged), len(joined)) == (8, 12)
    assert is_closed(joined)


def test_welding_equates_both_zeros_and_drops_collapsed_faces() -> None:
    vertices = np.array([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 2, 3]], dtype=np.int32)
    merged, joined = weld_vertices(vertices, faces)
    assert (len(merged), len(joined)) == (3, 2)


def test_mesh_without_faces_is_closed_and_has_no_components() -> None:
    nothing = np.zeros((0, 3), dtype=np.int32)
    assert is_closed(nothing)
    assert label_components(nothing).shape == (0,)


def test_missing_face_leaves_three_open_edges() -> None:
    faces = cube()[1][1:]
    assert count_open_edges(faces) == 3
    assert orient_outward(cube()[0], faces) is None


@given(st.permutations(range(24)))
def test_components_do_not_depend_on_the_order_of_faces(order: list[int]) -> None:
    _, faces = stack(cube(), cube(at=(3, 0, 0)))
    labels = label_components(faces[order])
    assert len(set(labels)) == 2
    assert (
        len({(label, place >= 12) for label, place in zip(labels, order, strict=True)})
        == 2
    )


def test_common_edge_connects_but_common_vertex_does_not() -> None:
    by_vertex = weld_vertices(*stack(cube(), cube(at=(1, 1, 1))))[1]
    by_edge = weld_vertices(*stack(cube(), cube(at=(1, 1, 0))))[1]
    assert label_components(by_vertex).max() == 1
    assert label_components(by_edge).max() == 0
    assert is_closed(by_edge)


def test_same_volume_twice_is_closed() -> None:
    assert is_closed(weld_vertices(*stack(cube(), cube()))[1])


def test_long_strip_is_one_component() -> None:
    count = 5000
    here = np.arange(count, dtype=np.int32)
    strip = np.column_stack([here, here + 1, here + 2])
    order = np.random.Generator(np.random.PCG64(1)).permutation(count)
    assert label_components(strip[order].astype(np.int32)).max() == 0


@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_orientation_of_a_closed_surface_is_repaired(flips: list[bool]) -> None:
    vertices, faces = cube()
    mixed = np.where(np.array(flips)[:, None], faces[:, ::-1], faces)
    assert oriented_volume((vertices, mixed)) == pytest.approx(1)


def test_consistent_surface_is_not_changed() -> None:
    mesh = stack(cube(), cube(at=(3, 0, 0)))
    oriented = orient_outward(*mesh)
    assert oriented is not None
    assert oriented[0].tolist() == mesh[1].tolist()


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        pytest.param(inside_out(cube()), 1, id="inside out"),
        pytest.param(stack(cube(), inside_out(cube(at=(3, 0, 0)))), 2, id="one of two"),
        pytest.param(stack(cube(3), inside_out(cube())), 26, id="a cavity"),
        pytest.param(stack(inside_out(cube(3)), cube()), 26, id="cavity, inside out"),
        pytest.param(stack(cube(3), cube()), 28, id="nested volumes add"),
        pytest.param(
            stack(cube(3), inside_out(cube()), inside_out(cube(at=(5, 0, 0)))),
            27,
            id="a cavity and an inverted component",
        ),
        pytest.param(
            stack(sphere(2), inside_out(cube(0.2, (1.5, 1.5, 0)))),
            volume(*sphere(2)) + 0.008,
            id="in the box of another but not in it",
        ),
    ],
)
def test_all_components_except_cavities_are_oriented_outward(
    mesh: Mesh, expected: float
) -> None:
    assert oriented_volume(mesh) == pytest.approx(expected)


def test_surface_with_one_side_cannot_be_oriented() -> None:
    # the projective plane with six vertices: closed, but it has no inside
    faces = [
        *([0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1]),
        *([1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3]),
    ]
    angles = np.arange(6.0)
    vertices = np.column_stack([np.cos(angles), np.sin(angles), angles**2])
    assert orient_outward(vertices, np.array(faces, dtype=np.int32)) is None


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    return mesh[0] + [x, y, z], mesh[1]


def two_sided(mesh: Mesh) -> Mesh:
    return stack(mesh, inside_out(mesh))


def mirrored(mesh: Mesh) -> Mesh:
    """Mirror it on the plane x = -0.5, so that the diagonals of boxes meet there."""
    vertices = mesh[0] * [-1, 1, 1] - [1, 0, 0]
    return vertices, np.ascontiguousarray(mesh[1][:, ::-1])


@pytest.mark.parametrize(
    "mesh",
    [
        pytest.param(CUBE, id="box"),
        pytest.param(sphere(0.01), id="sphere"),
        pytest.param(cylinder(0.0005, 100), id="wire"),
        pytest.param(box(1000, 1000, 0.001), id="plate"),
        pytest.param(moved(box(0.01, 0.01, 0.0001), 999, 999), id="leaf far away"),
        pytest.param(stack(box(3, 3, 3), inside_out(CUBE)), id="cavity"),
        pytest.param(stack(CUBE, CUBE), id="the same twice"),
        pytest.param(stack(CUBE, mirrored(CUBE)), id="common wall"),
        pytest.param(stack(CUBE, moved(CUBE, 1)), id="wall with other diagonals"),
        pytest.param(stack(CUBE, moved(CUBE, 1, 1)), id="common edge"),
        pytest.param(stack(box(3, 3, 3), two_sided(CUBE)), id="walls inside"),
        pytest.param(
            stack(CUBE, CUBE, inside_out(CUBE)), id="one orientation more often"
        ),
        pytest.param((np.zeros((0, 3)), np.zeros((0, 3), np.int32)), id="nothing"),
    ],
)
def test_mesh_that_encloses_a_volume_has_no_degenerate_faces(mesh: Mesh) -> None:
    assert count_degenerate(*weld_vertices(*mesh)) == (0, 0)


@pytest.mark.parametrize(
    ("mesh", "twice", "flat"),
    [
        pytest.param(two_sided(QUAD), 2, 0, id="leaf"),
        pytest.param(two_sided(sphere(1)), 1280, 0, id="sphere"),
        pytest.param(
            stack(two_sided(QUAD), two_sided(QUAD)), 4, 0, id="leaf of four sides"
        ),
        pytest.param(
            stack(moved(CUBE, 5), two_sided(CUBE)), 12, 0, id="beside a volume"
        ),
        pytest.param(
            stack(CUBE, two_sided(moved(QUAD, 0.5, -0.5, 0.5))), 2, 0, id="overhang"
        ),
        pytest.param(
            stack(box(3, 3, 3), inside_out(box(2, 2, 2)), two_sided(CUBE)),
            12,
            0,
            id="in a cavity",
        ),
        pytest.param(
            stack(QUAD, inside_out((QUAD[0][[1, 2, 3, 0]], QUAD[1]))),
            0,
            4,
            id="the back has other diagonals",
        ),
        pytest.param(
            (sphere(1)[0] * [1, 1, 1e-12], sphere(1)[1]), 0, 1280, id="nearly flat"
        ),
    ],
)
def test_sheets_are_degenerate(mesh: Mesh, twice: int, flat: int) -> None:
    vertices, faces = weld_vertices(*mesh)
    assert is_closed(faces)
    assert count_degenerate(vertices, faces) == (twice, flat)


@given(st.permutations(range(20)), st.integers(0, 2))
def test_order_of_faces_and_corners_does_not_matter(
    order: list[int], shift: int
) -> None:
    vertices, faces = weld_vertices(
        *stack(two_sided(QUAD), two_sided(moved(QUAD, 9)), CUBE)
    )
    shuffled = np.ascontiguousarray(np.roll(faces[order], shift, axis=1))
    assert count_degenerate(vertices, shuffled) == (4, 0)
