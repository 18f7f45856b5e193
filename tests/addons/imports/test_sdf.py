"""Worlds of Gazebo become maps with the same ranges."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commands import Run, run_in_process

import radarsim

Import = Callable[..., Run]

SHAPES = """
<model name="box"><static>true</static><pose>1 0 0.5 0 0 0.3</pose><link name="l">
  <pose>0.5 0 0 0 0 0</pose>
  <collision name="c"><pose degrees="true">0 0.2 0 0 0 30</pose>
    <geometry><box><size>0.4 0.6 1</size></box></geometry></collision></link></model>
<model name="pole"><static>1</static><pose rotation_format="quat_xyzw">-2 1 0.5
    0 0 0.70710678 0.70710678</pose><link name="l"><collision name="c">
    <geometry><cylinder><radius>0.3</radius><length>1</length></cylinder></geometry>
  </collision></link></model>
<model name="ball"><static>true</static><pose>0 -3 0.3 0 0 0</pose>
  <model name="inner"><pose>0.5 0 0 0 0 0</pose><link name="l"><collision name="c">
    <geometry><sphere><radius>0.4</radius></sphere></geometry></collision></link></model>
</model>
"""
# The same, written by hand.
BY_HAND = """
version: 1
objects:
  - {name: box, box: [0.4, 0.6, 1], material: concrete, yaw_deg: 47.18873385,
     position: [1.41856420, 0.33882761, 0.5]}
  - {name: pole, cylinder: [0.3, 1], material: concrete, position: [-2, 1, 0.5],
     yaw_deg: 90}
  - {name: ball, sphere: 0.4, material: concrete, position: [0.5, -3, 0.3]}
starts: [{name: RobotStart1, position: [0, 0, 0]}]
"""
WORLD = '<?xml version="1.0"?>\n<sdf version="1.9"><world name="w">{}</world></sdf>\n'
BOMB = '<!DOCTYPE a [<!ENTITY a "aaaa">]>\n<sdf>&a;</sdf>'
FOREIGN = '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n<sdf>&a;</sdf>'
WRONG = {
    "cut off": WORLD.format(SHAPES)[:300],
    "no XML": "world w\n",
    "empty": "",
    "other XML": "<robot/>",
    "entities": BOMB,
    "foreign entities": FOREIGN,
    "words": WORLD.format(SHAPES.replace("0.4 0.6 1", "a b c")),
    "two numbers": WORLD.format(SHAPES.replace("0.4 0.6 1", "0.4 0.6")),
    "negative": WORLD.format(SHAPES.replace("0.4 0.6 1", "0.4 -0.6 1")),
    "infinite": WORLD.format(SHAPES.replace("1 0 0.5 0 0 0.3", "1e999 0 0 0 0 0")),
    "no radius": WORLD.format(SHAPES.replace("radius", "diameter")),
    "nothing in it": WORLD.format(""),
    "deep": WORLD.format("<model name='a'>" * 200 + "</model>" * 200),
    "no text": "\x00\x01",
}


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_ranges_are_those_of_the_map_written_by_hand(
    import_file: Import, tmp_path: Path
) -> None:
    done = import_file(write(tmp_path / "w.sdf", WORLD.format(SHAPES)))
    assert (done.code, done.text.strip()) == (0, "")
    own = radarsim.load_map(write(tmp_path / "own.yaml", BY_HAND))
    scene = radarsim.load_map(tmp_path / "map.yaml")
    laser = radarsim.load_sensor("laser", fov_deg=360, resolution_deg=1)
    for pose in ((0, 0, 0.3), (-1, -2, 0.3)):
        first, second = (
            laser.scan(each, pose, radarsim.generator_for(0, "test")).ranges
            for each in (own, scene)
        )
        assert np.isfinite(first).any()
        np.testing.assert_allclose(second, first, atol=1e-3)


def test_what_is_left_out_is_told_with_its_line(
    import_file: Import, tmp_path: Path
) -> None:
    more = """
<include><uri>model://tree</uri></include>
<light name="sun"/>
<model name="m"><link name="l">
  <collision name="a"><geometry><plane/></geometry></collision>
  <collision name="b"><geometry><heightmap/></geometry></collision>
  <collision name="c"><geometry><mesh><uri>a.dae</uri></mesh></geometry></collision>
  <collision name="d"><geometry><mesh><uri>../a.stl</uri></mesh></geometry></collision>
  <collision name="e"><pose relative_to="f"/><geometry><box/></geometry></collision>
</link></model>"""
    path = write(tmp_path / "w.sdf", WORLD.format(SHAPES + more))
    done = import_file(path)
    lines = done.text.splitlines()
    for word in ("--model-path", "<light>", "stands still", "<plane>", "<heightmap>"):
        assert sum(word in line for line in lines) == 1
    for word in ("a.dae", "../a.stl", "relative to 'f'"):
        assert sum(word in line for line in lines) == 1
    assert all(line.startswith(f"{path}:") for line in lines)


def test_included_models_are_found_below_the_model_path(
    import_file: Import, tmp_path: Path
) -> None:
    models = tmp_path / "models"
    (models / "shape").mkdir(parents=True)
    (models / "shape" / "model.sdf").write_text(f"<sdf>{SHAPES}</sdf>")
    include = "<include><uri>model://{}</uri><pose>5 0 0 0 0 0</pose></include>"
    path = write(tmp_path / "w.sdf", WORLD.format(include.format("shape") * 2))
    assert import_file(path, "--model-path", str(models)).text == ""
    scene = radarsim.load_map(tmp_path / "map.yaml")
    assert len({part.object_name for part in scene.parts}) == 6
    models.rename(tmp_path / "other")
    models.mkdir()
    path.write_text(WORLD.format(SHAPES + include.format("../other/shape")))
    assert "see --model-path" in import_file(path, "--model-path", str(models)).text


def test_model_that_includes_itself_is_an_error(
    import_file: Import, tmp_path: Path
) -> None:
    (tmp_path / "a").mkdir()
    text = "<sdf><model name='a'><include><uri>model://a</uri></include></model></sdf>"
    path = write(tmp_path / "a" / "model.sdf", text)
    done = import_file(path, "--model-path", str(tmp_path))
    assert "includes itself" in done.err


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_told_with_its_line(
    name: str, import_file: Import, tmp_path: Path
) -> None:
    path = write(tmp_path / "w.sdf", WRONG[name])
    done = import_file(path)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}:")


def test_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    world, mine = tmp_path / "world.sdf", tmp_path / "mine.yaml"
    world.write_text("<sdf version='1.9'><world name='w'/></sdf>")
    mine.write_text("mine")
    done = run_in_process("import", str(world), "-o", str(mine))
    assert done.code == 2
    assert "expected the name of a new file" in done.err
    assert mine.read_text() == "mine"
