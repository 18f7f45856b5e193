"""Problems of map files: the top level, materials and starts."""

import pytest
from map_texts import problems

pytestmark = pytest.mark.usefixtures("mesh_folder")
START = "expected Robot, Player, ComSt or Point, then letters, then digits"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param(
            "",
            "m.yaml:1:1: nothing in the file, expected keys like 'version' and"
            " 'objects'",
            id="empty",
        ),
        (
            "version: 1\nobjects: [{name: a, sphere: '1,5', material: concrete}]",
            "m.yaml:2:29: objects.0.sphere: '1,5', expected a number"
            " with a decimal point, 1.5",
        ),
        ("version: 2", "m.yaml:1:10: version: 2, expected 1"),
        ("level: x", "m.yaml:1:1: version: missing"),
        (
            "version: 1\nlevel: a b",
            "m.yaml:2:8: level: 'a b', expected ASCII without blanks and braces",
        ),
        (
            "version: 1\nmaterials: {m: {}}",
            "m.yaml:2:16: materials.m.density: missing, expected 'opaque' or a number",
        ),
        (
            "version: 1\nwalls: 3",
            "m.yaml:2:1: walls: unknown key,"
            " expected one of ['air', 'crates', 'gps_origin_deg', 'level', 'materials',"
            " 'objects', 'starts', 'tags', 'trial', 'variants', 'version', 'victims']",
        ),
    ],
)
def test_problem_of_the_top_level_or_a_material_has_place_and_expectation(
    text: str, expected: str
) -> None:
    assert problems(text) == [expected]


@pytest.mark.parametrize(
    ("line", "column", "expected"),
    [
        ("name: Start1, position: [0, 0, 0]", 12, f".name: 'Start1', {START}"),
        (
            f"name: Robot{'1' * 36}, position: [0, 0, 0]",
            12,
            f".name: 'Robot{'1' * 36}', expected at most 40 characters",
        ),
        ("name: Robot1", 5, ".position: missing"),
    ],
)
def test_problem_of_a_start_has_place_and_expectation(
    line: str, column: int, expected: str
) -> None:
    text = f"version: 1\nstarts:\n  - {{{line}}}\n"
    assert problems(text) == [f"m.yaml:3:{column}: starts.0{expected}"]


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
        ["m.yaml:9:21", "objects.3.mesh"],
        ["m.yaml:9:58", "objects.3.materials.A"],
        ["m.yaml:9:40", "objects.3.yaw_deg"],
        ["m.yaml:8:21", "objects.2.mesh"],
    ]
