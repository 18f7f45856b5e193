import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import volume

from radarsim.scene.mesh_files import MeshError, find_inside
from radarsim.scene.meshes import join_surfaces, join_volume, read_surfaces
from radarsim.scene.shapes import Surface, box
from radarsim.scene.topology import connect_faces, is_closed, weld_vertices

CORNERS, TRIANGLES = box(1, 1, 1)


def obj_box(*, usemtl: str = "") -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    faces = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in TRIANGLES]
    return "\n".join([*lines, usemtl, *faces]) + "\n"


def stl_box() -> str:
    def facet(face: Any) -> str:
        corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[face])
        return f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"

    return f"solid box\n{''.join(facet(face) for face in TRIANGLES)}endsolid box\n"


def ply_box() -> str:
    head = [
        *("ply", "format ascii 1.0", "comment TextureFile ../../etc/passwd"),
        *("element vertex 8", "property float x", "property float y"),
        *("property float z", "element face 12"),
        *("property list uchar int vertex_indices", "end_header"),
    ]
    vertices = [f"{x} {y} {z}" for x, y, z in CORNERS]
    faces = [f"3 {a} {b} {c}" for a, b, c in TRIANGLES]
    return "\n".join([*head, *vertices, *faces]) + "\n"


def box_buffer() -> bytes:
    return CORNERS.astype("<f4").tobytes() + TRIANGLES.astype("<u2").tobytes()


def gltf_box(uri: str | None, nodes: list[dict[str, Any]]) -> dict[str, Any]:
    """Two boxes share one buffer; one is of Leaves, one of Bark."""
    buffer = {"byteLength": 168} | ({"uri": uri} if uri else {})
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    low, high = [-0.5] * 3, [0.5] * 3
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [
            {"name": "crown", "primitives": [primitive | {"material": 0}]},
            {"name": "trunk", "primitives": [primitive | {"material": 1}]},
        ],
        "images": [{"uri": "../../etc/passwd"}, {"uri": "bark.png"}],
        "textures": [{"source": 1}],
        "materials": [
            {"name": "Leaves"},
            {
                "name": "Bark",
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
            },
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"}
            | {"min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [buffer],
    }


NODES: list[dict[str, Any]] = [
    {"name": "tree", "children": [1, 2], "translation": [10, 0, 0]},
    {"name": "crown", "mesh": 0, "translation": [0, 5, 0], "scale": [2, 2, 2]},
    {"name": "trunk", "mesh": 1, "scale": [-1, 1, 1]},
]
FAR: dict[str, Any] = {"mesh": 0, "translation": [1e308, 0, 0]}


def glb(tree: dict[str, Any], binary: bytes) -> bytes:
    head = json.dumps(tree).encode()
    head += b" " * (-len(head) % 4)
    chunks = struct.pack("<I4s", len(head), b"JSON") + head
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write(path: Path, content: str | bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def read(path: Path) -> dict[str | None, Surface]:
    surfaces = read_surfaces(path, path.parent)
    found = {surface.material: surface for surface in surfaces}
    assert len(found) == len(surfaces)
    return found


@pytest.mark.parametrize(
    ("name", "content"),
    [
        pytest.param("box.obj", obj_box(), id="OBJ"),
        pytest.param("box.stl", stl_box(), id="STL"),
        pytest.param("box.ply", ply_box(), id="PLY"),
    ],
)
def test_box_without_materials_is_one_closed_surface(
    tmp_path: Path, name: str, content: str
) -> None:
    (surface,) = read_surfaces(write(tmp_path / name, content), tmp_path)
    vertices, faces = join_volume([welded(surface)])
    assert surface.material is None
    assert volume(vertices, faces) == pytest.approx(1)


def test_text_may_have_names_in_any_encoding(tmp_path: Path) -> None:
    for ending, text, word in (("stl", stl_box(), "box"), ("ply", ply_box(), "etc")):
        content = text.replace(word, "büsche").encode("latin-1")
        (surface,) = read_surfaces(write(tmp_path / f"a.{ending}", content), tmp_path)
        assert volume(*join_volume([welded(surface)])) == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        pytest.param("t.glb", glb(gltf_box(None, NODES), box_buffer()), id="GLB"),
        pytest.param(
            "t.gltf",
            json.dumps(gltf_box("my%20box.bin", NODES)),
            id="glTF with a buffer next to it",
        ),
    ],
)
def test_gltf_has_material_names_and_applies_the_scene_graph(
    tmp_path: Path, name: str, content: str | bytes
) -> None:
    write(tmp_path / "my box.bin", box_buffer())
    found = read(write(tmp_path / name, content))
    leaves, bark = found["Leaves"], found["Bark"]
    assert leaves.vertices.min(axis=0) == pytest.approx([9, 4, -1])
    assert leaves.vertices.max(axis=0) == pytest.approx([11, 6, 1])
    assert volume(leaves.vertices, leaves.faces) == pytest.approx(8)
    assert volume(bark.vertices, bark.faces) == pytest.approx(1)  # a mirror turns it
    assert bark.vertices.mean(axis=0) == pytest.approx([10, 0, 0])


