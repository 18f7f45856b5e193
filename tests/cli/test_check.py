from pathlib import Path

import pytest
from commands import run_in_process as radarsim

WRONG = """\
version: 1
materials:
  leaf: {density: -1}
objects:
  - {name: bush, sphere: 1.0, position: [0, 0, 0], material: laef}
starts: []
"""


def test_contents_of_a_map_are_printed() -> None:
    run = radarsim("check", "foliage_room")
    assert run.code == 0
    for text in ("16 objects", "foliage: density 0.7", "bush_7", "RobotStart1"):
        assert text in run.text
    assert run.err == ""


def test_every_error_is_printed_with_line_and_key(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(WRONG)
    run = radarsim("check", path)
    assert run.code == 1
    lines = run.text.splitlines()
    assert any(line.startswith(f"{path}:3:") and "density" in line for line in lines)
    assert any(line.startswith(f"{path}:5:") and "material" in line for line in lines)


OCCUPIED = """\
version: 1
materials:
  wall: {density: opaque}
objects:
  - {name: wall, box: [0.2, 4, 2], position: [0, 0, 1], material: wall}
  - {name: fence, box: [30, 30, 2], position: [0, 0, 1], material: wall,
     repeat: {count: 1, step: [0, 0, 0]}}
starts:
  - {name: RobotStart1, position: [5, 5, 0]}
  - {name: RobotStart2, position: [0, 0, 0]}
  - {name: RobotStart3, position: [5, 5, 0]}
"""


def test_occupied_starts_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "occupied.yaml"
    path.write_text(OCCUPIED)
    lines = radarsim("check", path).text.splitlines()
    at = lines.index("starts that are not free")
    assert len(lines) == at + 2
    expected = "  RobotStart2: occupied by wall; a P3AT would be placed at x "
    assert lines[at + 1].startswith(expected)


VARIED = """\
version: 1
starts: [{name: RobotStart1, position: [0, 0, 0]}]
variants:
  dust: {air: dust}
  rain: {air: rain}
"""


def test_variants_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(VARIED)
    lines = radarsim("check", path).text.splitlines()
    assert lines[-3:] == ["variants", "  yard@dust", "  yard@rain"]
    chosen = radarsim("check", f"{path}@rain")
    assert chosen.text.startswith("map yard@rain, level yard\n")
    assert "air: rain" in chosen.text
    assert "variants" not in chosen.text


def test_errors_in_any_variant_are_found(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(VARIED.replace("air: rain", "air: ran"))
    run = radarsim("check", path)
    assert run.code == 1
    meant = "'ran' (did you mean 'rain'?), expected"
    assert run.text.startswith(f"{path}:5:15: variants.rain.air: {meant}")
    assert radarsim("check", f"{path}@dust").code == 0


NO_PATH = """\
version: 1
materials: {wall: {density: opaque}}
objects:
  - {name: wall, box: [0.2, 20, 2], position: [2, 0, 1], material: wall}
  - {name: north, box: [20, 0.2, 2], position: [0, 5, 1], material: wall}
  - {name: south, box: [20, 0.2, 2], position: [0, -5, 1], material: wall}
  - {name: west, box: [0.2, 20, 2], position: [-5, 0, 1], material: wall}
starts: [{name: RobotStart1, position: [0, 0, 0]}]
trial: {start: RobotStart1, goal: [4, 0], safety_distance: 0.5}
"""


@pytest.mark.parametrize("text", [OCCUPIED, NO_PATH])
def test_strict_check_fails_for_warnings(tmp_path: Path, text: str) -> None:
    path = tmp_path / "room.yaml"
    path.write_text(text)
    loose, strict = (radarsim("check", path, *o) for o in ((), ("--strict",)))
    assert (loose.code, strict.code) == (0, 1)
    assert loose.text == strict.text


def test_goal_in_something_is_reported_with_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "room.yaml"
    path.write_text(
        "version: 1\n"
        "objects:\n"
        "  - {name: pillar, box: [1, 1, 2], position: [3, 0, 1], material: concrete}\n"
        "starts: [{name: RobotStart1, position: [-3, 0, 0]}]\n"
        "trial: {start: RobotStart1, goal: [2.6, 0], safety_distance: 0.5}\n"
    )
    run = radarsim("check", path)
    assert "goal 2.60 0.00: occupied by pillar" in run.text


def test_plan_is_drawn_into_a_file_beside_the_summary(tmp_path: Path) -> None:
    path = tmp_path / "plan.pdf"
    run = radarsim("check", "empty_room", "--plot", path)
    assert run.code == 0
    assert f"wrote {path}" in run.err
    assert run.text == radarsim("check", "empty_room").text
    assert path.read_bytes().startswith(b"%PDF")
