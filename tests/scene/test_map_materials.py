import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import map_texts
import pytest

from radarsim.scene.material import OPAQUE, Material, library_material, library_names
from radarsim.scene.scene import Scene

NUMBER = "expected a number from 0 to 1e+06, or one for each of 24, 77, 94"


pytestmark = pytest.mark.usefixtures("mesh_folder")


def load(text: str) -> Scene:
    return map_texts.load(f"version: 1\n{text}\n")


def problems(text: str) -> list[str]:
    return map_texts.problems(f"version: 1\n{text}\n")


def material(entry: str) -> Material:
    return load(f"materials:\n  m: {entry}").materials["m"]


@pytest.mark.parametrize(
    ("entry", "attributes"),
    [
        (
            "{db_per_m: 2.5}",
            {"density": 0.0, "laser_density": OPAQUE, "radar_db": (2.5, 2.5, 2.5)},
        ),
        (
            "{db_per_m: {24: 2, 77: 3.5, 94: 4}}",
            {"density": 0.0, "radar_db": (2.0, 3.5, 4.0)},
        ),
        ("{density: 0.7, db_per_m: 1}", {"density": 0.7, "radar_db": (1.0, 1.0, 1.0)}),
        (
            "{density: 0, laser_db_per_m: 4.3, solid: false}",
            {"density": 0.0, "laser_density": 0.0, "laser_db": 4.3, "solid": False},
        ),
        (
            "{density: opaque, absorption_db: 12, laser_absorption_db: all}",
            {
                "absorption_db": 12.0,
                "backscatter_db": -22.0,
                "laser_absorption_db": math.inf,
            },
        ),
        ("{density: opaque, mirror: radar}", {"radar_mirror": True}),
        (
            "{density: opaque, mirror: both}",
            {"radar_mirror": True, "laser_mirror": True},
        ),
        (
            "{density: 0.7, attenuation_db: {24: 2, 77: 3, 94: 4}, albedo: 0.3}",
            {"density": 0.7, "attenuation_db": (2.0, 3.0, 4.0), "albedo": 0.3},
        ),
        (
            "{sheet_loss: 0.4, sheet_attenuation_db: 0.2}",
            {
                "density": 0.0,
                "sheet_loss": 0.4,
                "sheet_attenuation_db": (0.2, 0.2, 0.2),
            },
        ),
        (
            "{density: opaque, backscatter_db: -25, constant_gamma: true}",
            {"backscatter_db": -25.0, "constant_gamma": True},
        ),
        (
            "{density: opaque, absorption_db: all}",
            {"absorption_db": math.inf, "backscatter_db": -math.inf},
        ),
        (
            "{density: opaque, absorption_db: all, backscatter_db: -25}",
            {"absorption_db": math.inf, "backscatter_db": -25.0},
        ),
    ],
)
def test_entry_becomes_a_material(entry: str, attributes: dict[str, Any]) -> None:
    assert material(entry) == Material("m", **attributes)


@pytest.mark.parametrize("name", library_names())
def test_entry_may_be_based_on_any_library_material(name: str) -> None:
    result = material(f"{{based_on: {name}}}")
    assert result == replace(library_material(name), name="m")
    assert result.sheet_loss is None


@pytest.mark.parametrize(
    ("entry", "base", "attributes"),
    [
        (
            "{based_on: foliage, density: 0.7}",
            "foliage",
            {
                "density": 0.7,
                "radar_db": (0.0, 0.0, 0.0),
                "attenuation_db": (2.37, 3.31, 3.5),
            },
        ),
        (
            "{based_on: foliage, laser_db_per_m: 3}",
            "foliage",
            {"laser_density": 0.0, "laser_db": 3.0},
        ),
        (
            "{based_on: foliage, sheet_loss: 0.1}",
            "foliage",
            {"sheet_loss": 0.1, "radar_db": (0.0, 0.0, 0.0)},
        ),
        (
            "{based_on: metal, density: 1}",
            "metal",
            {"density": 1.0, "radar_mirror": False, "absorption_db": 0.0},
        ),
        (
            "{based_on: metal, laser_density: 0}",
            "metal",
            {"laser_density": 0.0, "laser_mirror": False, "laser_absorption_db": 0.0},
        ),
        (
            "{based_on: metal, mirror: none, absorption_db: 20}",
            "metal",
            {
                "radar_mirror": False,
                "laser_mirror": False,
                "absorption_db": 20.0,
                "backscatter_db": -30.0,
                "specular_db": -20.01,
            },
        ),
    ],
)
def test_entry_overrides_its_base(
    entry: str, base: str, attributes: dict[str, Any]
) -> None:
    expected = library_material(base)
    for field in Material.__dataclass_fields__:
        value = attributes.get(field, getattr(expected, field))
        assert getattr(material(entry), field) == ("m" if field == "name" else value)


