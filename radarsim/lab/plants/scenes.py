"""Procedural scenes with many leaves."""

import math
from typing import Final

import numpy as np

from radarsim.geometry import rotation_matrix
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.plants.parameters import SHRUB
from radarsim.scene.plants.plant import Plant, make_shrubs
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

LEAF: Final = Material("leaf", density=0.0, sheet_loss=0.4)
WOOD: Final = Material("wood")
WALL: Final = Material("wall")
SPACING: Final = 2.2 * SHRUB.crown_radius  # m between neighbours
FIRST_ROW: Final = -4.0  # m, x of the first row
WALL_DISTANCE: Final = 4.0  # m from the first row to the wall, for a sensor


def leaf_scene(triangles: int) -> Scene:
    """Create a room of leafy shrubs with approximately a given number of triangles.

    The shrubs stand in a square grid from x = -4 m on, each with a random yaw, with
    space for a sensor at x = -6, y = 0. No two of them touch.

    Args:
        triangles: Number of triangles; at least one shrub is created, of about 15,000.
    """
    shrub = make_shrubs(0)["leaves"]
    count = max(1, round(triangles / shrub.triangles))
    rng = generator_for(0, "plants", "leaf scene")
    side = math.ceil(math.sqrt(count))
    length, width, height = WALL_DISTANCE + SPACING * side, SPACING * (side + 2), 6.0
    vertices, faces = box(length, width, height)
    centre = [FIRST_ROW - WALL_DISTANCE + length / 2, 0.0, height / 2]
    parts = [Part("room", WALL, vertices + np.array(centre), faces)]
    for number in range(count):
        row, column = divmod(number, side)
        position = np.array(
            [FIRST_ROW + SPACING * row, SPACING * (column - (side - 1) / 2), 0.0]
        )
        rotation = rotation_matrix(0.0, 0.0, rng.uniform(0, 2 * math.pi)).T
        rotated = Plant(
            (shrub.wood[0] @ rotation, shrub.wood[1]),
            (shrub.foliage[0] @ rotation, shrub.foliage[1]),
        )
        parts += rotated.parts(f"shrub_{number + 1}", WOOD, LEAF, position)
    return Scene("leaves", "Leaves", tuple(parts))
