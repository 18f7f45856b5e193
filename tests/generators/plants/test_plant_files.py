"""Mesh files of plants."""

from pathlib import Path

import numpy as np
import pytest

from radarsim import shipped_maps
from radarsim.files import write_atomically
from radarsim.generators.plants.growth import LEAVES, WOOD
from radarsim.generators.plants.plant import (
    GRID,
    SEED,
    encode_glb,
    make_shrubs,
    plant_files,
)
from radarsim.scene.meshes import read_surfaces
from radarsim.scene.shapes import Surface

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
