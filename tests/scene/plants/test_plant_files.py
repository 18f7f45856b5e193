"""Mesh files: their contents, and the program that writes them."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from radarsim import shipped_maps
from radarsim.files import write_atomically
from radarsim.scene.meshes import Surface, read_surfaces
from radarsim.scene.plants import __main__ as program
from radarsim.scene.plants.parameters import LEAVES, WOOD
from radarsim.scene.plants.plant import (
    GRID,
    SEED,
    encode_glb,
    make_shrubs,
    plant_files,
)

SHIPPED = shipped_maps()["forest_edge"].parent / "meshes"
NAMES = ["shrub_ball", "shrub_cloud", "shrub_leaves", "tree", "young_tree"]


@pytest.fixture(scope="module")
def mesh_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("meshes").resolve()
    write_atomically({folder / n: data for n, data in plant_files(SEED).items()})
    return folder


def surfaces(folder: Path, name: str) -> dict[str | None, Surface]:
    found = read_surfaces(folder / f"{name}.glb", folder)
    return {surface.material: surface for surface in found}


@pytest.mark.parametrize("name", NAMES)
def test_shipped_meshes_are_those_that_the_program_writes(
    mesh_files: Path, name: str
) -> None:
    shipped, new = surfaces(SHIPPED, name), surfaces(mesh_files, name)
    assert set(shipped) == set(new) == {WOOD, LEAVES}
    for material, surface in shipped.items():
        twin = new[material]
        assert np.array_equal(surface.faces, twin.faces)
        # another machine may round differently, which moves a vertex by one grid step
        assert np.abs(surface.vertices - twin.vertices).max() < 1.5 * GRID


def test_there_are_no_other_mesh_files_and_they_are_small() -> None:
    files = list(SHIPPED.iterdir())
    assert sorted(file.stem for file in files) == NAMES
    assert sum(file.stat().st_size for file in files) < 3e6


def test_same_seed_gives_the_same_bytes_and_another_one_others(
    mesh_files: Path,
) -> None:
    for name, content in plant_files(SEED).items():
        assert (mesh_files / name).read_bytes() == content
    for name, content in plant_files(SEED + 1).items():
        assert (mesh_files / name).read_bytes() != content


def test_mesh_survives_the_file_with_y_up(tmp_path: Path) -> None:
    plant = make_shrubs(1)["cloud"]
    folder = tmp_path.resolve()
    (folder / "shrub.glb").write_bytes(encode_glb(plant.pieces))
    for name, surface in surfaces(folder, "shrub").items():
        vertices, faces = plant.pieces[name or ""]
        x, y, z = surface.vertices.T
        back = np.column_stack([x, -z, y])
        assert np.abs(back - vertices).max() < 0.6 * GRID
        assert np.array_equal(surface.faces, faces)


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    words = [str(argument) for argument in arguments]
    monkeypatch.setattr(sys, "argv", ["radarsim.scene.plants", *words])
    with pytest.raises(SystemExit) as end:
        program.main()
    return int(end.value.code or 0)


def test_program_writes_all_files_of_a_seed(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    folder = tmp_path / "new" / "meshes"
    assert run(monkeypatch, folder, "--seed", 3) == 0
    for name, content in plant_files(3).items():
        assert (folder / name).read_bytes() == content
    assert capsys.readouterr().out.count("bytes\n") == len(NAMES)


# Few rays give nearly the same; the map has the values of the default number.
@pytest.mark.parametrize(
    ("rays", "accuracy"),
    [(100, 0.03), pytest.param(1600, 5e-3, marks=pytest.mark.slow)],
)
def test_program_prints_the_loss_of_foliage_and_draws_it(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    rays: int,
    accuracy: float,
) -> None:
    picture = tmp_path / "shapes.png"
    options = ("--figure", picture, "--rays", rays)
    assert run(monkeypatch, tmp_path / "out", *options) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    output = capsys.readouterr().out
    text = shipped_maps()["forest_edge"].read_text()
    for shape, word in (
        ("ball", "takes"),
        ("cloud", "takes"),
        ("leaves", "each takes"),
    ):
        (line,) = (line for line in output.splitlines() if f"{shape}, {word}" in line)
        number = float(line.split(f"{word} ")[1].split()[0].strip(":"))
        assert f"foliage_{shape}: {{" in text
        key = "sheet_loss" if shape == "leaves" else "density"
        found = re.search(rf"foliage_{shape}: {{.*\b{key}: ([0-9.]+)", text)
        assert found is not None
        shipped = found[1]
        assert number == pytest.approx(float(shipped), rel=accuracy)


def test_folder_that_cannot_be_created_is_reported(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("")
    assert run(monkeypatch, tmp_path / "file") == 2
    assert "cannot write" in capsys.readouterr().err
