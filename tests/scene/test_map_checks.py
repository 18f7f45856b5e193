import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import radarsim
from radarsim.errors import MapError
from radarsim.geometry import Pose3
from radarsim.presets.materials import library_names
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.scene.material import OPAQUE, Material
from radarsim.scene.scene import Scene

HEAD = """\
version: 1
materials:
  stone: {density: opaque}
  leaf: {density: 0.7}
  sheet: {sheet_loss: 0.25}
objects:
"""
KEYS = (
    "['box', 'cylinder', 'material', 'materials', 'mesh', 'name', 'position', 'repeat',"
    " 'rotation_deg', 'scale', 'scatter', 'sphere', 'up_axis', 'yaw_deg']"
)
SHAPES = "expected one of ['box', 'cylinder', 'mesh', 'sphere']"
LIBRARY = f", or of the library, {list(library_names())}"
CLOSED = (
    "expected a closed volume with one outside,"
    " since beams enter 'leaf', which has no sheet_loss"
)
START = "expected Robot, Player or ComSt, then letters, then digits"
CUBE = """\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 2\nv 1 0 2\nv 1 1 2\nv 0 1 2
usemtl Leaves
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""
BACK = "f 2 3 4 1\nf 7 6 5 8\nf 6 2 1 5\nf 7 3 2 6\nf 8 4 3 7\nf 5 1 4 8\n"
FLAT = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 3 4 1\nf 4 3 2\nf 2 1 4\n"
TREE = (
    CUBE + "v 0 0 -1\nv 1 0 -1\nv 0 1 -1\nusemtl Bark\nf 9 10 11\n"
)  # the bark is open


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, where m.yaml is, with a few mesh files."""
    monkeypatch.chdir(tmp_path)
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    (meshes / "cube.obj").write_text(CUBE)
    (meshes / "tree.obj").write_text(TREE)
    (meshes / "plain.obj").write_text(CUBE.replace("usemtl Leaves", ""))
    (meshes / "lid.obj").write_text(CUBE.replace("f 5 6 7 8\n", ""))
    (meshes / "double.obj").write_text(CUBE + BACK)
    (meshes / "flat.obj").write_text(FLAT)
    (meshes / "line.obj").write_text("v 0 0 0\nv 1 0 0\nf 1 2 1\n")
    (meshes / "broken.ply").write_text("ply\n")
    return tmp_path


def load(text: str) -> Scene:
    path = Path("m.yaml")
    path.write_text(text)
    return load_map(path)


def problems(text: str) -> list[str]:
    with pytest.raises(MapError) as caught:
        load(text)
    return caught.value.problems


def objects(*lines: str) -> str:
    return HEAD + "".join(f"  - {{{line}}}\n" for line in lines)


def test_map_becomes_parts_materials_and_starts() -> None:
    scene = load(
        "version: 1\n"
        "level: DM-Room\n"
        "materials:\n"
        "  concrete: {density: opaque}\n"
        "  smoke: {density: 0.0, laser_density: 0.5, solid: false}\n"
        "  twigs: {density: 0.1, sheet_loss: 0.2}\n"
        "  leaves: {sheet_loss: 0.05}\n"
        "objects:\n"
        "  - {name: wall, box: [2, 4, 6], position: [1, 2, 3], material: concrete}\n"
        "  - {name: cloud, sphere: 1.5, material: smoke}\n"
        "starts:\n"
        "  - {name: RobotStart1, position: [-8, 0, 0.1], yaw_deg: 90}\n"
        "  - {name: PlayerStart_2, position: [0, 1e0, 0]}\n"
    )
    assert (scene.name, scene.level) == ("m", "DM-Room")
    assert scene.materials == {
        "concrete": Material("concrete"),
        "smoke": Material("smoke", 0.0, 0.5, solid=False),
        "twigs": Material("twigs", 0.1, OPAQUE, sheet_loss=0.2),
        "leaves": Material("leaves", 0.0, OPAQUE, sheet_loss=0.05),
    }
    assert [part.object_name for part in scene.parts] == ["wall", "cloud"]
    assert scene.parts[0].vertices.min(axis=0).tolist() == [0, 0, 0]
    assert scene.parts[0].vertices.max(axis=0).tolist() == [2, 4, 6]
    assert scene.parts[1].material == scene.materials["smoke"]
    first, second = scene.starts
    assert first.pose == Pose3(-8, 0, 0.1, yaw=math.pi / 2)
    assert (second.name, second.pose) == ("PlayerStart_2", Pose3(0, 1, 0))