def test_obj_has_material_names_without_reading_their_library(tmp_path: Path) -> None:
    text = "mtllib ../../etc/passwd\n" + obj_box(usemtl="usemtl Old Bark")
    text += "o leaf\nusemtl Leaves\nf 1 2 3\nf 4 5 6\n"
    found = read(write(tmp_path / "tree.obj", text))
    assert {name: len(each.faces) for name, each in found.items()} == {
        "Old Bark": 12,
        "Leaves": 2,
    }


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("../out.stl", "expected a file in the map's own folder"),
        ("link.stl", "expected a file in the map's own folder"),
        ("nowhere.stl", "expected an existing file"),
        pytest.param("meshes", "expected an existing file", id="a folder"),
        pytest.param("a\0b", "expected the path of a file", id="NUL"),
        pytest.param("loop", "expected the path of a file", id="a link to itself"),
    ],
)
def test_reference_out_of_the_folder_is_refused(
    tmp_path: Path, reference: str, message: str
) -> None:
    folder = tmp_path / "map"
    write(tmp_path / "out.stl", stl_box())
    write(folder / "meshes" / "in.stl", stl_box())
    (folder / "link.stl").symlink_to(tmp_path / "out.stl")
    (folder / "linked").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    with pytest.raises(MeshError) as caught:
        find_inside(folder, folder, reference)
    assert str(caught.value) == f"{reference!r}, {message}"


def test_links_inside_of_the_folder_are_followed(tmp_path: Path) -> None:
    inside = write(tmp_path / "meshes" / "in.stl", stl_box())
    (tmp_path / "link.stl").symlink_to(inside)
    assert find_inside(tmp_path, tmp_path, "link.stl") == inside
    assert find_inside(tmp_path, tmp_path / "meshes", "../meshes/in.stl") == inside


@pytest.mark.parametrize("uri", ["../box.bin", "link.bin"])
def test_gltf_file_cannot_read_outside_of_the_folder(tmp_path: Path, uri: str) -> None:
    folder = tmp_path / "map"
    write(tmp_path / "box.bin", box_buffer())
    path = write(folder / "t.gltf", json.dumps(gltf_box(uri, NODES)))
    (folder / "link.bin").symlink_to(tmp_path / "box.bin")
    with pytest.raises(MeshError) as caught:
        read_surfaces(path, folder)
    expected = f"refers to {uri!r}, expected a file in the map's own folder"
    assert str(caught.value) == f"'t.gltf': {expected}"


