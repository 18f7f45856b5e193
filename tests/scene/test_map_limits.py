"""Maps of more than a scene may have: an error says how much came, and what may."""

from pathlib import Path
from typing import Any

import pytest
from map_texts import HEAD, objects, problems

from radarsim.errors import MapError
from radarsim.scene.build import LIMITS
from radarsim.scene.map_checks import MAX_REPORTED
from radarsim.scene.map_file import load_map, load_variants
from radarsim.scene.map_schema import (
    MAX_MATERIALS,
    MAX_STARTS,
    MAX_VARIANTS,
    Entry,
    ObjectEntry,
)
from radarsim.scene.meshes import read_surfaces
from radarsim.scene.shapes import Surface

SMALL = "box: [0.01, 0.01, 0.01], material: stone"

pytestmark = pytest.mark.usefixtures("mesh_folder")


@pytest.mark.parametrize(
    ("what", "most", "count"),
    [
        pytest.param("objects", 20, 5, id="copies"),
        pytest.param("parts", 20, 5, id="parts"),
        ("triangles", 240, 60),
    ],
)
def test_copies_of_all_objects_are_limited(
    monkeypatch: pytest.MonkeyPatch, what: str, most: int, count: int
) -> None:
    monkeypatch.setitem(LIMITS, what, most)
    row = f"{SMALL}, repeat: {{count: 5, step: [0, 0, 0]}}"
    text = objects(*(f"name: row{i}, {row}" for i in range(30)))
    found = problems(text)
    assert len(found) == 30 - 4
    message = f"{count} {what}, expected at most {most} in all, 0 are left"
    assert found[0] == f"m.yaml:11:5: objects.4: {message}"


def test_objects_of_a_file_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarsim.scene.map_loader.MAX_OBJECTS", 3)
    text = objects(*(f"name: o{i}, {SMALL}" for i in range(5)))
    message = "5 objects, expected at most 3 in all"
    assert problems(text) == [f"m.yaml:7:3: objects: {message}"]


def test_materials_are_limited() -> None:
    lines = "".join(f"  m{i}: {{density: 1}}\n" for i in range(MAX_MATERIALS + 1))
    found = problems("version: 1\nmaterials:\n" + lines)
    count = f"{MAX_MATERIALS + 1} materials, expected at most {MAX_MATERIALS}"
    assert found == [f"m.yaml:3:3: materials: {count} in all"]