def test_level_defaults_to_the_stem_of_the_file() -> None:
    assert load("version: 1\n").level == "m"
    assert load("version: 1\nobjects:\nstarts:\nmaterials:\n").parts == ()


def test_objects_are_rotated_about_their_own_position() -> None:
    scene = load(
        objects(
            "name: a, box: [4, 2, 1], position: [9, 0, 0], yaw_deg: 90, material: leaf",
            "name: b, cylinder: [1, 6], position: [9, 0, 0],"
            " rotation_deg: [0, 90, 0], material: leaf",
        )
    )
    extents = [part.vertices.max(axis=0) for part in scene.parts]
    assert extents[0] == pytest.approx([10, 2, 0.5])
    assert extents[1] == pytest.approx([12, 1, 1])


def test_copies_have_their_own_names_and_positions() -> None:
    area = "area: [[-9, -9], [9, 9]], seed: 3, scale: [2, 2]"
    scene = load(
        objects(
            "name: post, box: [1, 1, 1], material: stone,"
            " repeat: {count: 2, step: [0, 3, 0]}",
            f"name: bush, sphere: 1, material: leaf, scatter: {{count: 2, {area}}}",
        )
    )
    names = [part.object_name for part in scene.parts]
    assert names == ["post_1", "post_2", "bush_1", "bush_2"]
    assert scene.parts[1].vertices.mean(axis=0) == pytest.approx([0, 3, 0])
    assert np.ptp(scene.parts[2].vertices, axis=0) == pytest.approx([4, 4, 4])


def test_mesh_becomes_one_part_for_each_material() -> None:
    names = "materials: {Leaves: leaf, Bark: sheet}"
    scene = load(objects(f"name: oak, mesh: meshes/tree.obj, {names}"))
    parts = {part.material.name: part for part in scene.parts}
    assert {name: len(part.faces) for name, part in parts.items()} == {
        "leaf": 12,
        "sheet": 1,
    }
    assert parts["leaf"].closed
    assert not parts["sheet"].closed
    assert {part.object_name for part in scene.parts} == {"oak"}


def test_mesh_can_have_one_material_and_other_axes_and_units() -> None:
    (part,) = load(
        objects(
            "name: a, mesh: meshes/cube.obj, up_axis: y, scale: 0.5,"
            " position: [5, 0, 0], material: leaf"
        )
    ).parts
    assert part.vertices.min(axis=0).tolist() == [5, -1, 0]
    assert part.vertices.max(axis=0).tolist() == [5.5, 0, 0.5]


@pytest.mark.parametrize(
    ("mesh", "closed"),
    [
        pytest.param("lid", False, id="open"),
        pytest.param("double", True, id="each face in both orientations"),
        pytest.param("flat", True, id="flat"),
    ],
)
def test_mesh_of_opaque_or_sheet_material_may_be_open(mesh: str, closed: bool) -> None:
    lines = (
        f"name: {name}, mesh: meshes/{mesh}.obj, material: {name}"
        for name in ("stone", "sheet")
    )
    assert [part.closed for part in load(objects(*lines)).parts] == [closed, closed]


