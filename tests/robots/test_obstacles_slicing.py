import numpy as np
import pytest
import shapely
from flat_world import rectangle
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.autonomy.plotting.outlines import outlines_of
from radarsim.geometry import Floats
from radarsim.robots.obstacles import enclosed_area, slice_mesh
from radarsim.scene.map_file import load_map

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
corners = st.lists(
    st.tuples(*[st.floats(-5, 5).map(lambda number: round(number, 2))] * 3),
    min_size=4,
    max_size=4,
)


def cube() -> tuple[Floats, NDArray[np.int32]]:
    """Return the cube from 0 to 1, each side two triangles."""
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    vertices = np.array([[*corner, z] for z in (0, 1) for corner in square], float)
    sides = [[0, 3, 2, 1], [4, 5, 6, 7], *([k, (k + 1) % 4] for k in range(4))]
    quads = [s if len(s) == 4 else [s[0], s[1], s[1] + 4, s[0] + 4] for s in sides]
    faces = [face for a, b, c, d in quads for face in ([a, b, c], [a, c, d])]
    return vertices, np.array(faces, dtype=np.int32)


def length(segments: Floats) -> float:
    return float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum())


@pytest.mark.parametrize("height", [1e-6, 0.3, 0.5, 1.0])
def test_slice_of_a_cube_is_its_outline(height: float) -> None:
    segments = slice_mesh(*cube(), height)
    lines = shapely.multilinestrings(shapely.linestrings(segments))
    outline = shapely.box(0, 0, 1, 1).exterior
    assert lines.hausdorff_distance(outline) < 1e-12
    assert length(segments) == pytest.approx(4)


@pytest.mark.parametrize(
    "height",
    [
        pytest.param(-0.1, id="below"),
        pytest.param(0.0, id="on which it stands"),
        pytest.param(1.1, id="above"),
    ],
)
def test_plane_beside_a_cube_gives_no_slice(height: float) -> None:
    assert slice_mesh(*cube(), height).shape == (0, 2, 2)


@given(points=corners, height=st.floats(-5, 5))
def test_slice_of_a_closed_mesh_is_closed(
    points: list[tuple[float, float, float]], height: float
) -> None:
    segments = slice_mesh(np.array(points), TETRAHEDRON, height)
    ends = segments.reshape(-1, 2)
    apart = np.linalg.norm(ends[:, None] - ends[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    assert (apart.min(axis=1, initial=np.inf) < 1e-6).all()


def test_mesh_without_faces_has_an_empty_slice() -> None:
    empty = np.zeros((0, 3), dtype=np.int32)
    assert slice_mesh(np.zeros((0, 3)), empty, 0.5).shape == (0, 2, 2)


def test_ring_inside_another_is_a_hole() -> None:
    area = enclosed_area(np.concatenate([rectangle(0, 0, 3, 3), rectangle(1, 1, 2, 2)]))
    assert shapely.area(area) == pytest.approx(8)


def test_line_encloses_nothing() -> None:
    assert shapely.is_empty(enclosed_area(np.array([[[0.0, 0.0], [1.0, 0.0]]])))
    assert shapely.is_empty(enclosed_area(np.zeros((0, 2, 2))))


@pytest.mark.parametrize("height", [0.346, 0.4, 0.5, 1.0])
def test_trees_whose_branches_cross_have_outlines(height: float) -> None:
    outlines = outlines_of(load_map("marulan_trial"), height)
    assert any(outline.lines for outline in outlines)