def test_amounts_are_those_of_the_entry() -> None:
    assert material("{based_on: rain, mm_per_h: 5}").rain == 5
    smoke = material("{based_on: smoke, g_per_m3: 1}")
    assert smoke.laser_db == library_material("smoke", g_per_m3=1).laser_db
    assert material("{based_on: fog, g_per_m3: 0}").laser_db == 0


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{db_per_m: ^-1}", f"-1, {NUMBER}"),
        (
            "{db_per_m: ^{24: 1, 77: 2, 94: 3, 60: 4}}",
            f"{{'24': 1, '77': 2, '94': 3, '60': 4}}, {NUMBER}",
        ),
        (
            "{density: opaque, db_per_m: ^1}",
            "1 with 'opaque', expected a number or no value for 'density'",
        ),
        ("{sheet_loss: 1, db_per_m: ^1}", "expected either 'sheet_loss' or 'db_per_m'"),
        (
            "{density: opaque, absorption_db: ^some}",
            "'some', expected 'all' or a number from 0 to 1e+06",
        ),
        (
            "{density: 1, absorption_db: ^3}",
            "3, expected only for a material that is opaque to a radar",
        ),
        (
            "{density: 1, mirror: ^radar}",
            "'radar', expected only for a material that is opaque to a radar",
        ),
        (
            "{based_on: concrete, attenuation_db: ^3}",
            "expected only if a radar can enter the material and it has an inside",
        ),
        (
            "{density: 1, sheet_attenuation_db: ^3}",
            "expected only if a radar can enter the material and it has a 'sheet_loss'",
        ),
        ("{density: 1, albedo: ^1.5}", "1.5, expected at most 1"),
        ("{based_on: ^leaf}", f"'leaf', expected one of {list(library_names())}"),
        (
            "{based_on: rain, g_per_m3: ^3}",
            "expected only where 'based_on' is one of ['dust', 'fog', 'smoke']",
        ),
    ],
)
def test_problem_of_a_material_has_place_and_expectation(
    entry: str, message: str
) -> None:
    """The place is that of the mark, behind the key."""
    before, _, after = entry.partition("^")
    place = f"m.yaml:3:{6 + len(before)}: materials.m.{before.split()[-1].lstrip('{')}"
    assert problems(f"materials:\n  m: {before}{after}") == [f"{place} {message}"]


def test_object_may_have_a_library_material_without_an_entry() -> None:
    scene = load(
        "materials:\n"
        "  wood: {density: 0.5}\n"
        "objects:\n"
        "  - {name: a, sphere: 1, material: hedge}\n"
        "  - {name: b, sphere: 1, material: wood}\n"
        "  - {name: c, sphere: 1, material: hedge}\n"
    )
    assert list(scene.materials) == ["wood", "hedge"]
    assert scene.parts[0].material == library_material("hedge")
    assert scene.parts[1].material == Material("wood", 0.5)
    assert scene.parts[2].material is scene.parts[0].material


def test_mesh_may_have_library_materials() -> None:
    Path("plate.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Tin\nf 1 2 3\n")
    (part,) = load(
        "objects:\n  - {name: a, mesh: plate.obj, materials: {Tin: metal}}"
    ).parts
    assert part.material == library_material("metal")


@pytest.mark.parametrize(
    ("text", "air"),
    [
        ("air: fog", library_material("fog")),
        (
            "materials:\n  fog: {density: 0.01, laser_density: 1, solid: false}\n"
            "air: fog",
            Material("fog", 0.01, 1.0, solid=False),
        ),
        pytest.param("air:", None, id="none"),
        pytest.param("", None, id="not said"),
    ],
)
def test_air_fills_the_scene(text: str, air: Material | None) -> None:
    scene = load(text)
    assert scene.air == air
    assert scene.materials == ({air.name: air} if air else {})


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "air: foliage",
            "m.yaml:2:6: air: 'foliage' is opaque to a laser and solid,"
            " expected a material that beams and robots can enter",
        ),
        (
            "air: m\nmaterials: {m: {sheet_loss: 1, laser_density: 0, solid: false}}",
            "m.yaml:2:6: air: 'm' is a sheet,"
            " expected a material that beams and robots can enter",
        ),
        (
            "air: mist",
            "m.yaml:2:6: air: 'mist', expected one of the library,"
            f" {list(library_names())}",
        ),
        (
            "air: m\nmaterials: {m: {density: -1}}",
            "m.yaml:3:26: materials.m.density: -1,"
            " expected 'opaque' or a number, at least 0",
        ),
    ],
)
def test_problem_of_the_air_has_place_and_expectation(text: str, expected: str) -> None:
    assert problems(text) == [expected]


def test_invalid_air_does_not_hide_other_problems() -> None:
    text = "air: metal\nobjects: [{name: a, sphere: 0, material: fog}]"
    assert [line.split(": ")[1] for line in problems(text)] == [
        "air",
        "objects.0.sphere",
    ]