def test_longest_names_are_accepted() -> None:
    text = objects(f"name: {'a' * 200}, sphere: 1, material: stone")
    text += f"starts: [{{name: Robot{'1' * 35}, position: [0, 0, 0]}}]\n"
    text += f"level: {'x' * 200}\n"
    scene = load(text)
    assert (len(scene.level), len(scene.starts[0].name)) == (200, 40)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param(
            "",
            "m.yaml:1:1: None, expected keys like 'version' and 'objects'",
            id="empty",
        ),
        pytest.param(
            "[1]",
            "m.yaml:1:1: [1], expected keys like 'version' and 'objects'",
            id="list",
        ),
        pytest.param(
            "a: [1",
            "m.yaml:1:6: not YAML: expected ',' or ']', but got '<stream end>'",
            id="no YAML",
        ),
        pytest.param("version: 2", "m.yaml:1:10: version: 2, expected 1", id="version"),
        pytest.param("level: x", "m.yaml:1:1: version: missing", id="no version"),
        pytest.param(
            "version: 1\nlevel: a b",
            "m.yaml:2:8: level: 'a b', expected ASCII without blanks and braces",
            id="blank in the level",
        ),
        pytest.param(
            "version: 1\nlevel: 'a{b'",
            "m.yaml:2:8: level: 'a{b', expected ASCII without blanks and braces",
            id="brace in the level",
        ),
        pytest.param(
            f"version: 1\nlevel: {'x' * 201}",
            f"m.yaml:2:8: level: '{'x' * 79}, expected at most 200 characters",
            id="endless level",
        ),
        pytest.param(
            "? " * 3000 + "a", "m.yaml:1:67: more than 32 levels", id="keys of keys"
        ),
        pytest.param(
            "version: 1\nmaterials: []",
            "m.yaml:2:12: materials: [], expected keys with values",
            id="list of materials",
        ),
        pytest.param(
            "version: 1\nobjects: {}",
            "m.yaml:2:10: objects: {}, expected a list",
            id="map of objects",
        ),
        pytest.param(
            "version: 1\nwalls: 3",
            "m.yaml:2:1: walls: unknown key,"
            " expected one of ['air', 'level', 'materials', 'objects', 'starts',"
            " 'trial', 'variants', 'version']",
            id="unknown section",
        ),
        pytest.param(
            "version: 1\nversion: 1",
            "m.yaml:2:1: version: duplicate key, first in line 1",
            id="duplicate key",
        ),
        pytest.param(
            "version: !!int 1",
            "m.yaml:1:10: version: tag 'tag:yaml.org,2002:int', expected none",
            id="tag",
        ),
    ],
)
def test_problem_of_the_top_level_has_place_and_expectation(
    text: str, expected: str
) -> None:
    assert problems(text) == [expected]


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        pytest.param("{}", "4: m.density: missing, expected 'opaque' or a number"),
        pytest.param(
            "{density: -1.4}",
            "14: m.density: -1.4, expected 'opaque' or a number, at least 0",
        ),
        pytest.param(
            "{density: thick}",
            "14: m.density: 'thick', expected 'opaque' or a number, at least 0",
        ),
        pytest.param(
            "{density: true}",
            "14: m.density: True, expected 'opaque' or a number, at least 0",
        ),
        pytest.param(
            "{density: .nan}", "14: m.density: '.nan', expected a finite number"
        ),
        pytest.param(
            "{density: 1, laser_density: x}",
            "32: m.laser_density: 'x', expected 'opaque' or a number, at least 0",
        ),
        pytest.param(
            "{density: 1, solid: yes}", "24: m.solid: 'yes', expected true or false"
        ),
        pytest.param("{sheet_loss: -1}", "17: m.sheet_loss: -1, expected at least 0"),
        pytest.param(
            "{density: opaque, sheet_loss: 1}",
            "34: m.sheet_loss: 1 with 'opaque',"
            " expected a density that is a number, or none",
        ),
        pytest.param("opaque", "4: m: 'opaque', expected keys with values"),
        pytest.param(
            "{density: 1, colour: red}",
            "17: m.colour: unknown key, expected one of ['absorption_db', 'based_on',"
            " 'db_per_m', 'density', 'g_per_m3', 'laser_absorption_db',"
            " 'laser_db_per_m', 'laser_density', 'mirror', 'mm_per_h', 'sheet_loss',"
            " 'solid']",
        ),
    ],
)
def test_problem_of_a_material_has_place_and_expectation(
    entry: str, expected: str
) -> None:
    column, rest = expected.split(":", 1)
    text = f"version: 1\nmaterials:\n  m: {entry}\n"
    place = f"m.yaml:3:{int(column) + 2 if column != '4' else 6}"
    assert problems(text) == [f"{place}: materials.{rest.strip()}"]


