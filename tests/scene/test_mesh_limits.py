"""Files that announce more than they contain, or more than a scene may have."""

import json
import struct
from pathlib import Path
from typing import Any

import pytest

from radarsim.scene.gltf import MAX_JSON_BYTES, MAX_LEVELS, MAX_NODES, MAX_VERTICES
from radarsim.scene.mesh_files import (
    MAX_FILE_BYTES,
    MAX_SURFACES,
    MAX_TEXT_BYTES,
    MAX_TRIANGLES,
    MeshError,
)
from radarsim.scene.meshes import MAX_LINES, read_surfaces

CORNERS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
PLY = """\
ply
format {form} 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def triangle(**changes: Any) -> dict[str, Any]:
    """Return a glTF file of one triangle, with other keys."""
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "corners.bin"}],
    } | changes


def accessor(**changes: Any) -> list[dict[str, Any]]:
    return [triangle()["accessors"][0] | changes]


def read(folder: Path, name: str, content: str | bytes | dict[str, Any]) -> int:
    """Write a file and return the number of its triangles."""
    (folder / "corners.bin").write_bytes(CORNERS)
    text = json.dumps(content) if isinstance(content, dict) else content
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return sum(len(surface.faces) for surface in read_surfaces(path, folder))


CHAIN = [{"children": [i + 1]} for i in range(MAX_NODES - 1)] + [{"mesh": 0}]
PRIMITIVE = {"attributes": {"POSITION": 0}}
INSTANCES = MAX_NODES - 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        pytest.param(
            {"accessors": [{"componentType": 5126, "count": 10**6, "type": "VEC3"}]},
            "accessor 0 is sparse or compressed",
            id="a count without a buffer view",
        ),
        pytest.param(
            {"accessors": accessor(count=4)},
            "48 bytes of accessor 0, expected at most 36",
            id="an accessor larger than its view",
        ),
        pytest.param(
            {"bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 24}]},
            "60 bytes of accessor 0, expected at most 36",
            id="a stride",
        ),
        pytest.param(
            {"bufferViews": [{"buffer": 0, "byteLength": 37}]},
            "37 bytes of buffer 0, expected at most 36",
            id="a view larger than its buffer",
        ),
        pytest.param(
            {"accessors": accessor(count=0)},
            "accessor 0 is empty",
            id="no values",
        ),
        pytest.param(
            {"accessors": accessor(bufferView=7)},
            "buffer view 7, expected one of the 1 in the file",
            id="a view that is not there",
        ),
        pytest.param(
            {"nodes": CHAIN},
            f"{MAX_LEVELS + 1} levels of nodes, expected at most {MAX_LEVELS}",
            id="a long chain of nodes",
        ),
        pytest.param(
            {"nodes": [*CHAIN, {"mesh": 0}]},
            f"expected {MAX_NODES} entries",
            id="many nodes",
        ),
        pytest.param(
            {"nodes": [{"children": [1, 1]}, {"mesh": 0}]},
            "node 1 is in the scene twice",
            id="a node with two parents",
        ),
        pytest.param(
            {
                "nodes": [{"children": list(range(1, INSTANCES + 1))}]
                + [{"mesh": 0}] * INSTANCES
            },
            f"{MAX_SURFACES + 1} surfaces, expected at most {MAX_SURFACES}",
            id="many instances",
        ),
        pytest.param({"nodes": [{"mesh": -1}]}, "nodes.0.mesh: -1", id="negative"),
        pytest.param({"asset": {"version": "1.0"}}, "glTF version 1.0", id="glTF 1"),
    ],
)
def test_gltf_file_that_counts_too_much_is_refused(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(MeshError) as caught:
        read(tmp_path, "a.gltf", triangle(**changes))
    assert message in str(caught.value)


def test_values_that_many_primitives_share_count_for_each(tmp_path: Path) -> None:
    count = MAX_VERTICES // 100
    (tmp_path / "large.bin").write_bytes(bytes(12 * count))
    tree = triangle(
        meshes=[{"primitives": [PRIMITIVE] * 101}],
        accessors=accessor(count=count),
        bufferViews=[{"buffer": 0, "byteLength": 12 * count}],
        buffers=[{"byteLength": 12 * count, "uri": "large.bin"}],
    )
    with pytest.raises(MeshError, match=f"vertices, expected at most {MAX_VERTICES}"):
        read(tmp_path, "a.gltf", tree)


def test_what_is_not_geometry_is_not_counted(tmp_path: Path) -> None:
    huge = {"componentType": 5126, "count": 10**15, "type": "MAT4"}
    lines = {"attributes": {"POSITION": 1}, "mode": 1}
    tree = triangle(
        accessors=[*accessor(), huge],
        meshes=[
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}}, lines]},
            {"primitives": [{"attributes": {"POSITION": 1}}]},
        ],
        buffers=[{"byteLength": 36, "uri": "corners.bin"}, {"uri": "missing.bin"}],
        images=[{"uri": "missing.png"}],
        skins=[{"inverseBindMatrices": 1}],
    )
    assert read(tmp_path, "a.gltf", tree) == 1


def test_json_of_a_gltf_file_is_limited(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=f"bytes of JSON, .*{MAX_JSON_BYTES}"):
        read(tmp_path, "a.gltf", " " * (MAX_JSON_BYTES + 1))


def test_buffers_count_as_often_as_they_are_used(tmp_path: Path) -> None:
    with (tmp_path / "large.bin").open("wb") as file:
        file.truncate(MAX_FILE_BYTES // 4)  # a sparse file
    tree = triangle(
        buffers=[{"uri": "large.bin"}] * 5,
        bufferViews=[{"buffer": number, "byteLength": 36} for number in range(5)],
        accessors=[accessor(bufferView=number)[0] for number in range(5)],
        meshes=[
            {"primitives": [{"attributes": {"POSITION": n}} for n in range(5)]},
        ],
    )
    with pytest.raises(MeshError, match=f"bytes, .* {MAX_FILE_BYTES} in all"):
        read(tmp_path, "a.gltf", tree)


def test_large_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(MeshError, match=f"expected at most {MAX_FILE_BYTES}"):
        read_surfaces(path, tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        pytest.param(
            "a.stl",
            bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50),
            "4294967295 triangles in the header, expected a file of 214748364834 bytes",
            id="STL",
        ),
        pytest.param(
            "a.ply",
            PLY.format(form="binary_little_endian", vertices=4 * 10**6, faces=1),
            "header, expected 4",
            id="vertices of a binary PLY",
        ),
        pytest.param(
            "a.ply",
            PLY.format(form="ascii", vertices=3, faces=10**6),
            "header, expected 20",
            id="faces of a PLY in text",
        ),
        pytest.param(
            "a.ply",
            PLY.format(form="ascii", vertices=3, faces=10**9),
            f"1000000000 triangles, expected at most {MAX_TRIANGLES} in all",
            id="more faces than any PLY may have",
        ),
        pytest.param(
            "a.ply",
            PLY.format(form="ascii", vertices="3e9", faces=1),
            "'3e9' in the header, expected a count",
            id="no number",
        ),
        pytest.param(
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 5000000\nend_header\n",
            "element 'vertex' in the header has no properties",
            id="elements of nothing",
        ),
        pytest.param("a.ply", "ply\n" * 9999, "expected 'end_header'", id="no end"),
        pytest.param(
            "a.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
            + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(MAX_SURFACES + 1)),
            f"{MAX_SURFACES + 1} objects and materials",
            id="materials of an OBJ",
        ),
        pytest.param(
            "a.obj",
            f"v 0 0 0\nf{' 1' * (MAX_TRIANGLES + 3)}\n",
            f"{MAX_TRIANGLES + 1} triangles",
            id="corners of a polygon of an OBJ",
        ),
        pytest.param(
            "a.obj",
            "f\n" * (MAX_LINES + 1),
            f"{MAX_LINES + 1} lines",
            id="lines of an OBJ",
        ),
        pytest.param(
            "a.stl",
            "solid a\nendsolid a\n" * (MAX_SURFACES + 1),
            f"{MAX_SURFACES + 1} solids",
            id="solids of an STL in text",
        ),
        pytest.param("a.obj", " " * (MAX_TEXT_BYTES + 1), "bytes of text", id="text"),
        pytest.param("a.obj", "\n" * 2_000_000, "no triangles", id="empty lines"),
    ],
)
def test_header_that_counts_too_much_is_refused(
    tmp_path: Path, name: str, content: str | bytes, message: str
) -> None:
    with pytest.raises(MeshError) as caught:
        read(tmp_path, name, content)
    assert message in str(caught.value)
