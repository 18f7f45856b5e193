"""The compiled passes over faces find what sorting with numpy finds."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles import numpy_topology

from radarsim.scene.face_passes import connect_faces, measure_components, weld_vertices
from radarsim.scene.shapes import Mesh, box, concatenate, sphere
from radarsim.scene.topology import count_degenerate, orient_outward

NUMBERS = st.sampled_from([-1.0, -0.0, 0.0, 1.0, 1e-300, 0.1])
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=12)


@st.composite
def soups(draw: st.DrawFn) -> Mesh:
    """Return any triangles, many of which have equal or the same corners."""
    points = draw(POINTS)
    index = st.integers(0, len(points) - 1)
    faces = draw(st.lists(st.tuples(index, index, index), max_size=30))
    return np.array(points), np.array(faces, np.int32).reshape(-1, 3)


SOLIDS = ("box", "large box", "inverted")


@st.composite
def piles(draw: st.DrawFn, shapes: Sequence[str] = (*SOLIDS, "sheet")) -> Mesh:
    """Return boxes that touch, lie in each other, or are inside out, and sheets."""
    place = st.tuples(*[st.integers(0, 3)] * 3)
    kinds = st.sampled_from(shapes)
    meshes: list[Mesh] = []
    for kind, at in draw(st.lists(st.tuples(kinds, place), min_size=1, max_size=6)):
        size = 4.0 if kind == "large box" else 1.0
        vertices, faces = box(size, size, size)
        if kind == "inverted":
            faces = faces[:, ::-1]
        if kind == "sheet":
            faces = np.concatenate([faces[:2], faces[:2, ::-1]])
        meshes.append((vertices + np.array(at), faces))
    vertices, faces = concatenate(meshes)
    if draw(st.booleans()):
        kept = draw(st.permutations(range(len(faces))))
        faces = faces[kept[draw(st.integers(0, 1)) :]]
    if draw(st.booleans()):
        flipped = draw(st.lists(st.integers(0, len(faces) - 1), unique=True))
        faces[flipped] = faces[flipped][:, ::-1]
    return vertices, faces


def triangles(mesh: Mesh) -> Any:
    return mesh[0][mesh[1]].tolist()


def numbered_by_first_use(labels: Any) -> list[int]:
    numbers: dict[int, int] = {}
    return [numbers.setdefault(label, len(numbers)) for label in labels.tolist()]


@given(soups() | piles())
def test_welding_keeps_the_same_triangles(mesh: Mesh) -> None:
    expected = numpy_topology.weld_vertices(*mesh)
    found = weld_vertices(*mesh)
    assert str(triangles(found)) == str(triangles(expected))  # also signs of zeros
    assert sorted(found[0].tolist()) == expected[0].tolist()


@given(soups() | piles())
def test_faces_are_connected_as_by_sorting(mesh: Mesh) -> None:
    _, faces = weld_vertices(*mesh)
    found = connect_faces(faces)
    labels = numbered_by_first_use(numpy_topology.label_components(faces))
    assert found.open_edges == numpy_topology.count_open_edges(faces)
    assert found.labels.tolist() == labels
    assert found.components == len(set(labels))


@settings(max_examples=50)
@given(piles(SOLIDS))
def test_volumes_are_oriented_as_by_sorting(mesh: Mesh) -> None:
    vertices, faces = numpy_topology.weld_vertices(*mesh)
    others, found = weld_vertices(*mesh)
    expected = numpy_topology.orient_outward(vertices, faces)
    oriented = orient_outward(others, found)
    assert (oriented is None) == (expected is None)
    if oriented is not None and expected is not None:
        labels = connect_faces(expected).labels
        origins = np.zeros((int(labels.max()) + 1, 3))
        volumes = measure_components(vertices, expected, labels, origins).volumes
        # On which side of nothing the outside is, is a matter of rounding.
        assume((np.abs(volumes) > 0.1).all())
        assert triangles((others, oriented.faces)) == triangles((vertices, expected))


@settings(max_examples=50)
@given(piles())
def test_degenerate_faces_are_counted_as_by_sorting(mesh: Mesh) -> None:
    vertices, faces = weld_vertices(*mesh)
    oriented = orient_outward(vertices, faces)
    if oriented is not None:
        expected = numpy_topology.count_degenerate(vertices, oriented.faces)
        assert count_degenerate(vertices, *oriented) == expected
        assert count_degenerate(vertices, oriented.faces) == expected


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
    welded, joined = weld_vertices(soup, loose)
    assert len(welded) == len(vertices)
    assert (welded[joined] == vertices[faces]).all()
    assert connect_faces(joined).open_edges == 0
    assert connect_faces(loose).components == len(faces)


def test_triangles_without_a_common_vertex_all_stay() -> None:
    corners = np.arange(90_000.0).reshape(-1, 3)
    faces = np.arange(30_000, dtype=np.int32).reshape(-1, 3)
    welded, joined = weld_vertices(corners, faces)
    assert (welded == corners).all()
    assert (joined == faces).all()
