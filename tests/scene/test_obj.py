"""OBJ files: the meaning of each statement, and errors in broken ones."""

import io
import time
import warnings
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from radarsim.scene.mesh_files import MeshBudget
from radarsim.scene.meshes import read_obj
from radarsim.scene.shapes import Surface
from radarsim.scene.topology import weld_vertices

CORNERS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 .5 2\n"


def read(text: str) -> list[Surface]:
    return read_obj(text.encode(), MeshBudget())


def triangles(text: str) -> list[list[list[float]]]:
    """Return the corners of the triangles of one piece."""
    (piece,) = read(text)
    found: list[list[list[float]]] = piece.vertices[piece.faces].tolist()
    return found


QUAD = triangles(CORNERS + "f 1 2 3 4\n")


def test_polygon_is_a_fan_of_triangles() -> None:
    (piece,) = read(CORNERS + "f 1 2 3 4 5\nf 1 2 3\n")
    assert piece.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2]]
    assert piece.material is None


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(CORNERS + "f 1 2 3 4 # a comment\n", id="comment after corners"),
        pytest.param(CORNERS + "f 1 2 3 4#1 2\n", id="comment without a blank"),
        pytest.param(CORNERS.replace("\n", " # 7\n") + "f 1 2 3 4", id="of vertices"),
        pytest.param(CORNERS + "f 1/1 2/2 3/3 4/4\n", id="textures"),
        pytest.param(CORNERS + "vn 0 0 1\nf 1//1 2//1 3//1 4//1\n", id="normals"),
        pytest.param(CORNERS + "f 1/1/1 2//1 3 4/2\n", id="of each some"),
        pytest.param(CORNERS + "f -5 -4 -3 -2\n", id="counted from the end"),
        pytest.param(
            CORNERS.replace("v .5", "f -4 -3 -2 -1\nv .5"), id="from above the line"
        ),
        pytest.param(CORNERS + "f 1 2 \\\n 3 4\n", id="two lines"),
        pytest.param((CORNERS + "f 1 2 3 4").replace("\n", "\r\n"), id="Windows"),
        pytest.param((CORNERS + "f 1 2 3 4").replace("\n", "\r"), id="old Macs"),
        pytest.param((CORNERS + "f 1 2 3 4").replace("\n", "\n\n \t"), id="indented"),
        pytest.param((CORNERS + "f 1 2 3 4").replace(" ", "\t "), id="tabs"),
        pytest.param("\ufeff" + CORNERS + "f 1 2 3 4", id="byte order mark"),
        pytest.param(
            CORNERS.replace("\n", " 1 .2 .3 .4\n") + "f 1 2 3 4", id="colours"
        ),
        pytest.param(
            CORNERS.replace("v 0", "v +0.0e0").replace("1 1 0", "1 1 0 1")
            + "f 1 2 3 4",
            id="different lines",
        ),
        pytest.param(
            CORNERS + "f 1 2\nf\ns off\nl 1 2\np 1\ng f\nvp 1 2\nfree 1 2 3\nf 1 2 3 4",
            id="other statements",
        ),
    ],
)
def test_triangles_are_those_of_the_plain_file(text: str) -> None:
    assert triangles(text) == QUAD


def test_pieces_are_of_one_object_and_one_material() -> None:
    text = CORNERS + "f 1 2 3\no A\nf 1 2 4\nusemtl Old  Bark#2 \nf 1 2 5\nf 3 4 5\n"
    text += "o B\nf 1 3 4\no A\nf 2 3 4\nusemtl\nusemtl Moss\nf 1 2 3\n"
    found = [(piece.material, len(piece.faces)) for piece in read(text)]
    assert found == [
        ("Moss", 1),
        ("Old Bark#2", 1),
        ("Old Bark#2", 3),
        (None, 1),
        (None, 1),
    ]


@pytest.mark.parametrize("text", ["", "#", "\n", "v 0 0 0\n", "f", "\\\n"])
def test_file_without_triangles_has_no_pieces(text: str) -> None:
    assert read(text) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f 1 2 6\n", "refers to a vertex that does not exist"),
        ("f 1 2 0\n", "refers to a vertex that does not exist"),
        ("f 1 2 x\n", "expected a whole number"),
        ("v 1 2 x\nf 1 2 3\n", "expected a number"),
        ("v 1 2\nf 1 2 3\n", "three coordinates"),
    ],
)
def test_broken_file_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read(CORNERS + text)


@given(
    st.lists(
        st.one_of(
            st.sampled_from(["usemtl a\n", "usemtl b c\n", "o x\n", "o y\n", "# z\n"]),
            st.lists(st.integers(1, 9), min_size=3, max_size=6, unique=True).map(
                lambda corners: f"f {' '.join(map(str, corners))}\n"
            ),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_pieces_are_those_that_trimesh_reads(lines: list[str]) -> None:
    rng = np.random.default_rng(5)
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in rng.normal(size=(9, 3)))
    text = vertices + "f 1 2 3\n" + "".join(lines)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = trimesh.load_scene(
            io.BytesIO(text.encode()),
            file_type="obj",
            split_objects=True,
            process=False,
        )
    expected = [
        weld_vertices(geometry.vertices, np.asarray(geometry.faces, dtype=np.int32))
        for geometry in scene.geometry.values()
    ]
    found = [weld_vertices(piece.vertices, piece.faces) for piece in read(text)]
    assert len(found) == len(expected)
    for (corners, faces), (of_trimesh, faces_of_trimesh) in zip(
        found, expected, strict=True
    ):
        # Of files of quadrangles only, trimesh has all first halves first.
        halves = sorted(of_trimesh[faces_of_trimesh].tolist())
        assert sorted(corners[faces].tolist()) == halves


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(
            lambda count: "".join(f"f 1 2 3{' 4' * (i % 3)}\n" for i in range(count)),
            id="polygons of all sizes",
        ),
        pytest.param(
            lambda count: f"f 1 2 {' 3' * count * 3}\n", id="one large polygon"
        ),
        pytest.param(
            lambda count: "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n" * (count // 2),
            id="two materials in turn",
        ),
    ],
)
def test_time_grows_with_the_size_only(make: Callable[[int], str]) -> None:
    def duration(count: int) -> float:
        text = CORNERS + make(count)
        start = time.process_time()
        read(text)
        return time.process_time() - start

    small = min(duration(10_000) for _ in range(3))
    assert min(duration(40_000) for _ in range(3)) < 12 * small