def test_buffer_may_be_elsewhere_in_the_folder(tmp_path: Path) -> None:
    write(tmp_path / "box.bin", box_buffer())
    tree = json.dumps(gltf_box("../box.bin", NODES))
    path = write(tmp_path / "meshes" / "t.gltf", tree)
    assert len(read_surfaces(path, tmp_path)) == 2


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        pytest.param(
            "a.dae",
            "",
            "'a.dae', expected one of ['.glb', '.gltf', '.obj', '.ply', '.stl']",
            id="another format",
        ),
        pytest.param("a.stl", "", "'a.stl' has no triangles", id="empty"),
        pytest.param(
            "a.ply",
            ply_box().replace("3 0 2 3", "3 0 2 9"),
            "'a.ply': cannot be read as PLY: a face refers to a vertex that does not"
            " exist",
            id="index out of range",
        ),
        pytest.param(
            "a.gltf",
            json.dumps(gltf_box(None, NODES)),
            "'a.gltf': a buffer has no uri, expected a uri or a GLB file",
            id="missing key",
        ),
    ],
)
def test_broken_file_is_refused(
    tmp_path: Path, name: str, content: str | bytes, message: str
) -> None:
    path = write(tmp_path / name, content)
    with pytest.raises(MeshError) as caught:
        read_surfaces(path, tmp_path)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("name", "content", "largest"),
    [
        ("a.obj", obj_box().replace("v -0.5", "v -1e308"), "1e+308"),
        ("a.obj", obj_box().replace("v -0.5", "v nan"), "nan"),
        ("a.ply", ply_box().replace("-0.5 0.5", "-0.5 2e12"), "2e+12"),
        ("a.stl", stl_box().replace("vertex 0.5", "vertex 3e38"), "3e+38"),
        ("a.gltf", json.dumps(gltf_box("a.bin", [FAR])), "1e+308"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_coordinates_whose_volumes_overflow_are_refused(
    tmp_path: Path, name: str, content: str, largest: str
) -> None:
    write(tmp_path / "a.bin", box_buffer())
    path = write(tmp_path / name, content)
    with pytest.raises(MeshError) as caught:
        read_surfaces(path, tmp_path)
    said = f"a vertex has a coordinate of {largest} m, expected at most 1e+12 m"
    assert str(caught.value) == f"{name!r}: {said}"


def test_broken_file_is_not_replaced_by_another(tmp_path: Path) -> None:
    write(tmp_path / "box.bin", box_buffer())
    write(tmp_path / "model.gltf", json.dumps(gltf_box("box.bin", NODES)))
    with pytest.raises(MeshError, match="not JSON"):
        read_surfaces(write(tmp_path / "a.gltf", "{"), tmp_path)


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_random_bytes_are_refused(tmp_path: Path, suffix: str) -> None:
    noise = np.random.Generator(np.random.PCG64(1)).bytes(300)
    for content in (noise, b"ply\n" + noise, b"{" + noise, b"glTF" + noise):
        path = write(tmp_path / f"a.{suffix}", content)
        with pytest.raises(MeshError) as caught:
            read_surfaces(path, tmp_path)
        assert "odule" not in str(caught.value)
        assert "\n" not in str(caught.value)


def welded(piece: Surface) -> Surface:
    return Surface(piece.material, *weld_vertices(piece.vertices, piece.faces))


def surface(faces: Any, at: float = 0.0) -> Surface:
    vertices = CORNERS + np.array([at, 0, 0])
    return welded(Surface(None, vertices, np.asarray(faces, np.int32)))


def test_open_pieces_are_welded() -> None:
    vertices, faces = join_volume([surface(TRIANGLES[:5]), surface(TRIANGLES[5:])])
    assert (len(vertices), len(faces)) == (8, 12)
    assert is_closed(faces)


def test_closed_pieces_stay_separate_where_they_touch() -> None:
    pieces = [surface(TRIANGLES), surface(TRIANGLES, at=1.0), surface(TRIANGLES)]
    _, faces = join_volume(pieces)
    assert connect_faces(faces).components == 3


def test_open_surface_is_not_a_volume() -> None:
    with pytest.raises(MeshError) as caught:
        join_volume([surface(TRIANGLES), surface(TRIANGLES[2:])])
    assert str(caught.value) == "not closed: 4 unmatched edges"


def test_two_sided_sheet_is_not_a_volume() -> None:
    both = np.vstack([TRIANGLES, TRIANGLES[:, ::-1]])
    with pytest.raises(MeshError) as caught:
        join_volume([surface(TRIANGLES, at=5.0), surface(both)])
    assert "12 faces occur in both orientations" in str(caught.value)
    assert len(join_surfaces([surface(both)])[1]) == 24


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_scene_graph_that_flattens_leaves_no_volume(
    tmp_path: Path, angle: float
) -> None:
    turn = np.array(
        [
            [np.cos(angle), -np.sin(angle), 0, 0],
            [np.sin(angle), np.cos(angle), 0, 0],
            [0, 0, 1, 0],
            [0, 0, 0, 1],
        ]
    )
    matrix = turn @ np.diag([1, 0, 1, 1]) @ np.roll(turn, (1, 1), (0, 1))
    nodes = [{"mesh": 0, "matrix": matrix.T.ravel().tolist()}]
    write(tmp_path / "box.bin", box_buffer())
    tree = gltf_box("box.bin", nodes) | {"meshes": gltf_box(None, [])["meshes"][:1]}
    path = write(tmp_path / "t.gltf", json.dumps(tree))
    with pytest.raises(MeshError, match=r"nothing inside|no volume"):
        join_volume([welded(each) for each in read_surfaces(path, tmp_path)])


def test_any_surfaces_can_be_joined_as_sheets() -> None:
    vertices, faces = join_surfaces([surface(TRIANGLES[2:]), surface(TRIANGLES[:1])])
    assert (len(vertices), len(faces)) == (11, 11)
    assert volume(*join_surfaces([surface(TRIANGLES[:, ::-1])])) == pytest.approx(1)
