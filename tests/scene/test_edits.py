"""Scenes are changed, written and read again in Python."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarsim
from radarsim.errors import MapError
from radarsim.scene.build import make_material
from radarsim.scene.map_file import load_map, shipped_maps
from radarsim.scene.map_schema import MaterialEntry
from radarsim.scene.map_writer import material_keys
from radarsim.scene.material import Material, library_material, library_names
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import load_sensor


def mean_range(scene: Scene, sensor: str = "radar") -> float:
    scanner = load_sensor(sensor, fov_deg=40)
    rng = radarsim.generator_for(0, "edits")
    return float(np.minimum(scanner.scan(scene, (-8, 0, 0), rng).ranges, 80).mean())


def objects_of(scene: Scene) -> list[str]:
    return list(dict.fromkeys(part.object_name for part in scene.parts))


def known_materials() -> list[Material]:
    maps = [load_map(name) for name in shipped_maps()]
    own = [each for scene in maps for each in scene.materials.values()]
    return [*map(library_material, library_names()), *own]


@pytest.mark.parametrize("material", known_materials(), ids=lambda m: m.name)
def test_every_material_is_read_as_it_is_written(material: Material) -> None:
    entry = MaterialEntry.model_validate(material_keys(material))
    assert make_material(material.name, entry) == material


@pytest.mark.parametrize("name", sorted(shipped_maps()))
def test_map_that_is_written_gives_the_same_scans(name: str, tmp_path: Path) -> None:
    whole = load_map(name)
    # To write and read all leaves of a forest takes long.
    few = tuple(part for part in whole.parts if len(part.faces) < 1000)
    scene = replace(whole, parts=few)
    path = tmp_path / "new" / "copy.yaml"
    scene.to_yaml(path)
    again = load_map(path)
    for each in ("level", "starts", "materials", "air", "trial", "gps_origin"):
        assert getattr(again, each) == getattr(scene, each), each
    assert [str(part) for part in again.parts] == [str(part) for part in scene.parts]
    for start in scene.starts[:1]:
        pose = (start.pose.x, start.pose.y, start.pose.yaw)
        for sensor in ("radar", "laser"):
            scanner = load_sensor(sensor, fov_deg=360, resolution_deg=4)
            first, second = (
                scanner.scan(each, pose, radarsim.generator_for(1, sensor)).ranges
                for each in (scene, again)
            )
            assert first.tolist() == second.tolist()


def test_reflectors_and_materials_of_one_object_are_written(tmp_path: Path) -> None:
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    glass, steel = Material("glas", laser_density=0.0), Material("steel", solid=False)
    parts = (
        Part("thing", glass, tetrahedron, faces),
        Part("thing", steel, tetrahedron + 3, faces),
    )
    materials = {"glas": glass, "steel": steel}
    scene = Scene("things", "DM-Things", parts, materials=materials)
    trihedral, point = {"trihedral": 0.1}, {"rcs_dbsm": 3}
    scene = scene.with_object("corner", reflector=trihedral, position=[5, 0, 1])
    scene = scene.with_object("point", reflector=point, position=[5, 1, 1])
    scene.to_yaml(tmp_path / "things.yaml")
    again = load_map(tmp_path / "things.yaml")
    assert again.reflectors == scene.reflectors
    assert [part.material for part in again.parts] == [p.material for p in scene.parts]
    for one, other in zip(again.parts, scene.parts, strict=True):
        corners = [
            sorted(map(sorted, p.vertices[p.faces].tolist())) for p in (one, other)
        ]
        assert corners[0] == corners[1]


def test_thicker_foliage_lets_less_through(foliage_room: Scene) -> None:
    thick = foliage_room.with_material("foliage", density=50.0)
    assert mean_range(thick) < mean_range(foliage_room)
    assert mean_range(thick, "laser") == mean_range(foliage_room, "laser")
    assert foliage_room.materials["foliage"].density < 50
    assert thick.materials["foliage"].density == 50
    changed = foliage_room.with_material("foliage", solid=False).materials["foliage"]
    assert changed.density == foliage_room.materials["foliage"].density
    assert not changed.solid


def test_opaque_object_can_be_made_transparent(foliage_room: Scene) -> None:
    opaque = foliage_room.with_material("foliage", density="opaque")
    assert mean_range(opaque) < mean_range(foliage_room)
    density = foliage_room.materials["foliage"].density
    again = opaque.with_material("foliage", density=density)
    assert mean_range(again) == mean_range(foliage_room)


def test_one_more_bush_is_seen_and_can_be_served(
    foliage_room: Scene, tmp_path: Path
) -> None:
    place = {"cylinder": [0.4, 2.0], "position": [-6.0, 0.0, 1.0]}
    scene = foliage_room.with_object("new", material="foliage", **place)
    assert objects_of(scene)[-1] == "new"
    assert mean_range(scene, "laser") < mean_range(foliage_room, "laser")
    scene.to_yaml(tmp_path / "bush.yaml")
    sim = radarsim.simulate(tmp_path / "bush.yaml")
    robot = sim.spawn("P3AT_SICK", start="RobotStart1")
    sim.step(0.1)
    laser = load_sensor("laser").scan(foliage_room, (-7.79, 0, 0))
    assert robot.scan().ranges.min() < laser.ranges.min()


def test_copies_and_materials_of_the_library_can_be_added(empty_room: Scene) -> None:
    scene = empty_room.with_object(
        "post",
        box=[0.1, 0.1, 1.0],
        material="wood",
        repeat={"count": 3, "step": [1.0, 0.0, 0.0]},
    )
    assert objects_of(scene)[-3:] == ["post_1", "post_2", "post_3"]
    assert "wood" in scene.materials
    assert objects_of(scene.without("post_2"))[-2:] == ["post_1", "post_3"]
    assert objects_of(scene.without("post")) == objects_of(empty_room)


def test_reflector_can_be_removed(empty_room: Scene) -> None:
    scene = empty_room.with_object("corner", reflector={"trihedral": 0.2})
    assert [each.name for each in scene.reflectors] == ["corner"]
    assert scene.without("corner").reflectors == ()


def test_air_changes_with_its_material(empty_room: Scene) -> None:
    foggy = Scene(
        "foggy",
        "DM-Foggy",
        empty_room.parts,
        materials=empty_room.materials,
        air=library_material("fog"),
    ).with_material("fog", g_per_m3=2.0, based_on="fog")
    assert foggy.air == library_material("fog", g_per_m3=2.0)
    with pytest.raises(MapError, match="expected a material that beams and robots"):
        foggy.with_material("fog", density="opaque")


@pytest.mark.parametrize(
    ("name", "keys", "text"),
    [
        ("x", {"sphere": -1.0, "material": "wood"}, "object 'x'.*: -1"),
        ("x", {"sphere": 1.0, "material": "wod"}, "did you mean 'wood'"),
        ("x", {"sphere": 1.0}, "material"),
        ("x", {"spere": 1.0}, "did you mean 'sphere'"),
        ("x", {"mesh": "no.obj", "material": "wood"}, r"no\.obj"),
        ("cabinet", {"sphere": 1.0, "material": "wood"}, "expected a new name"),
    ],
)
def test_mistakes_in_objects_are_map_errors_without_a_file(
    foliage_room: Scene, name: str, keys: dict[str, Any], text: str
) -> None:
    with pytest.raises(MapError, match=text) as error:
        foliage_room.with_object(name, **keys)
    assert str(error.value).startswith(f"object {name!r}")
    assert "scene.yaml" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "keys", "text"),
    [
        ("foliage", {"densty": 1.0}, "did you mean 'density'"),
        ("foliage", {"density": -1.0}, "at least 0"),
        (
            "foliage",
            {"absorption_db": 3.0},
            "only for a material that is opaque to a radar",
        ),
        ("new", {"solid": False}, "density: missing"),
    ],
)
def test_mistakes_in_materials_are_map_errors(
    foliage_room: Scene, name: str, keys: dict[str, Any], text: str
) -> None:
    with pytest.raises(MapError, match=f"material {name!r}: .*{text}"):
        foliage_room.with_material(name, **keys)


def test_object_that_is_not_there_cannot_be_removed(foliage_room: Scene) -> None:
    with pytest.raises(MapError, match="did you mean 'cabinet'"):
        foliage_room.without("cabinett")


def test_open_surface_cannot_be_entered() -> None:
    sheet = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64)
    wood = Material("plank")
    part = Part("board", wood, sheet, np.array([[0, 1, 2]]))
    scene = Scene("s", "S", (part,), materials={"plank": wood})
    with pytest.raises(MapError, match=r"object 'board': .*expected a closed volume"):
        scene.with_material("plank", density=1.0)
    leaf = scene.with_material("plank", density=1.0, sheet_loss=0.5)
    assert leaf.parts[0].material.sheet_loss == 0.5
    with pytest.raises(MapError, match="expected a closed volume"):
        leaf.with_material("plank", density=1.0)
    assert math.isinf(scene.parts[0].material.density)