@pytest.mark.parametrize(
    ("line", "column", "expected"),
    [
        pytest.param("sphere: 1, material: stone", 5, ".name: missing", id="no name"),
        pytest.param(
            "name: 'a{', sphere: 1, material: stone",
            12,
            ".name: 'a{', expected printable text without braces",
            id="brace in a name",
        ),
        pytest.param(
            'name: "\\t", sphere: 1, material: stone',
            12,
            ".name: '\\t', expected printable text without braces",
            id="blank name",
        ),
        pytest.param(
            "name: 3, sphere: 1, material: stone",
            12,
            ".name: 3, expected text",
            id="number as name",
        ),
        pytest.param("name: a, material: stone", 5, f": no shape, {SHAPES}", id="none"),
        pytest.param(
            "name: a, sphere: 1, box: [1, 1, 1], material: stone",
            5,
            f": ['box', 'sphere'], {SHAPES}",
            id="two shapes",
        ),
        pytest.param(
            "name: a, sphere: 0, material: stone",
            23,
            ".sphere: 0, expected more than 0",
            id="no size",
        ),
        pytest.param(
            "name: a, sphere: 1001, material: stone",
            23,
            ".sphere: 1001, expected at most 1000",
            id="too large",
        ),
        pytest.param(
            "name: a, sphere: true, material: stone",
            23,
            ".sphere: True, expected a number",
            id="truth as number",
        ),
        pytest.param(
            "name: a, box: [1, 1], material: stone",
            20,
            ".box: [1, 1], expected 3 entries",
            id="flat box",
        ),
        pytest.param(
            "name: a, cylinder: [1, -1], material: stone",
            29,
            ".cylinder.1: -1, expected more than 0",
            id="negative height",
        ),
        pytest.param(
            "name: a, sphere: 1, position: [0, 0, .inf], material: stone",
            43,
            ".position.2: '.inf', expected a finite number",
            id="infinite",
        ),
        pytest.param(
            "name: a, sphere: 1, position: [0, 2000, 0], material: stone",
            40,
            ".position.1: 2000, expected at most 1000",
            id="far away",
        ),
        pytest.param(
            "name: a, sphere: 200, position: [0, -900, 0], material: stone",
            5,
            ": 1100.0 m from the map's origin, expected at most 1000",
            id="reaches too far",
        ),
        pytest.param(
            "name: a, sphere: 1",
            5,
            ": no material, expected 'material' or, for a mesh, 'materials'",
            id="no material",
        ),
        pytest.param(
            "name: a, sphere: 1, material: ston",
            36,
            f".material: 'ston', expected one of ['leaf', 'sheet', 'stone']{LIBRARY}",
            id="unknown material",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, up_axis: y",
            52,
            ".up_axis: expected only for a mesh",
            id="axis of a sphere",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, yaw_deg: 3, rotation_deg: [1, 2, 3]",
            69,
            ".rotation_deg: expected either 'yaw_deg' or 'rotation_deg'",
            id="turned twice",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, colour: red",
            43,
            f".colour: unknown key, expected one of {KEYS}",
            id="unknown key",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, repeat: {count: 0, step: [0, 0, 1]}",
            59,
            ".repeat.count: 0, expected at least 1",
            id="no copies",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, repeat: {count: 2}",
            51,
            ".repeat.step: missing",
            id="no step",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone, repeat: {count: 1000000000,"
            " step: [0, 0, 1]}",
            59,
            ".repeat.count: 1000000000, expected at most 10000",
            id="too many copies",
        ),
        pytest.param(
            "name: a, sphere: 1, position: [1, 0, 0], material: stone,"
            " scatter: {count: 1, area: [[0, 0], [1, 1]], seed: 1}",
            36,
            ".position: [1, 0, 0], expected 0 for x and y, since 'scatter' has an area",
            id="scattered around a place",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone,"
            " scatter: {count: 1, area: [[0, 0], [-1, 1]], seed: 1}",
            69,
            ".scatter.area: [[0.0, 0.0], [-1.0, 1.0]], expected the lower corner first",
            id="corners in the wrong order",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone,"
            " scatter: {count: 1, area: [[0, 0], [1, 1]], seed: 1, scale: [2, 1]}",
            103,
            ".scatter.scale: [2.0, 1.0], expected the smaller one first",
            id="scales in the wrong order",
        ),
        pytest.param(
            "name: a, sphere: 1, material: stone,"
            " scatter: {count: 9, area: [[0, 0], [1, 1]], seed: 1, min_distance: 9}",
            52,
            ".scatter: the area is full after 1 copies, expected 9",
            id="full area",
        ),
        pytest.param(
            "name: a, mesh: meshes/oak.glb, material: stone",
            21,
            ".mesh: 'meshes/oak.glb', expected an existing file",
            id="missing file",
        ),
        pytest.param(
            "name: a, mesh: ../oak.glb, material: stone",
            21,
            ".mesh: '../oak.glb', expected a file in the map's own folder",
            id="file outside",
        ),
        pytest.param(
            "name: a, mesh: m.yaml, material: stone",
            21,
            ".mesh: 'm.yaml', expected one of"
            " ['.glb', '.gltf', '.obj', '.ply', '.stl']",
            id="another format",
        ),
        pytest.param(
            "name: a, mesh: meshes/broken.ply, material: stone",
            21,
            ".mesh: 'broken.ply': cannot be read as PLY: list index out of range",
            id="broken file",
        ),
        pytest.param(
            "name: a, mesh: meshes/line.obj, material: leaf",
            21,
            ".mesh: 'meshes/line.obj': no triangle of 'leaf' has an area",
            id="no area",
        ),
        pytest.param(
            "name: a, mesh: meshes/lid.obj, material: leaf",
            21,
            f".mesh: 'meshes/lid.obj': not closed: 4 edges have no partner, {CLOSED}",
            id="open volume",
        ),
        pytest.param(
            "name: a, mesh: meshes/double.obj, material: leaf",
            21,
            ".mesh: 'meshes/double.obj':"
            " 12 faces are present in both orientations, with nothing inside,"
            f" {CLOSED}",
            id="each face in both orientations",
        ),
        pytest.param(
            "name: a, mesh: meshes/flat.obj, material: leaf",
            21,
            ".mesh: 'meshes/flat.obj':"
            " 4 faces enclose no volume, as sheets with two sides,"
            f" {CLOSED}",
            id="flat",
        ),
        pytest.param(
            f"name: {'a' * 201}, sphere: 1, material: stone",
            12,
            f".name: '{'a' * 79}, expected at most 200 characters",
            id="endless name",
        ),
        pytest.param(
            "name: a, mesh: meshes/cube.obj, materials: {Leaves: lea}",
            58,
            ".materials.Leaves: 'lea',"
            f" expected one of ['leaf', 'sheet', 'stone']{LIBRARY}",
            id="unknown material of a mesh",
        ),
        pytest.param(
            "name: a, mesh: meshes/tree.obj, materials: {Leaves: leaf}",
            49,
            ".materials: missing 'Bark' of the file",
            id="a name without material",
        ),
        pytest.param(
            "name: a, mesh: meshes/cube.obj, materials: {Leaves: leaf, Twig: leaf}",
            70,
            ".materials.Twig: 'Twig', expected one of ['Leaves']",
            id="a name that is not in the file",
        ),
        pytest.param(
            "name: a, mesh: meshes/plain.obj, materials: {}",
            50,
            ".materials: no names in parts of the file, expected 'material'",
            id="a file without names",
        ),
    ],
)
def test_problem_of_an_object_has_place_and_expectation(
    line: str, column: int, expected: str
) -> None:
    assert problems(objects(line)) == [f"m.yaml:7:{column}: objects.0{expected}"]


@pytest.mark.parametrize(
    ("line", "column", "expected"),
    [
        pytest.param(
            "name: Start1, position: [0, 0, 0]",
            12,
            f".name: 'Start1', {START}",
            id="no known beginning",
        ),
        pytest.param(
            "name: Robot a, position: [0, 0, 0]",
            12,
            f".name: 'Robot a', {START}",
            id="blank",
        ),
        pytest.param(
            "name: Robot1b, position: [0, 0, 0]",
            12,
            f".name: 'Robot1b', {START}",
            id="letter behind digits",
        ),
        pytest.param(
            f"name: Robot{'1' * 36}, position: [0, 0, 0]",
            12,
            f".name: 'Robot{'1' * 36}', expected at most 40 characters",
            id="endless name",
        ),
        pytest.param("name: Robot1", 5, ".position: missing", id="nowhere"),
        pytest.param(
            "name: Robot1, position: [0, 0]",
            30,
            ".position: [0, 0], expected 3 entries",
        ),
        pytest.param(
            "name: Robot1, position: [0, 0, 0], yaw_deg: x",
            50,
            ".yaw_deg: 'x', expected a number",
        ),
    ],
)
def test_problem_of_a_start_has_place_and_expectation(
    line: str, column: int, expected: str
) -> None:
    text = f"version: 1\nstarts:\n  - {{{line}}}\n"
    assert problems(text) == [f"m.yaml:3:{column}: starts.0{expected}"]


def test_names_including_those_of_copies_are_unique() -> None:
    repeat = "repeat: {count: 3, step: [1, 0, 0]}"
    text = objects(
        "name: a_2, sphere: 1, material: leaf",
        f"name: a, sphere: 1, material: leaf, {repeat}",
        "name: a_2, sphere: -1, material: leaf",
    )
    text += "starts:\n"
    text += "  - {name: RobotA, position: [0, 0, 0]}\n"
    text += "  - {name: Robota, position: [0, 0, 0]}\n"
    assert problems(text) == [
        "m.yaml:8:12: objects.1.name: 'a_2', expected a name not used by objects.0",
        "m.yaml:9:25: objects.2.sphere: -1, expected more than 0",
        "m.yaml:9:12: objects.2.name: 'a_2', expected a name not used by objects.0",
        "m.yaml:12:12: starts.1.name: 'Robota', expected a name not used by starts.0",
    ]


def test_extent_of_all_objects_together_is_limited() -> None:
    text = objects(
        "name: a, box: [1, 1, 1], position: [-600, 0, 0], material: leaf",
        "name: b, box: [1, 1, 1], position: [600, 0, 0], material: leaf",
    )
    message = "1201.0 x 1.0 x 1.0 m, expected at most 1000 m in each direction"
    assert problems(text) == [f"m.yaml:7:3: objects: {message}"]


def test_number_of_triangles_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarsim.scene.map_file.MAX_TRIANGLES", 100)
    row = "box: [1, 1, 1], material: leaf, repeat: {count: 5, step: [1, 0, 0]}"
    text = objects(f"name: a, {row}", f"name: b, {row}")
    message = "60 triangles, expected at most 40 more"
    assert problems(text) == [f"m.yaml:8:5: objects.1: {message}"]


def test_all_problems_are_found_in_one_run() -> None:
    text = (
        "version: 3\n"
        "materials:\n"
        "  leaf: {density: -1}\n"
        "  moss: {density: 1}\n"
        "objects:\n"
        "  - {name: a, sphere: x, material: lea, colour: 1, scale: 2}\n"
        "  - stone\n"
        "  - {name: b, mesh: meshes/lid.obj, material: moss}\n"
        "  - {name: c, mesh: ../c.stl, yaw_deg: x, materials: {A: b}}\n"
        "starts: 7\n"
        "walls: !x 7\n"
    )
    places = [line.split(": ")[0:2] for line in problems(text)]
    assert places == [
        ["m.yaml:11:8", "walls"],
        ["m.yaml:1:10", "version"],
        ["m.yaml:10:9", "starts"],
        ["m.yaml:11:1", "walls"],
        ["m.yaml:3:19", "materials.leaf.density"],
        ["m.yaml:6:23", "objects.0.sphere"],
        ["m.yaml:6:36", "objects.0.material"],
        ["m.yaml:6:41", "objects.0.colour"],
        ["m.yaml:6:59", "objects.0.scale"],
        ["m.yaml:7:5", "objects.1"],
        ["m.yaml:8:21", "objects.2.mesh"],
        ["m.yaml:9:21", "objects.3.mesh"],
        ["m.yaml:9:58", "objects.3.materials.A"],
        ["m.yaml:9:40", "objects.3.yaw_deg"],
    ]


def test_file_name_that_is_not_a_valid_level_is_an_error() -> None:
    Path("my map.yaml").write_text("version: 1\n")
    with pytest.raises(MapError) as caught:
        load_map("my map.yaml")
    expected = "level: 'my map', expected ASCII without blanks and braces"
    assert str(caught.value) == f"my map.yaml:1:1: {expected}"


@pytest.mark.parametrize("name", ["nowhere", "nowhere.yaml", "meshes", "../m.yaml"])
def test_missing_map_is_an_error(name: str) -> None:
    with pytest.raises(MapError) as caught:
        load_map(name)
    shipped = list(shipped_maps())
    expected = f"{name}: no such file, expected a map file or one of {shipped}"
    assert caught.value.problems == [expected]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        pytest.param("x" * 5000, "'" + "x" * 79, id="endless"),
        pytest.param("a/" * 100, "'" + "a/" * 39 + "a", id="long"),
        pytest.param("a\0b", "'a\\x00b'", id="NUL"),
        pytest.param("a\nb", "'a\\nb'", id="two lines"),
        pytest.param("\ud800", "'\\ud800'", id="no text"),
    ],
)
def test_error_for_any_missing_map_is_one_short_line(name: str, text: str) -> None:
    with pytest.raises(MapError) as caught:
        load_map(name)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{text}: no such file, expected a map file or one of [")


def test_unreadable_map_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    Path("m.yaml").write_text("version: 1\n")
    monkeypatch.setattr(Path, "open", refuse)  # root may read everything
    with pytest.raises(MapError) as caught:
        load_map("m.yaml")
    assert caught.value.problems == ["m.yaml: permission denied, expected a map file"]


def test_map_of_primitives_does_not_import_trimesh() -> None:
    code = (
        "import sys; from radarsim.scene.map_file import load_map;"
        "load_map('foliage_room'); sys.exit('trimesh' in sys.modules)"
    )
    root = Path(radarsim.__file__).parents[1]
    run = subprocess.run([sys.executable, "-c", code], cwd=root, check=False)
    assert run.returncode == 0
