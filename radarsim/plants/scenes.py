"""Scenes of many leaves, made from numbers alone."""

import math
from typing import Final

import numpy as np

from radarsim.geometry import rotation_matrix
from radarsim.plants.growth import SHRUB
from radarsim.plants.mesh import Mesh
from radarsim.plants.plant import Plant, make_shrubs
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

LEAF: Final = Material("leaf", density=0.0, sheet_loss=0.4)
WOOD: Final = Material("wood")
WALL: Final = Material("wall")
STEP: Final = 2.2 * SHRUB.crown_radius  # m between neighbours
FIRST: Final = -4.0  # m, x of the first row
BEFORE: Final = 4.0  # m from there to the wall, and room for a sensor


def leaf_scene(triangles: int) -> Scene:
    """Make a room full of shrubs of leaves, with so many triangles, more or less.

    They stand in a square of rows from x = -4 m on, each turned in another direction,
    so that there is room for a sensor at x = -6, y = 0. No two of them touch.

    Args:
        triangles: At least one shrub is made, of some 15,000.
    """
    shrub = make_shrubs(0)["leaves"]
    count = max(1, round(triangles / shrub.triangles))
    rng = generator_for(0, "plants", "leaf scene")
    side = math.ceil(math.sqrt(count))
    parts = [_room(side)]
    for number in range(count):
        row, column = divmod(number, side)
        place = np.array([FIRST + STEP * row, STEP * (column - (side - 1) / 2), 0.0])
        turned = _turned(shrub, rng.uniform(0, 2 * math.pi))
        parts += turned.parts(f"shrub_{number + 1}", WOOD, LEAF, place)
    return Scene("leaves", "Leaves", tuple(parts))


def _room(side: int) -> Part:
    length, width, height = BEFORE + STEP * side, STEP * (side + 2), 6.0
    vertices, faces = box(length, width, height)
    middle = [FIRST - BEFORE + length / 2, 0.0, height / 2]
    return Part("room", WALL, vertices + np.array(middle), faces)


def _turned(plant: Plant, yaw: float) -> Plant:
    turn = rotation_matrix(0.0, 0.0, yaw).T

    def turned(mesh: Mesh) -> Mesh:
        return mesh[0] @ turn, mesh[1]

    return Plant(turned(plant.wood), turned(plant.foliage))
