"""Plants of wood and foliage, and one shrub whose foliage has three shapes.

The wood is the same in all three: it stands in the same way of the same rays, so that
what differs is the foliage, and a plant of a map is what has been calibrated.
"""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.plants.growth import (
    LEAVES,
    SHRUB,
    TREE,
    WOOD,
    YOUNG_TREE,
    PlantParameters,
    Skeleton,
    grow,
)
from radarsim.plants.mesh import Mesh, ball, bark, foliage, join
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import sphere

SHAPES: Final = ("ball", "cloud", "leaves")
TUFT: Final = 0.25  # m, radius of a ball of the cloud


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant on the origin.

    Attributes:
        wood: Closed tubes.
        foliage: Leaves, or closed volumes instead.
    """

    wood: Mesh
    foliage: Mesh

    @property
    def pieces(self) -> dict[str, Mesh]:
        """What it is made of, by the names of the materials in its file."""
        return {WOOD: self.wood, LEAVES: self.foliage}

    @property
    def triangles(self) -> int:
        """How many there are of both."""
        return len(self.wood[1]) + len(self.foliage[1])

    def parts(
        self, name: str, wood: Material, leaves: Material, place: Floats | None = None
    ) -> tuple[Part, Part]:
        """Give its parts in a scene, at a place, (3,) m, or on the origin."""
        offset = np.zeros(3) if place is None else place
        return (
            Part(name, wood, self.wood[0] + offset, self.wood[1]),
            Part(name, leaves, self.foliage[0] + offset, self.foliage[1]),
        )


def make_plant(form: PlantParameters, seed: int, name: str) -> Plant:
    """Make a plant with leaves; of one seed and name there is one plant."""
    rng = generator_for(seed, "plants", name)
    skeleton = grow(form, rng)
    return Plant(bark(skeleton), foliage(form, skeleton, rng))


def make_shrubs(seed: int, form: PlantParameters = SHRUB) -> dict[str, Plant]:
    """Make one shrub whose foliage has the shapes ``SHAPES``: wood and crown are one.

    A ball fills the crown; a cloud of small balls is around the ends of the twigs;
    leaves hang there.

    Args:
        seed: Of wood and leaves.
        form: Its crown is a sphere.
    """
    rng = generator_for(seed, "plants", "shrub")
    skeleton = grow(form, rng)
    vertices, faces = sphere(form.crown_radius)
    shapes = {
        "ball": (vertices + form.centre, faces),
        "cloud": _cloud(form, skeleton),
        "leaves": foliage(form, skeleton, rng),
    }
    wood = bark(skeleton)
    return {shape: Plant(wood, shapes[shape]) for shape in SHAPES}


def _cloud(form: PlantParameters, skeleton: Skeleton) -> Mesh:
    """Put a tuft around each end, moved inward where it would not fit."""
    ends = skeleton.points[skeleton.tips] - form.centre
    out = np.linalg.norm(ends, axis=1, keepdims=True)
    inward = np.minimum(1.0, (form.crown_radius - TUFT) / np.maximum(out, TUFT))
    return join([ball(place, TUFT) for place in form.centre + inward * ends])


# Section from plants.meshfiles.
# Mesh files of plants: glTF, whose y axis points up.

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
