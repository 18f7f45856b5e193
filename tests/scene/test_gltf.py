"""Triangles of glTF: modes of primitives, types of values, required extensions."""

import base64
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import volume

from radarsim.scene.mesh_files import MeshError
from radarsim.scene.meshes import join_volume, read_surfaces
from radarsim.scene.shapes import Surface, box

CORNERS, FACES = box(2, 2, 2)  # corners at 1 and -1
# A cube in one strip, each corner by its bits x, y and z.
STRIP = [3, 2, 7, 6, 4, 2, 0, 3, 1, 7, 5, 4, 1, 0]
MOST = {"i1": 127, "u1": 255, "<i2": 32767, "<u2": 65535}
TYPES = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123, "<u4": 5125, "<f4": 5126}


def read(
    folder: Path,
    positions: Any,
    indices: Any = None,
    mode: int = 4,
    *,
    normalized: bool = False,
    required: tuple[str, ...] = (),
) -> list[Surface]:
    """Return the surfaces of a file with one primitive."""
    arrays = [np.asarray(positions)]
    arrays += [] if indices is None else [np.asarray(indices)]
    data = b"".join(array.tobytes() for array in arrays)
    ends = [0, *itertools.accumulate(array.nbytes for array in arrays)]
    primitive: dict[str, Any] = {"attributes": {"POSITION": 0}, "mode": mode}
    if indices is not None:
        primitive["indices"] = 1
    tree = {
        "asset": {"version": "2.0"},
        "extensionsRequired": list(required),
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {
                "bufferView": number,
                "componentType": TYPES[array.dtype.str.lstrip("|")],
                "count": len(array),
                "type": "VEC3" if array.ndim == 2 else "SCALAR",
                "normalized": normalized and number == 0,
            }
            for number, array in enumerate(arrays)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": end - start}
            for start, end in itertools.pairwise(ends)
        ],
        "buffers": [{"uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    (folder / "a.gltf").write_text(json.dumps(tree))
    return read_surfaces(folder / "a.gltf", folder)


@pytest.mark.parametrize("kind", MOST)
def test_normalized_values_are_at_most_1(tmp_path: Path, kind: str) -> None:
    is_signed = "i" in kind
    low = np.iinfo(kind).min  # one below the smallest one, which counts as -1, too
    values = np.where(CORNERS > 0, MOST[kind], low).astype(kind)
    indices = FACES.ravel().astype("<u2")
    [found] = read(tmp_path, values, indices, normalized=True)
    lowest = -1 if is_signed else 0
    np.testing.assert_array_equal(found.vertices.min(axis=0), lowest)
    np.testing.assert_array_equal(found.vertices.max(axis=0), 1)
    assert volume(found.vertices, found.faces) == 8 if is_signed else 1
    [found] = read(tmp_path, values, indices)
    np.testing.assert_array_equal(found.vertices, values)


@pytest.mark.parametrize("is_indexed", [True, False])
def test_strip_is_a_cube(tmp_path: Path, is_indexed: bool) -> None:
    corners = CORNERS.astype("<f4")
    indices = np.array(STRIP, "<u2")
    if is_indexed:
        [found] = read(tmp_path, corners, indices, 5)
    else:
        [found] = read(tmp_path, corners[indices], None, 5)
    assert len(found.faces) == 12
    # All face the same side, as they are.
    assert abs(volume(found.vertices, found.faces)) == pytest.approx(8)


@pytest.mark.parametrize("is_indexed", [True, False])
@pytest.mark.parametrize("sides", [1, 2, 3, 4, 50])
def test_fan_is_a_disc(tmp_path: Path, sides: int, is_indexed: bool) -> None:
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rim = np.column_stack([np.cos(angles), np.sin(angles), angles * 0 + 1])
    corners = rim.astype("<f4")
    indices = np.arange(sides, dtype=np.uint8) if is_indexed else None
    if sides < 3:
        with pytest.raises(MeshError, match="no triangles"):
            read(tmp_path, corners, indices, 6)
        return
    [found] = read(tmp_path, corners, indices, 6)
    assert len(found.faces) == sides - 2
    a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a) / 2
    assert (normals[:, 2] > 0).all()
    area = sides / 2 * np.sin(2 * np.pi / sides)
    assert normals[:, 2].sum() == pytest.approx(area)


def test_fans_of_a_pyramid_enclose_it(tmp_path: Path) -> None:
    base = np.array([[0, 0, 0], [0, 2, 0], [2, 2, 0], [2, 0, 0]], "<f4")
    tip = np.array([[1, 1, 3]], "<f4")
    sides = np.vstack([tip, base[::-1], base[-1:]])
    surfaces = [*read(tmp_path, base, None, 6), *read(tmp_path, sides, None, 6)]
    assert volume(*join_volume(surfaces)) == pytest.approx(4)


@pytest.mark.parametrize(
    ("name", "is_read"),
    [
        ("KHR_mesh_quantization", True),
        ("KHR_texture_transform", True),
        ("EXT_meshopt_compression", False),
    ],
)
def test_required_extension_is_known_or_named(
    tmp_path: Path, name: str, is_read: bool
) -> None:
    corners, indices = CORNERS.astype("<f4"), FACES.ravel().astype("<u2")
    if is_read:
        assert len(read(tmp_path, corners, indices, required=(name,))) == 1
        return
    with pytest.raises(MeshError, match=f"requires the extension '{name}', expected"):
        read(tmp_path, corners, indices, required=("KHR_mesh_quantization", name))


def test_indices_are_no_floats(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="accessor 1 is SCALAR of 5126, expected"):
        read(tmp_path, CORNERS.astype("<f4"), FACES.ravel().astype("<f4"))
