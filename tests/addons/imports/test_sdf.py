"""Worlds of Gazebo become maps with the same ranges."""

import math
import random
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from collada_files import box_file, two_boxes_file
from commands import Run, run_in_process

import radarsim
from radarsim.addons.imports import sdf
from radarsim.errors import install_command

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
    "other XML": "<robot/>",
    "foreign entities": FOREIGN,
    "words": WORLD.format(SHAPES.replace("0.4 0.6 1", "a b c")),
    "two numbers": WORLD.format(SHAPES.replace("0.4 0.6 1", "0.4 0.6")),
    "negative": WORLD.format(SHAPES.replace("0.4 0.6 1", "0.4 -0.6 1")),
    "infinite": WORLD.format(SHAPES.replace("1 0 0.5 0 0 0.3", "1e999 0 0 0 0 0")),
    "no radius": WORLD.format(SHAPES.replace("radius", "diameter")),
    "nothing in it": WORLD.format(""),
    "deep": WORLD.format("<model name='a'>" * 200 + "</model>" * 200),
}


def model(shape: str, more: str = "") -> str:
    """Return a model with a collision of a shape, or with none."""
    geometry = f"<geometry>{shape}</geometry>"
    link = f"<collision name='c'>{geometry}</collision>" * bool(shape) + more
    return f"<model name='m'><static>1</static><link name='l'>{link}</link></model>"


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_ranges_are_those_of_the_map_written_by_hand(
    import_world: Import, tmp_path: Path
) -> None:
    done = import_world(SHAPES)
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


