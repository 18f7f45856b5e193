from pathlib import Path

import pytest

from radarsim.errors import MapError
from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.material import Material, library_material

YARD = """\
version: 1
level: DM-Yard
air: fog
materials:
  leaf: {density: 0.7}
  bark: {density: opaque}
objects:
  - {name: bush, sphere: 1, material: leaf}
starts:
  - {name: RobotStart1, position: [-8, 0, 0]}
variants:
  clear: {air: }
  dust:
    air: dust
    materials:
      leaf: {density: 0.1}
      cloud: {based_on: dust, g_per_m3: 9}
    objects:
      - {name: puff, sphere: 2, position: [5, 0, 0], material: cloud}
  same:
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("yard.yaml").write_text(YARD)


def problems(text: str, name: str = "m.yaml", *, every: bool = False) -> list[str]:
    Path("m.yaml").write_text(f"version: 1\n{text}\n")
    with pytest.raises(MapError) as caught:
        (load_variants if every else load_map)(name)
    return caught.value.problems


def test_variant_overrides_air_and_materials_and_adds_objects() -> None:
    scene = load_map("yard.yaml@dust")
    assert (scene.name, scene.level) == ("yard@dust", "DM-Yard")
    assert scene.air == library_material("dust")
    assert [part.object_name for part in scene.parts] == ["bush", "puff"]
    assert scene.parts[0].material == Material("leaf", 0.1)
    assert scene.materials["bark"] == Material("bark")
    assert [start.name for start in scene.starts] == ["RobotStart1"]


def test_map_without_variant_has_nothing_of_its_variants() -> None:
    scene = load_map(Path("yard.yaml"))
    assert scene.name == "yard"
    assert scene.air == library_material("fog")
    assert scene.materials["leaf"] == Material("leaf", 0.7)
    assert [part.object_name for part in scene.parts] == ["bush"]


def test_variant_may_have_no_air_or_no_difference() -> None:
    assert load_map("yard.yaml@clear").air is None
    same = load_map("yard.yaml@same")
    assert same.air == library_material("fog")
    assert (same.name, len(same.parts)) == ("yard@same", 1)


def test_all_variants_can_be_loaded_at_once() -> None:
    names = [scene.name for scene in load_variants("yard.yaml")]
    assert names == ["yard", "yard@clear", "yard@dust", "yard@same"]
    assert [scene.name for scene in load_variants("yard.yaml@dust")] == ["yard@dust"]


def test_meshes_of_a_variant_are_relative_to_the_map() -> None:
    Path("plate.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    Path("m.yaml").write_text(
        "version: 1\nvariants: {a: {objects: ["
        "{name: a, mesh: plate.obj, material: metal}]}}\n"
    )
    assert len(load_map("m.yaml@a").parts) == 1


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        (
            "variants: {dust: {}, rain: {}}",
            "m.yaml@fog",
            "m.yaml:2:11: variants: 'fog', expected one of ['dust', 'rain']",
        ),
        pytest.param(
            "",
            "m.yaml@fog",
            "m.yaml:1:1: variants: 'fog', expected a map with variants",
            id="no variants",
        ),
        (
            "variants: {a@b: {}}",
            "m.yaml",
            "m.yaml:2:17: variants.a@b: 'a@b', expected letters, digits, '_' and '-'",
        ),
        (
            "variants: [dust]",
            "m.yaml",
            "m.yaml:2:11: variants: ['dust'], expected keys with values",
        ),
        (
            "variants: {a: {starts: []}}",
            "m.yaml@a",
            "m.yaml:2:16: variants.a.starts: unknown key,"
            " expected one of ['air', 'materials', 'objects']",
        ),
        (
            "variants: {a: {air: metal}}",
            "m.yaml@a",
            "m.yaml:2:21: variants.a.air: 'metal' is opaque to a radar and opaque to a"
            " laser and solid, expected a material that beams and robots can enter",
        ),
        (
            "objects: [{name: b, sphere: 1, material: fog}]\n"
            "variants: {a: {objects: [{name: b, sphere: 1, material: fog}]}}",
            "m.yaml@a",
            "m.yaml:3:33: variants.a.objects.0.name: 'b',"
            " expected a name not used by objects.0",
        ),
    ],
)
def test_problem_of_a_variant_has_place_and_expectation(
    text: str, name: str, expected: str
) -> None:
    assert problems(text, name) == [expected]


def test_map_loads_although_a_variant_is_invalid() -> None:
    Path("m.yaml").write_text("version: 1\nvariants: {a: {air: metal}}\n")
    assert load_map("m.yaml").air is None


def test_each_problem_of_all_variants_is_reported_once() -> None:
    text = (
        "materials: {m: {density: -1}}\n"
        "variants:\n"
        "  a: {air: metal}\n"
        "  b: {objects: [{name: x, sphere: 0, material: fog}], walls: 1}\n"
        "  c: {}\n"
    )
    places = [line.split(": ")[1] for line in problems(text, every=True)]
    assert places == [
        "materials.m.density",
        "variants.a.air",
        "variants.b.walls",
        "variants.b.objects.0.sphere",
    ]


def test_invalid_file_has_no_variants() -> None:
    Path("m.yaml").write_text("[1]")
    with pytest.raises(MapError) as caught:
        load_variants("m.yaml")
    assert len(caught.value.problems) == 1
