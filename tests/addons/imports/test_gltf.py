"""glTF files become maps with the materials that their extras describe."""

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import Run

import radarsim
from radarsim.scene.shapes import box

Import = Callable[..., Run]

VERTICES, FACES = box(1.0, 2.0, 3.0)
BINARY = VERTICES.astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
URI = "data:application/octet-stream;base64," + base64.b64encode(BINARY).decode()


def tree(*materials: dict[str, Any], uri: str | None = URI) -> dict[str, Any]:
    """Return a glTF file with a box of each material, 4 m apart along x."""
    split = VERTICES.size * 4
    count = range(len(materials))
    shape = {"attributes": {"POSITION": 0}, "indices": 1}
    points = {"componentType": 5126, "count": len(VERTICES), "type": "VEC3"}
    corners = {"componentType": 5125, "count": FACES.size, "type": "SCALAR"}
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(count)}],
        "nodes": [{"mesh": i, "translation": [4.0 * i, 0, 0]} for i in count],
        "meshes": [{"primitives": [{**shape, "material": i}]} for i in count],
        "materials": list(materials),
        "accessors": [{"bufferView": 0, **points}, {"bufferView": 1, **corners}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": len(BINARY) - split},
        ],
        "buffers": [{"byteLength": len(BINARY)} | ({"uri": uri} if uri else {})],
    }


def glb(content: dict[str, Any]) -> bytes:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(BINARY), b"BIN\0") + BINARY
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


LEAVES = {"name": "Leaves", "extras": {"density": 0.5, "laser_density": 9.0}}
TEXT = json.dumps(tree(LEAVES))


def extras(content: object) -> str:
    return json.dumps(tree({"name": "Leaves", "extras": content}))


WRONG = {
    "cut off": TEXT[:200],
    "no object": "[]",
    "version": TEXT.replace('"2.0"', '"1.0"'),
    "no triangles": json.dumps(tree()),
    "outside": TEXT.replace(URI, "../b.bin"),
    "missing buffer": TEXT.replace(URI, "b.bin"),
    "no base64": TEXT.replace(URI, "data:;base64,A"),
    "short": TEXT.replace(f'"count": {len(VERTICES)}', '"count": 99999'),
    "no node": TEXT.replace('"nodes": [0]', '"nodes": [7]'),
    "materials": TEXT.replace('"name": "Leaves"', '"name": 3'),
    "negative": extras({"density": -1}),
    "words": extras({"density": "thick"}),
    "unknown base": extras({"based_on": "cheese"}),
    "two of a name": json.dumps(tree(LEAVES, {**LEAVES, "extras": {"density": 1}})),
    "deep": extras({}).replace("{}", "[" * 5000 + "]" * 5000),
}


def test_extras_become_materials(import_file: Import, tmp_path: Path) -> None:
    path = tmp_path / "trees.glb"
    others: tuple[dict[str, str], ...] = {"name": "wood"}, {"name": "Roof"}, {}
    path.write_bytes(glb(tree(LEAVES, *others, uri=None)))
    assert import_file(path, "--default-material", "brick").text == ""
    scene = radarsim.load_map(tmp_path / "map.yaml")
    found = {part.material.name: part.material for part in scene.parts}
    assert found.keys() == {"Leaves", "wood", "brick"}
    assert (found["Leaves"].density, found["Leaves"].laser_density) == (0.5, 9.0)
    # The file's y is up.
    low, high = scene.bounds
    assert [*low, *high] == pytest.approx([-0.5, -1.5, -1, 12.5, 1.5, 1])


def test_patterns_count_before_extras(import_file: Import, tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(TEXT)
    import_file(tmp_path / "a.gltf", "--material", "lea*=hedge")
    scene = radarsim.load_map(tmp_path / "map.yaml")
    assert {part.material.name for part in scene.parts} == {"hedge"}


def test_unread_extras_are_reported(import_file: Import, tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    materials = (
        {"name": "A", "extras": {"density": 1, "season": "May"}},
        {"name": "B", "extras": [1]},
        {"extras": {"density": 1}},
    )
    path.write_text(json.dumps(tree(*materials)))
    lines = import_file(path).text.splitlines()
    for word in ("'season'", "'B'", "unnamed"):
        assert sum(word in line for line in lines) == 1
    assert len(lines) == 3


def test_file_is_below_the_folder_of_the_map(
    import_file: Import, tmp_path: Path
) -> None:
    path = tmp_path.parent / "outside.gltf"
    path.write_text(TEXT)
    assert "map's folder" in import_file(path).err


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_reported(name: str, import_file: Import, tmp_path: Path) -> None:
    (tmp_path.parent / "b.bin").write_bytes(BINARY)
    path = tmp_path / "a.gltf"
    path.write_text(WRONG[name])
    done = import_file(path)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}:")


def test_default_material_and_unused_patterns_are_reported(
    import_file: Import, tmp_path: Path
) -> None:
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(tree({"name": "shrub"}, {"name": "brick"})))
    run = import_file(path, "--material", "*leaf*=hedge")
    assert "--material '*leaf*' matches no object\n" in run.err
    assert "concrete by default: 'shrub'\n" in run.err
    run = import_file(path, "--material", "SHR*=hedge")
    assert "matches no object" not in run.err
    assert "by default" not in run.err


@pytest.mark.parametrize("option", ["--default-material", "--material"])
def test_unknown_material_is_a_usage_error(
    import_file: Import, tmp_path: Path, option: str
) -> None:
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(tree({"name": "shrub"})))
    name = "hegde" if option == "--default-material" else "*=hegde"
    run = import_file(path, option, name)
    assert run.code == 2
    meant = "material 'hegde' (did you mean 'hedge'?), expected one of"
    assert f"radarsim: {option}: {meant}" in run.err
