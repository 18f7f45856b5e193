"""Loading of map files: valid maps, and files that are missing or unreadable."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from map_texts import load, objects

from radarsim.errors import MapError
from radarsim.geometry import Pose3
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.scene.material import OPAQUE, Material

pytestmark = pytest.mark.usefixtures("mesh_folder")


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


@pytest.mark.parametrize(
    ("stem", "level"),
    [
        ("m", "m"),
        ("m.v2(b)", "m.v2(b)"),
        ("my room", "my_room"),
        ("büro", "b_ro"),
        ("room (copy)", "room__copy_"),
        ("{a}", "_a_"),
        ("x" * 250, "x" * 197),
    ],
)
def test_level_defaults_to_the_stem_of_the_file(
    tmp_path: Path, stem: str, level: str
) -> None:
    path = tmp_path / f"{stem}.yaml"
    path.write_text("version: 1\n")
    assert (load_map(path).name, load_map(path).level) == (stem, level)


def test_sections_may_be_empty() -> None:
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


@pytest.mark.parametrize("name", ["nowhere", "nowhere.yaml", "../m.yaml"])
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
        pytest.param("a/" * 100, "a/" * 100, id="long"),
        pytest.param("a\0b", "'a\\x00b'", id="NUL"),
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
    assert caught.value.problems == ["m.yaml: no permission, expected a map file"]


def test_folder_is_named_as_a_folder() -> None:
    with pytest.raises(MapError, match="meshes: a folder, expected a map file"):
        load_map("meshes")


def test_map_in_a_folder_without_permission_differs_from_a_missing_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stat = Path.stat

    def refuse(path: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        if path.parent.name == "closed":
            raise PermissionError(13, "Permission denied")
        return stat(path, follow_symlinks=follow_symlinks)

    monkeypatch.setattr(Path, "stat", refuse)  # root may enter every folder
    with pytest.raises(MapError, match=r"m\.yaml: no permission, expected a map file"):
        load_map("closed/m.yaml")


def test_path_of_no_regular_file_is_reported_as_such(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    with pytest.raises(
        MapError, match=r"pipe\.yaml: not a regular file, expected a map"
    ):
        load_map(pipe)
