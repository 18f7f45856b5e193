from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from parts import volume

from radarsim.scene import topology
from radarsim.scene.shapes import Mesh, box, concatenate, cylinder, sphere

NUMBERS = st.sampled_from([-1.0, -0.0, 0.0, 1.0, 1e-300, 0.1])
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=12)
PLACES = st.tuples(*[st.integers(0, 3)] * 3)
QUAD = (
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)
CUBE = box(1, 1, 1)


def stack(*meshes: Mesh) -> Mesh:
    return concatenate(meshes)


def cube(size: float = 1.0, at: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    vertices, faces = box(size, size, size)
    return vertices + at, faces


def inside_out(mesh: Mesh) -> Mesh:
    return mesh[0], np.ascontiguousarray(mesh[1][:, ::-1])


def oriented_volume(mesh: Mesh) -> float:
    oriented = topology.orient_outward(*mesh)
    assert oriented is not None
    assert topology.is_closed(oriented)
    return volume(mesh[0], oriented)


def test_mesh_without_faces_is_closed_and_has_no_components() -> None:
    nothing = np.zeros((0, 3), dtype=np.int32)
    assert topology.is_closed(nothing)
    assert topology.connect_faces(nothing).labels.shape == (0,)


def test_consistent_surface_is_not_changed() -> None:
    mesh = stack(cube(), cube(at=(3, 0, 0)))
    oriented = topology.orient_outward(*mesh)
    assert oriented is not None
    assert oriented.tolist() == mesh[1].tolist()


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
    assert topology.orient_outward(vertices, np.array(faces, dtype=np.int32)) is None


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
    assert topology.count_degenerate(*topology.weld_vertices(*mesh)) == (0, 0)


@pytest.mark.parametrize(
    ("mesh", "twice", "flat"),
    [
        pytest.param(two_sided(QUAD), 2, 0, id="leaf"),
        pytest.param(two_sided(sphere(1)), 1280, 0, id="sphere"),
        pytest.param(
            stack(two_sided(QUAD), two_sided(QUAD)), 4, 0, id="leaf of four sides"
        ),
        pytest.param(
            stack(moved(CUBE, 5), two_sided(CUBE)), 12, 0, id="next to a volume"
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
    vertices, faces = topology.weld_vertices(*mesh)
    assert topology.is_closed(faces)
    assert topology.count_degenerate(vertices, faces) == (twice, flat)


@given(st.permutations(range(20)), st.integers(0, 2))
def test_order_of_faces_and_corners_does_not_matter(
    order: list[int], shift: int
) -> None:
    vertices, faces = topology.weld_vertices(
        *stack(two_sided(QUAD), two_sided(moved(QUAD, 9)), CUBE)
    )
    shuffled = np.ascontiguousarray(np.roll(faces[order], shift, axis=1))
    assert topology.count_degenerate(vertices, shuffled) == (4, 0)


@st.composite
def soups(draw: st.DrawFn) -> Mesh:
    """Return any triangles, many with equal or the same corners."""
    points = draw(POINTS)
    index = st.integers(0, len(points) - 1)
    faces = draw(st.lists(st.tuples(index, index, index), max_size=30))
    return np.array(points), np.array(faces, np.int32).reshape(-1, 3)


@st.composite
def piles(draw: st.DrawFn) -> Mesh:
    """Return boxes that touch each other; a face may be missing."""
    cubes = [box(1, 1, 1) for _ in range(draw(st.integers(1, 6)))]
    vertices, faces = concatenate([(v + draw(PLACES), f) for v, f in cubes])
    kept = draw(st.permutations(range(len(faces))))
    return vertices, faces[kept[draw(st.integers(0, 1)) :]]


def triangles(mesh: Mesh) -> Any:
    return mesh[0][mesh[1]].tolist()


@settings(max_examples=40)
@given(soups() | piles())
def test_welding_keeps_the_same_triangles(mesh: Mesh) -> None:
    whole = [[tuple(corner) for corner in each] for each in triangles(mesh)]
    expected = [[[x + 0.0 for x in c] for c in e] for e in whole if len(set(e)) == 3]
    found = topology.weld_vertices(*mesh)
    assert str(triangles(found)) == str(expected)  # also signs of zeros
    corners = {tuple(corner) for each in whole for corner in each}
    assert sorted(map(tuple, found[0].tolist())) == sorted(corners)


@settings(max_examples=40)
@given(soups() | piles())
def test_faces_are_connected_by_their_edges(mesh: Mesh) -> None:
    _, welded = topology.weld_vertices(*mesh)
    faces = welded.tolist()
    directions = Counter((f[i], f[i - 1]) for f in faces for i in range(3))
    edges = {frozenset(edge) for edge in directions}
    is_open = [directions[a, b] != directions[b, a] for a, b in map(tuple, edges)]
    labels = list(range(len(faces)))
    for edge in edges:
        joined = {labels[i] for i, face in enumerate(faces) if edge <= {*face}}
        labels = [min(joined) if label in joined else label for label in labels]
    found = topology.connect_faces(welded)
    assert found.open_edges == sum(is_open)
    first_uses = list(dict.fromkeys(labels))
    assert found.labels.tolist() == [first_uses.index(label) for label in labels]
    assert found.components == len(first_uses)


@settings(max_examples=40)
@given(st.sets(PLACES, min_size=1, max_size=6), st.data())
def test_boxes_apart_are_turned_outward_whatever_is_flipped(
    places: set[tuple[int, int, int]], data: st.DataObject
) -> None:
    cubes = [(box(1, 1, 1)[0] + 2 * np.array(at), box(1, 1, 1)[1]) for at in places]
    vertices, faces = concatenate(cubes)
    flipped = data.draw(st.lists(st.booleans(), min_size=len(faces)))[: len(faces)]
    faces[flipped] = faces[flipped][:, ::-1]
    assert oriented_volume(topology.weld_vertices(vertices, faces)) == pytest.approx(
        len(places)
    )


def fan(count: int) -> Mesh:
    """Return a closed double cone: all its faces meet at one of two vertices."""
    angles = np.arange(count) * (2 * np.pi / count)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    here, there = np.arange(count) + 2, np.roll(np.arange(count) + 2, -1)
    top = np.column_stack([np.zeros(count, np.int64), here, there])
    bottom = np.column_stack([np.ones(count, np.int64), there, here])
    apexes = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    return np.vstack([apexes, rim]), np.vstack([top, bottom]).astype(np.int32)


@pytest.mark.parametrize("mesh", [fan(50_000), sphere(1.0)], ids=["fan", "sphere"])
def test_loose_triangles_of_a_closed_surface_are_welded(mesh: Mesh) -> None:
    vertices, faces = mesh
    soup = vertices[faces].reshape(-1, 3)
    loose = np.arange(len(soup), dtype=np.int32).reshape(-1, 3)
    welded, joined = topology.weld_vertices(soup, loose)
    assert len(welded) == len(vertices)
    assert (welded[joined] == vertices[faces]).all()
    assert topology.connect_faces(joined).open_edges == 0
    assert topology.connect_faces(loose).components == len(faces)


def test_triangles_without_a_common_vertex_all_stay() -> None:
    corners = np.arange(90_000.0).reshape(-1, 3)
    faces = np.arange(30_000, dtype=np.int32).reshape(-1, 3)
    welded, joined = topology.weld_vertices(corners, faces)
    assert (welded == corners).all()
    assert (joined == faces).all()
