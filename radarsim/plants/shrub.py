"""Plants of wood and foliage, and one shrub whose foliage has three shapes.

The wood is the same in all three: it stands in the same way of the same rays, so that
what differs is the foliage, and a plant of a map is what has been calibrated.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.plants.forms import LEAVES, SHRUB, WOOD, PlantForm
from radarsim.plants.growth import Skeleton, grow
from radarsim.plants.joining import Mesh, join
from radarsim.plants.leaves import foliage
from radarsim.plants.tubes import ball, bark
from radarsim.randomness import generator_for
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


def make_plant(form: PlantForm, seed: int, name: str) -> Plant:
    """Make a plant with leaves; of one seed and name there is one plant."""
    rng = generator_for(seed, "plants", name)
    skeleton = grow(form, rng)
    return Plant(bark(skeleton), foliage(form, skeleton, rng))


def make_shrubs(seed: int, form: PlantForm = SHRUB) -> dict[str, Plant]:
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


def _cloud(form: PlantForm, skeleton: Skeleton) -> Mesh:
    """Put a tuft around each end, moved inward where it would not fit."""
    ends = skeleton.points[skeleton.tips] - form.centre
    out = np.linalg.norm(ends, axis=1, keepdims=True)
    inward = np.minimum(1.0, (form.crown_radius - TUFT) / np.maximum(out, TUFT))
    return join([ball(place, TUFT) for place in form.centre + inward * ends])
