"""Mesh files of plants: glTF, whose y axis points up."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim.plants.forms import TREE, YOUNG_TREE
from radarsim.plants.joining import Mesh
from radarsim.plants.shrub import make_plant, make_shrubs

SEED: Final = 5  # of the files that come with radarsim
GRAIN: Final = 1e-4  # m, of coordinates; a processor's rounding is far below


def plant_files(seed: int = SEED) -> dict[str, bytes]:
    """Make all mesh files of plants: their names, and what is in them."""
    plants = {f"shrub_{name}": each for name, each in make_shrubs(seed).items()}
    plants["tree"] = make_plant(TREE, seed, "tree")
    plants["young_tree"] = make_plant(YOUNG_TREE, seed, "young tree")
    return {f"{name}.glb": as_glb(each.pieces) for name, each in plants.items()}


def as_glb(pieces: Mapping[str, Mesh]) -> bytes:
    """Write pieces, by the name of their material, as a binary glTF file.

    Args:
        pieces: With z up. Coordinates are rounded to 0.1 mm, so that all machines write
            the same ones.
    """
    scene = _library().Scene()
    for name, (vertices, faces) in pieces.items():
        x, y, z = (np.round(vertices / GRAIN) * GRAIN).T
        mesh = _library().Trimesh(
            np.column_stack([x, z, -y]) + 0.0,  # no minus zeros
            faces,
            process=False,
            visual=_named(name),
        )
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    content: bytes = scene.export(file_type="glb")
    return content


def _library() -> Any:
    import trimesh  # noqa: PLC0415 - slow to import

    return trimesh


def _named(name: str) -> Any:
    """Make what a mesh is painted with: a name, and nothing else."""
    visual = _library().visual
    material = visual.material.PBRMaterial(name=name, doubleSided=True)
    return visual.TextureVisuals(material=material)


def write_all(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, which is made if it is not there: all, or none.

    A file is there as it was, or whole. If one of them cannot be written, none has been
    touched; only if its place cannot be taken have those before it been.

    Raises:
        OSError: If one cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as draft:
        for name, content in files.items():
            (Path(draft) / name).write_bytes(content)
        for name in files:
            (Path(draft) / name).replace(folder / name)