def test_excess_is_reported_before_anything_is_built(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.scene.meshes.read_surfaces", None)
    starts = "".join(
        f"  - {{name: RobotStart{i}, position: [0, 0, 0]}}\n"
        for i in range(MAX_STARTS + 1)
    )
    mesh = objects("name: a, mesh: meshes/cube.obj, material: stone")
    (found,) = problems(f"{mesh}starts:\n{starts}")
    assert f"{MAX_STARTS + 1} starts" in found
    row = "repeat: {count: 9000, step: [0, 0, 0]}"
    (found,) = problems(
        mesh + "".join(f"  - {{name: r{i}, {SMALL}, {row}}}\n" for i in range(3))
    )
    assert "9000 objects, expected at most 20000 in all, 1999 are left" in found


def test_objects_of_all_variants_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarsim.scene.map_loader.MAX_ENTRIES", 9)
    text = objects(f"name: a, {SMALL}", f"name: b, {SMALL}")
    more = f"objects: [{{name: c, {SMALL}}}]"
    path = Path("m.yaml")
    path.write_text(f"{text}variants: {{x: {{{more}}}, y: {{{more}}}, z: {{}}}}\n")
    with pytest.raises(MapError, match="3 variants with 10 objects in all"):
        load_variants(path)
    path.write_text(f"{text}variants: {{x: {{{more}}}, y: {{{more}}}}}\n")
    assert len(load_variants(path)) == 3


def test_entries_that_variants_share_are_validated_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    validated: list[str] = []

    def watch(model: Any, /, item: Any, **options: Any) -> Any:
        validated.append(model.__name__)
        return validate(model, item, **options)

    validate = ObjectEntry.model_validate.__func__  # type: ignore[attr-defined]
    monkeypatch.setattr(Entry, "model_validate", classmethod(watch))
    variants = (
        "{x: {materials: {moss: {density: 1}}}, y: {materials: {wool: {density: 1}}}}"
    )
    Path("m.yaml").write_text(f"{objects(f'name: a, {SMALL}')}variants: {variants}\n")
    assert len(load_variants("m.yaml")) == 3
    assert validated.count("ObjectEntry") == 1
    assert validated.count("MaterialEntry") == 5


def test_variants_are_limited() -> None:
    lines = "".join(f"  v{i}: {{}}\n" for i in range(MAX_VARIANTS + 1))
    path = Path("m.yaml")
    path.write_text("version: 1\nvariants:\n" + lines)
    assert load_map("m.yaml@v7").name == "m@v7"
    with pytest.raises(MapError, match=f"{MAX_VARIANTS + 1} variants"):
        load_variants(path)


def test_many_problems_are_counted_and_the_first_are_reported() -> None:
    lines = [f"name: o{i}, box: [1, 1, 1], material: stome{i}" for i in range(150)]
    found = problems(objects(*lines))
    assert len(found) == MAX_REPORTED + 1
    assert "'stome99'" in found[-2]
    assert found[-1] == f"m.yaml: {150 - MAX_REPORTED} more problems"


def test_many_problems_of_one_entry_are_counted_too() -> None:
    keys = ", ".join(f"key{i}: 1" for i in range(150))
    found = problems(objects(f"name: a, {SMALL}, {keys}"))
    assert found[-1] == f"m.yaml: {150 - MAX_REPORTED} more problems"


def test_problems_of_many_variants_are_reported_once() -> None:
    lines = [f"name: o{i}, box: [1, 1, 1], material: stome{i}" for i in range(60)]
    variants = "variants: {a: {}, b: {air: nothing}, c: {air: nothing}}\n"
    Path("m.yaml").write_text(objects(*lines) + variants)
    with pytest.raises(MapError) as caught:
        load_variants("m.yaml")
    assert len(caught.value.problems) == 62


def test_names_in_a_message_are_limited() -> None:
    materials = "".join(f"  m{i}: {{density: 1}}\n" for i in range(500))
    text = HEAD.replace("objects:\n", materials + "objects:\n")
    (found,) = problems(text + "  - {name: a, sphere: 1, material: nothing}\n")
    assert "and 403 more" in found
    assert len(found) < 2000


def test_each_mesh_file_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def watch(path: Path, *others: Any) -> list[Surface]:
        read.append(path.name)
        return read_surfaces(path, *others)

    monkeypatch.setattr("radarsim.scene.meshes.read_surfaces", watch)
    mesh = "mesh: meshes/cube.obj, material: stone"
    Path("m.yaml").write_text(
        objects(*(f"name: o{i}, {mesh}" for i in range(20))) + "variants: {a: {}}\n"
    )
    base, variant = load_variants("m.yaml")
    assert read == ["cube.obj"]
    assert base.parts[3] is variant.parts[3]


def test_copies_of_all_variants_are_limited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.scene.map_loader.MAX_BUILT", 60)
    scatter = "scatter: {count: 10, area: [[-90, -90], [90, 90]], seed: 1}"
    file = tmp_path / "variants.yaml"
    variants = "".join(
        f"  v{i}:\n    objects: [{{name: o, {SMALL}, {scatter}}}]\n" for i in range(8)
    )
    file.write_text(f"{HEAD}  []\nvariants:\n{variants}")
    with pytest.raises(MapError) as raised:
        load_variants(file)
    assert [problem.partition(": ")[2] for problem in raised.value.problems] == [
        f"variants.v{i}.objects.0: 10 objects of the map and its variants,"
        " expected at most 60 in all, 0 are left"
        for i in (6, 7)
    ]
