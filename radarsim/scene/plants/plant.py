"""Plants of wood and foliage, one shrub with foliage in three shapes, and mesh files.

The wood of the three shapes is the same: it blocks the same rays, so that only the
foliage differs, and a map has the same plants that were calibrated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.plants.growth import grow
from radarsim.scene.plants.mesh import ball, bark, foliage
from radarsim.scene.plants.parameters import (
    LEAVES,
    SHRUB,
    TREE,
    WOOD,
    YOUNG_TREE,
    PlantParameters,
)
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Mesh, concatenate, sphere

SHAPES: Final = ("ball", "cloud", "leaves")
TUFT_RADIUS: Final = 0.25  # m, of a ball of the cloud
SEED: Final = 5  # of the shipped mesh files
GRID: Final = 1e-4  # m, of coordinates; rounding errors of processors are far below


@dataclass(frozen=True, eq=False)
class Plant:
    """A plant at the origin.

    Attributes:
        wood: Closed tubes.
        foliage: Leaves, or closed volumes that replace them.
    """

    wood: Mesh
    foliage: Mesh

    @property
    def pieces(self) -> dict[str, Mesh]:
        """The meshes by the names of their materials in the mesh file."""
        return {WOOD: self.wood, LEAVES: self.foliage}

    @property
    def triangles(self) -> int:
        """Number of triangles of both meshes."""
        return len(self.wood[1]) + len(self.foliage[1])

    def parts(
        self,
        name: str,
        wood: Material,
        leaves: Material,
        position: Floats | None = None,
    ) -> tuple[Part, Part]:
        """Return its parts in a scene, at a position, (3,) m, or at the origin."""
        offset = np.zeros(3) if position is None else position
        return (
            Part(name, wood, self.wood[0] + offset, self.wood[1]),
            Part(name, leaves, self.foliage[0] + offset, self.foliage[1]),
        )


def make_plant(parameters: PlantParameters, seed: int, name: str) -> Plant:
    """Create a plant with leaves; the same seed and name give the same plant."""
    rng = generator_for(seed, "plants", name)
    skeleton = grow(parameters, rng)
    return Plant(bark(skeleton), foliage(parameters, skeleton, rng))


def make_shrubs(seed: int, parameters: PlantParameters = SHRUB) -> dict[str, Plant]:
    """Create one shrub with foliage in each of ``SHAPES``; wood and crown are the same.

    A ball fills the crown; a cloud has a small ball around the end of each twig;
    leaves are there, too.

    Args:
        seed: Seed of wood and leaves.
        parameters: Parameters with a spherical crown.
    """
    rng = generator_for(seed, "plants", "shrub")
    skeleton = grow(parameters, rng)
    vertices, faces = sphere(parameters.crown_radius)
    # Balls of the cloud are around the twigs' ends, moved inward to fit into the crown.
    ends = skeleton.points[skeleton.tips] - parameters.centre
    distances = np.linalg.norm(ends, axis=1, keepdims=True)
    inward = np.minimum(
        1.0,
        (parameters.crown_radius - TUFT_RADIUS) / np.maximum(distances, TUFT_RADIUS),
    )
    ends = parameters.centre + inward * ends
    shapes = {
        "ball": (vertices + parameters.centre, faces),
        "cloud": concatenate([ball(end, TUFT_RADIUS) for end in ends]),
        "leaves": foliage(parameters, skeleton, rng),
    }
    wood = bark(skeleton)
    return {shape: Plant(wood, shapes[shape]) for shape in SHAPES}


def plant_files(seed: int = SEED) -> dict[str, bytes]:
    """Return the contents of all mesh files of plants, by file name."""
    plants = {f"shrub_{name}": each for name, each in make_shrubs(seed).items()}
    plants["tree"] = make_plant(TREE, seed, "tree")
    plants["young_tree"] = make_plant(YOUNG_TREE, seed, "young tree")
    return {f"{name}.glb": encode_glb(each.pieces) for name, each in plants.items()}


def encode_glb(pieces: Mapping[str, Mesh]) -> bytes:
    """Encode meshes, by the names of their materials, as a binary glTF file.

    Args:
        pieces: Meshes with z up; in the file y is up. Coordinates are rounded to
            0.1 mm, so that all machines write the same ones.
    """
    import trimesh  # noqa: PLC0415 - slow to import

    scene: Any = trimesh.Scene()
    visual: Any = trimesh.visual
    for name, (vertices, faces) in pieces.items():
        x, y, z = (np.round(vertices / GRID) * GRID).T
        material = visual.material.PBRMaterial(name=name, doubleSided=True)
        mesh = trimesh.Trimesh(
            np.column_stack([x, z, -y]) + 0.0,  # no negative zeros
            faces,
            process=False,
            visual=visual.TextureVisuals(material=material),
        )
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    content: bytes = scene.export(file_type="glb")
    return content
