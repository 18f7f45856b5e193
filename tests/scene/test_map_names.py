from pathlib import Path

import pytest

from radarsim.errors import MapError
from radarsim.scene.map_file import find_map, shipped_maps

pytestmark = pytest.mark.usefixtures("mesh_folder")


def test_file_takes_precedence_over_a_shipped_map() -> None:
    shipped = shipped_maps()["empty_room"]
    assert find_map("empty_room") == (shipped, None)
    Path("empty_room").write_text("version: 1\n")
    assert find_map("empty_room") == (Path("empty_room"), None)


def test_maps_inside_of_the_package_take_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "radarsim" / "scene" / "mapnames.py"
    inside = tmp_path / "radarsim" / "maps" / "b.yaml"
    aside = tmp_path / "maps" / "a.yaml"
    monkeypatch.setattr("radarsim.scene.map_file.__file__", str(module))
    for path in (aside, inside):
        path.parent.mkdir(parents=True)
        path.touch()
    assert shipped_maps() == {"b": inside}


@pytest.mark.parametrize("where", [".", "a@b"])
def test_text_after_the_last_at_is_a_variant_of_a_file(where: str) -> None:
    path = Path(where, "room.yaml")
    path.parent.mkdir(exist_ok=True)
    path.write_text("version: 1\n")
    assert find_map(path) == (path, None)
    assert find_map(f"{path}@dust") == (path, "dust")
    assert find_map(Path(f"{path}@")) == (path, "")


def test_text_after_the_at_is_a_variant_of_a_shipped_map() -> None:
    assert find_map("empty_room@dust") == (shipped_maps()["empty_room"], "dust")


def test_file_with_an_at_in_its_name_is_found() -> None:
    for name in ("room.yaml", "room.yaml@dust"):
        Path(name).write_text("version: 1\n")
    assert find_map("room.yaml@dust") == (Path("room.yaml@dust"), None)


@pytest.mark.parametrize("name", ["@", "@dust", "nowhere@dust", "empty_room@dust@x"])
def test_error_for_a_variant_of_a_missing_map_has_the_whole_name(name: str) -> None:
    with pytest.raises(MapError) as caught:
        find_map(name)
    meant = " (did you mean 'empty_room'?)" if "empty_room" in name else ""
    expected = f"{name}: no such file{meant}, expected a map file"
    assert str(caught.value).startswith(expected)