def test_omissions_are_reported_with_their_line(
    import_world: Import, tmp_path: Path
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
    lines = import_world(SHAPES + more).text.splitlines()
    for word in (
        *("model://tree", "<light>", "static object", "<plane>", "<heightmap>"),
        *("a.dae", "../a.stl", "relative to 'f'"),
    ):
        assert sum(word in line for line in lines) == 1
    assert all(line.startswith(f"{tmp_path / 'w.sdf'}:") for line in lines)


def test_included_models_are_found_below_the_model_path(
    import_world: Import, tmp_path: Path
) -> None:
    models = tmp_path / "models"
    (models / "shape").mkdir(parents=True)
    shapes = f"<sdf><model name='m'><static>1</static>{SHAPES}</model></sdf>"
    (models / "shape" / "model.sdf").write_text(shapes)
    include = "<include><uri>model://{}</uri><pose>5 0 0 0 0 0</pose></include>"
    option = "--model-path", str(models)
    assert import_world(include.format("shape") * 2, *option).text == ""
    scene = radarsim.load_map(tmp_path / "map.yaml")
    assert len({part.object_name for part in scene.parts}) == 6
    models.rename(tmp_path / "other")
    models.mkdir()
    outside = SHAPES + include.format("../other/shape")
    assert "see --model-path" in import_world(outside, *option).text


def test_many_models_in_each_other_are_no_loop(
    import_file: Import, tmp_path: Path
) -> None:
    def chain(length: int, last: str) -> Run:
        for number in range(length):
            inner = f"<include><uri>{number + 1}.sdf</uri></include>"
            text = last if number == length - 1 else inner
            text = f"<sdf><model name='m{number}'>{text}</model></sdf>"
            (tmp_path / f"{number}.sdf").write_text(text)
        return import_file(tmp_path / "0.sdf")

    box = SHAPES.partition("</model>")[0].partition("<link")[2]
    assert chain(15, f"<link{box}").code == 0
    loop = chain(15, "<include><uri>3.sdf</uri></include>")
    assert "14.sdf:1: '3.sdf' includes itself" in loop.err
    assert "more than 100 levels of nested models and includes" in chain(150, "").err


def test_includes_that_double_are_refused(
    import_file: Import, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sdf, "MAX_INCLUDED", 200)  # 2000000 take seconds
    for number in range(20):
        twice = f"<include><uri>{number + 1}.sdf</uri></include>" * 2
        text = f"<sdf><model name='m'>{twice}</model></sdf>"
        (tmp_path / f"{number}.sdf").write_text(text)
    (tmp_path / "20.sdf").write_text("<sdf/>")
    assert "more than 200 elements in includes" in import_file(tmp_path / "0.sdf").err


@pytest.mark.parametrize("name", WRONG)
def test_wrong_file_is_reported_with_its_line(
    name: str, import_file: Import, tmp_path: Path
) -> None:
    path = write(tmp_path / "w.sdf", WRONG[name])
    done = import_file(path)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert done.err.startswith(f"radarsim: {path}:")


class Thing(NamedTuple):
    """A model of a world that is written at random.

    Attributes:
        collision: The shape of its collision; empty for none.
        size: Size of the box that it becomes, m; None if it is left out.
        file: Name of its mesh file.
        content: Its content; empty if there is none.
    """

    collision: str
    size: tuple[float, float, float] | None = None
    file: str = ""
    content: str = ""


def mesh(
    name: str,
    content: str,
    size: tuple[float, float, float] | None = None,
    more: str = "",
) -> Thing:
    uri = f"<uri>model://{{}}/meshes/{name}</uri>"
    return Thing(f"<mesh>{uri}{more}</mesh>", size, name, content)


DAE = box_file((0.4, 0.6, 1))
PART = "<submesh><name>left</name><center>true</center></submesh>"
SIZE = (0.4, 0.6, 1)
THINGS = {
    "box": Thing("<box><size>0.4 0.6 1</size></box>", SIZE),
    "triangles": mesh("a.dae", DAE, SIZE),
    "polylist": mesh("b.DAE", box_file(SIZE, "polylist", unit=0.01), SIZE),
    "polygons": mesh("c.dae", box_file(SIZE, "polygons", unit=0.0254), SIZE),
    "scaled": mesh("d.dae", DAE, (0.2, 0.3, 0.5), "<scale>.5 .5 .5</scale>"),
    "stretched": mesh("e.dae", DAE, (0.8, 0.6, 0.5), "<scale>2 1 .5</scale>"),
    "mirrored": mesh("f.dae", DAE, SIZE, "<scale>-1 1 1</scale>"),
    "part": mesh("g.dae", two_boxes_file((1, 0.5, 1), 8), (1, 0.5, 1), PART),
    "other part": mesh("h.dae", DAE, None, PART),
    "cut off": mesh("i.dae", DAE[:2000]),
    "entities": mesh("j.dae", f"{BOMB[:38]}{DAE[38:]}"),
    "blend": mesh("k.blend", "BLENDER"),
    "missing": mesh("l.dae", ""),
    "heightmap": Thing("<heightmap/>"),
    "visual": Thing(""),
}


@pytest.mark.parametrize("seed", range(20))
def test_worlds_with_meshes_are_imported_or_what_is_left_out_is_named(
    import_world: Import, tmp_path: Path, seed: int
) -> None:
    rng = random.Random(seed)
    models, by_hand, left_out = tmp_path / "elsewhere", [], []
    text = "<include><uri>model://sun</uri></include><light name='l'/>"
    count = rng.randint(3, 12)
    for number in range(count):
        name, thing = f"thing_{number}x", THINGS[rng.choice(list(THINGS))]
        angle, yaw = 2 * math.pi * number / count, rng.uniform(-3, 3)
        x, y = 5 * math.cos(angle), 5 * math.sin(angle)
        (models / name / "meshes").mkdir(parents=True)
        if thing.content:
            (models / name / "meshes" / thing.file).write_text(thing.content)
        content = model(thing.collision.format(name), "<visual name='v'/>")
        (models / name / "model.sdf").write_text(f"<sdf>{content}</sdf>")
        pose = f"<pose>{x} {y} 0.5 0 0 {yaw}</pose>"
        uri = f"<uri>model://{name}</uri><name>{name}</name>"
        text += f"<include>{uri}{pose}</include>"
        if thing.size is None:
            left_out.append(name)
        else:
            keys = f"box: {[*thing.size]}, position: [{x}, {y}, 0.5]"
            turned = f"yaw_deg: {math.degrees(yaw)}, material: concrete"
            by_hand.append(f"  - {{name: {name}, {keys}, {turned}}}\n")
    done = import_world(text, "--model-path", str(models))
    assert done.code == int(2 * len(left_out) > count)
    summary = done.err.splitlines()[-1]
    assert f"{len(left_out)} of {count} models left out" in summary
    named = set(re.findall(r"thing_\d+x", done.text))
    assert named == set(left_out)
    assert len(by_hand) == count - len(left_out) > 0
    models.rename(tmp_path / "gone")  # the map has all that it needs
    own = f"version: 1\nobjects:\n{''.join(by_hand)}"
    first = radarsim.load_map(write(tmp_path / "own.yaml", own))
    second = radarsim.load_map(tmp_path / "map.yaml")
    laser = radarsim.load_sensor("laser", fov_deg=360, resolution_deg=0.5)
    for z in (0.4, 0.9):
        expected, got = (
            laser.scan(scene, (0, 0, z), radarsim.generator_for(0, "test")).ranges
            for scene in (first, second)
        )
        np.testing.assert_allclose(got, expected, atol=1e-3)


def test_summary_gives_the_reasons_and_how_to_read_collada(
    import_world: Import, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "house.dae", DAE)
    dae = model("<mesh><uri>house.dae</uri></mesh>")
    ball = model("<sphere><radius>1</radius></sphere>")
    absent = "<include><uri>model://tree</uri></include>"
    world = 40 * dae + 22 * absent + 2 * ball
    monkeypatch.setitem(sys.modules, "collada", None)
    done = import_world(world)
    assert done.code == 1
    reasons = (
        f"40 .dae without pycollada ({install_command('collada')}), "
        "22 not found (see --model-path)"
    )
    assert done.err.endswith(f"\nradarsim: 62 of 64 models left out: {reasons}\n")
    assert len(radarsim.load_map(tmp_path / "map.yaml").parts) == 2
    nothing = import_world(40 * dae)
    reason = reasons.partition(", ")[0]
    text = "no objects for a map: 40 of 40 models left out"
    assert nothing.err == f"radarsim: {tmp_path / 'w.sdf'}: {text}: {reason}\n"
    monkeypatch.undo()
    strict = import_world(world, "--strict")
    assert (strict.code, (tmp_path / "map.yaml").exists()) == (1, False)
    assert "22 of 64 models left out" in strict.err
    whole = import_world(world)
    assert whole.code == 0
    assert len([*(tmp_path / "map_meshes").iterdir()]) == 1  # a copy for all
    assert "22 of 64 models left out: 22 not found" in whole.err


def test_mesh_that_no_map_can_have_is_left_out_alone(
    import_world: Import, tmp_path: Path
) -> None:
    write(tmp_path / "good.dae", DAE)
    write(tmp_path / "nan.dae", DAE.replace("<scale>1 1 1<", "<scale>nan 1 1<"))
    write(tmp_path / "flat.dae", DAE.replace("<scale>1 1 1<", "<scale>0 0 0<"))
    world = "".join(
        model(f"<mesh><uri>{name}.dae</uri><scale>{scale}</scale></mesh>")
        for name, scale in (
            *(("good", "1 1 1"), ("good", "2 1 1"), ("good", "1 2 1")),
            *(("nan", "1 1 1"), ("flat", "1 1 1"), ("good", "1e99 1 1")),
        )
    )
    done = import_world(world)
    assert done.code == 0
    assert "3 of 6 models left out: 3 .dae that cannot be used" in done.err
    assert done.text.count("a vertex has a coordinate of nan") == 1
    assert done.text.count("a vertex has a coordinate of 2e+98") == 1
    assert done.text.count("all triangles have an area of 0") == 1
    assert len(radarsim.load_map(tmp_path / "map.yaml").parts) == 3


def test_meshes_of_other_formats_are_copied(
    import_world: Import, tmp_path: Path
) -> None:
    (tmp_path / "models" / "m").mkdir(parents=True)
    solid = trimesh.creation.box((0.4, 0.6, 1))
    for ending in ("stl", "obj", "ply", "glb"):
        solid.export(tmp_path / "models" / "m" / f"box.{ending}")
        uri = f"<uri>model://m/box.{ending}</uri><scale>1 1 2</scale>"
        content = model(f"<mesh>{uri}</mesh>")
        done = import_world(content, "--model-path", str(tmp_path / "models"))
        assert done.code == 0
        low, high = radarsim.load_map(tmp_path / "map.yaml").bounds
        assert [*low, *high] == pytest.approx([-0.2, -0.3, -1, 0.2, 0.3, 1])


def test_folder_of_meshes_that_exists_is_kept(tmp_path: Path) -> None:
    write(tmp_path / "house.dae", DAE)
    content = WORLD.format(model("<mesh><uri>house.dae</uri></mesh>"))
    path = write(tmp_path / "w.sdf", content)
    (tmp_path / "map_meshes").mkdir()
    write(tmp_path / "map_meshes" / "house_1.glb", "mine")
    done = run_in_process("import", str(path), "-o", str(tmp_path / "map.yaml"))
    assert done.code == 2
    assert "map_meshes" in done.err
    assert (tmp_path / "map_meshes" / "house_1.glb").read_text() == "mine"
    assert not (tmp_path / "map.yaml").exists()


def test_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    world, mine = tmp_path / "world.sdf", tmp_path / "mine.yaml"
    world.write_text("<sdf version='1.9'><world name='w'/></sdf>")
    mine.write_text("mine")
    done = run_in_process("import", str(world), "-o", str(mine))
    assert done.code == 2
    assert "expected the name of a new file" in done.err
    assert mine.read_text() == "mine"
