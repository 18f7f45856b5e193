"""The passes over faces find what plain Python finds."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.scene.shapes import Mesh, box, concatenate, sphere
from radarsim.scene.topology import (
    connect_faces,
    is_closed,
    orient_outward,
    weld_vertices,
)

NUMBERS = st.sampled_from([-1.0, -0.0, 0.0, 1.0, 1e-300, 0.1])
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=12)
PLACES = st.tuples(*[st.integers(0, 3)] * 3)


@st.composite
def soups(draw: st.DrawFn) -> Mesh:
    """Return any triangles, many of which have equal or the same corners."""
    points = draw(POINTS)
    index = st.integers(0, len(points) - 1)
    faces = draw(st.lists(st.tuples(index, index, index), max_size=30))
    return np.array(points), np.array(faces, np.int32).reshape(-1, 3)


@st.composite
def piles(draw: st.DrawFn) -> Mesh:
    """Return boxes that touch each other, of which a face may be missing."""
    cubes = [box(1, 1, 1) for _ in range(draw(st.integers(1, 6)))]
    vertices, faces = concatenate([(v + draw(PLACES), f) for v, f in cubes])
    kept = draw(st.permutations(range(len(faces))))
    return vertices, faces[kept[draw(st.integers(0, 1)) :]]


def triangles(mesh: Mesh) -> Any:
    return mesh[0][mesh[1]].tolist()


@given(soups() | piles())
def test_welding_keeps_the_same_triangles(mesh: Mesh) -> None:
    whole = [[tuple(corner) for corner in each] for each in triangles(mesh)]
    expected = [[[x + 0.0 for x in c] for c in e] for e in whole if len(set(e)) == 3]
    found = weld_vertices(*mesh)
    assert str(triangles(found)) == str(expected)  # also signs of zeros
    corners = {tuple(corner) for each in whole for corner in each}
    assert sorted(map(tuple, found[0].tolist())) == sorted(corners)


@given(soups() | piles())
def test_faces_are_connected_by_their_edges(mesh: Mesh) -> None:
    _, welded = weld_vertices(*mesh)
    faces = welded.tolist()
    directions = Counter((f[i], f[i - 1]) for f in faces for i in range(3))
    edges = {frozenset(edge) for edge in directions}
    is_open = [directions[a, b] != directions[b, a] for a, b in map(tuple, edges)]
    labels = list(range(len(faces)))
    for edge in edges:
        joined = {labels[i] for i, face in enumerate(faces) if edge <= {*face}}
        labels = [min(joined) if label in joined else label for label in labels]
    found = connect_faces(welded)
    assert found.open_edges == sum(is_open)
    first_uses = list(dict.fromkeys(labels))
    assert found.labels.tolist() == [first_uses.index(label) for label in labels]
    assert found.components == len(first_uses)


@given(st.sets(PLACES, min_size=1, max_size=6), st.data())
def test_boxes_apart_are_turned_outward_whatever_is_flipped(
    places: set[tuple[int, int, int]], data: st.DataObject
) -> None:
    cubes = [(box(1, 1, 1)[0] + 2 * np.array(at), box(1, 1, 1)[1]) for at in places]
    vertices, faces = concatenate(cubes)
    flipped = data.draw(st.lists(st.booleans(), min_size=len(faces)))[: len(faces)]
    faces[flipped] = faces[flipped][:, ::-1]
    found = orient_outward(*weld_vertices(vertices, faces))
    assert found is not None
    assert is_closed(found[0])
    a, b, c = np.moveaxis(weld_vertices(vertices, faces)[0][found[0]], 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(len(places))


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
