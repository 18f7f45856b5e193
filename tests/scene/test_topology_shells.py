import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces, box, sphere
from radarsim.scene.topology import (
    count_open_edges,
    is_closed,
    label_components,
    orient_outward,
    weld_vertices,
)

Mesh = tuple[Floats, Faces]


def stack(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(faces).astype(np.int32)


def cube(size: float = 1.0, at: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    vertices, faces = box(size, size, size)
    return vertices + at, faces


def inside_out(mesh: Mesh) -> Mesh:
    return mesh[0], np.ascontiguousarray(mesh[1][:, ::-1])


def volume(vertices: Floats, faces: Faces) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def oriented_volume(mesh: Mesh) -> float:
    faces = orient_outward(*mesh)
    assert faces is not None
    assert is_closed(faces)
    return volume(mesh[0], faces)


def test_a_soup_of_triangles_becomes_a_closed_surface() -> None:
    vertices, faces = cube()
    soup = vertices[faces].reshape(-1, 3)
    loose = np.arange(36, dtype=np.int32).reshape(-1, 3)
    assert count_open_edges(loose) == 36
    merged, joined = weld_vertices(soup, loose)
    assert (len(merged), len(joined)) == (8, 12)
    assert is_closed(joined)


def test_the_two_zeros_are_one_place_and_vanished_faces_go() -> None:
    vertices = np.array([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 2, 3]], dtype=np.int32)
    merged, joined = weld_vertices(vertices, faces)
    assert (len(merged), len(joined)) == (3, 2)


def test_no_faces_are_closed_and_have_no_shells() -> None:
    nothing = np.zeros((0, 3), dtype=np.int32)
    assert is_closed(nothing)
    assert label_components(nothing).shape == (0,)


def test_a_missing_face_leaves_three_open_edges() -> None:
    faces = cube()[1][1:]
    assert count_open_edges(faces) == 3
    assert orient_outward(cube()[0], faces) is None


@given(st.permutations(range(24)))
def test_shells_do_not_depend_on_the_order_of_faces(order: list[int]) -> None:
    _, faces = stack(cube(), cube(at=(3, 0, 0)))
    labels = label_components(faces[order])
    assert len(set(labels)) == 2
    assert (
        len({(label, place >= 12) for label, place in zip(labels, order, strict=True)})
        == 2
    )


def test_a_common_vertex_does_not_join_but_a_common_edge_does() -> None:
    by_vertex = weld_vertices(*stack(cube(), cube(at=(1, 1, 1))))[1]
    by_edge = weld_vertices(*stack(cube(), cube(at=(1, 1, 0))))[1]
    assert label_components(by_vertex).max() == 1
    assert label_components(by_edge).max() == 0
    assert is_closed(by_edge)


def test_the_same_volume_twice_is_closed() -> None:
    assert is_closed(weld_vertices(*stack(cube(), cube()))[1])


def test_shells_of_a_long_strip_are_one() -> None:
    count = 5000
    here = np.arange(count, dtype=np.int32)
    strip = np.column_stack([here, here + 1, here + 2])
    order = np.random.Generator(np.random.PCG64(1)).permutation(count)
    assert label_components(strip[order].astype(np.int32)).max() == 0


@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_any_winding_of_a_closed_surface_is_repaired(flips: list[bool]) -> None:
    vertices, faces = cube()
    mixed = np.where(np.array(flips)[:, None], faces[:, ::-1], faces)
    assert oriented_volume((vertices, mixed)) == pytest.approx(1)


def test_a_sound_surface_stays_as_it_is() -> None:
    mesh = stack(cube(), cube(at=(3, 0, 0)))
    faces = orient_outward(*mesh)
    assert faces is not None
    assert faces.tolist() == mesh[1].tolist()


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
            id="a cavity and a stray shell",
        ),
        pytest.param(
            stack(sphere(2), inside_out(cube(0.2, (1.5, 1.5, 0)))),
            volume(*sphere(2)) + 0.008,
            id="in the box of another but not in it",
        ),
    ],
)
def test_outward_is_outward_except_for_cavities(mesh: Mesh, expected: float) -> None:
    assert oriented_volume(mesh) == pytest.approx(expected)


def test_a_surface_with_one_side_cannot_be_oriented() -> None:
    # the projective plane with six vertices: closed, but it has no inside
    faces = [
        *([0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1]),
        *([1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3]),
    ]
    angles = np.arange(6.0)
    vertices = np.column_stack([np.cos(angles), np.sin(angles), angles**2])
    assert orient_outward(vertices, np.array(faces, dtype=np.int32)) is None
