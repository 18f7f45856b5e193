"""Problems of objects in map files."""

from pathlib import Path

import pytest
from map_texts import objects, problems

from radarsim.scene.material import library_names

pytestmark = pytest.mark.usefixtures("mesh_folder")
KEYS = (
    "['box', 'cylinder', 'material', 'materials', 'mesh', 'name', 'position',"
    " 'reflector', 'repeat', 'rotation_deg', 'scale', 'scatter', 'sphere', 'up_axis',"
    " 'yaw_deg']"
)
SHAPES = "expected one of ['box', 'cylinder', 'mesh', 'reflector', 'sphere']"
LIBRARY = f", or of the library, {list(library_names())}"
CLOSED = "expected a closed volume, since beams enter 'leaf', which has no sheet_loss"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "name: ^'a{', sphere: 1, material: stone",
            ".name: 'a{', expected printable text without braces",
        ),
        ("name: a, material: stone", f": no shape, {SHAPES}"),
        (
            "name: a, sphere: 200, position: [0, -900, 0], material: stone",
            ": 1100.0 m from the map's origin, expected at most 1000 m",
        ),
        (
            "name: a, sphere: 1",
            ": no material, expected 'material' or, for a mesh, 'materials'",
        ),
        (
            "name: a, sphere: 1, material: ^ston",
            ".material: 'ston' (did you mean 'stone'?),"
            f" expected one of ['leaf', 'sheet', 'stone']{LIBRARY}",
        ),
        (
            "name: a, sphere: 1, material: stone, up_axis: ^y",
            ".up_axis: expected only for a mesh",
        ),
        (
            "name: a, sphere: 1, material: stone, yaw_deg: 3, rotation_deg: ^[1, 2, 3]",
            ".rotation_deg: expected either 'yaw_deg' or 'rotation_deg'",
        ),
        (
            "name: a, sphere: 1, material: stone, ^colour: red",
            f".colour: unknown key, expected one of {KEYS}",
        ),
        (
            "name: a, sphere: 1, material: stone, repeat: {count: ^1000000000,"
            " step: [0, 0, 1]}",
            ".repeat.count: 1000000000, expected at most 10000",
        ),
        (
            "name: a, sphere: 1, position: ^[1, 0, 0], material: stone,"
            " scatter: {count: 1, area: [[0, 0], [1, 1]], seed: 1}",
            ".position: [1, 0, 0], expected 0 for x and y, since 'scatter' has an area",
        ),
        (
            "name: a, sphere: 1, material: stone,"
            " scatter: {count: 1, area: ^[[0, 0], [-1, 1]], seed: 1}",
            ".scatter.area: [[0.0, 0.0], [-1.0, 1.0]], expected the lower corner first",
        ),
        (
            "name: a, sphere: 1, material: stone,"
            " scatter: {count: 1, area: [[0, 0], [1, 1]], seed: 1, scale: ^[2, 1]}",
            ".scatter.scale: [2.0, 1.0], expected the smaller number first",
        ),
        (
            "name: a, sphere: 1, material: stone,"
            " scatter: ^{count: 9, area: [[0, 0], [1, 1]], seed: 1, min_distance: 9}",
            ".scatter: the area is full after 1 copies, expected 9",
        ),
        (
            "name: a, mesh: ^meshes/oak.glb, material: stone",
            ".mesh: 'meshes/oak.glb', expected an existing file",
        ),
        (
            "name: a, mesh: ^../oak.glb, material: stone",
            ".mesh: '../oak.glb', expected a file in the map's own folder",
        ),
        (
            "name: a, mesh: ^m.yaml, material: stone",
            ".mesh: 'm.yaml', expected one of"
            " ['.glb', '.gltf', '.obj', '.ply', '.stl']",
        ),
        (
            "name: a, mesh: ^meshes/line.obj, material: leaf",
            ".mesh: 'meshes/line.obj': all triangles of 'leaf' have an area of 0",
        ),
        (
            "name: a, mesh: ^meshes/lid.obj, material: leaf",
            f".mesh: 'meshes/lid.obj': not closed: 4 unmatched edges, {CLOSED}",
        ),
        (
            "name: a, mesh: ^meshes/double.obj, material: leaf",
            ".mesh: 'meshes/double.obj':"
            " 12 faces occur in both orientations and enclose no volume,"
            f" {CLOSED}",
        ),
        (
            "name: a, mesh: meshes/tree.obj, materials: ^{Leaves: leaf}",
            ".materials: no material for 'Bark' in the mesh file",
        ),
        (
            "name: a, mesh: meshes/cube.obj, materials: {Leaves: leaf, Twig: ^leaf}",
            ".materials.Twig: 'Twig', expected one of ['Leaves']",
        ),
        (
            "name: a, mesh: meshes/plain.obj, materials: ^{}",
            ".materials: the mesh has parts without a material, expected 'material'",
        ),
    ],
)
def test_problem_of_an_object_has_place_and_expectation(
    line: str, expected: str
) -> None:
    """The place is that of the mark, or that of the object."""
    place = f"m.yaml:7:{6 + line.find('^')}"
    found = problems(objects(line.replace("^", "")))
    assert found == [f"{place}: objects.0{expected}"]


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


def test_only_the_first_of_many_unknown_materials_of_a_mesh_are_reported() -> None:
    given = ", ".join(f"Leavez{i}: leaf" for i in range(103))
    line = f"name: a, mesh: meshes/cube.obj, materials: {{Leaves: leaf, {given}}}"
    found = problems(objects(line))
    text = "'Leavez99' (did you mean 'Leaves'?), expected one of ['Leaves']"
    assert text in found[-2]
    assert found[-1].endswith("1 more problems")


def test_name_of_a_material_in_a_message_is_limited(mesh_folder: Path) -> None:
    text = f"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {'x' * 10_000}\nf 1 2 3\n"
    (mesh_folder / "meshes" / "long.obj").write_text(text)
    (found,) = problems(objects("name: a, mesh: meshes/long.obj, materials: {}"))
    assert len(found) < 200
