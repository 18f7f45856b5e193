"""Scenes for benchmarks, generated from a few numbers."""

import math

import numpy as np

from radarsim.geometry import Floats
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Faces, box, sphere

WALL = Material("wall")
FOLIAGE = Material("foliage", density=1.0)
SENSOR = (-6.0, 0.0, 0.0)  # x, y, yaw in all of these scenes


def foliage_wall(spheres: int = 60) -> Scene:
    """Create a room with a wall of foliage spheres across it, 1280 triangles each.

    Neighbours overlap by 4 % of their diameters. A ray of power 1 from ``SENSOR``
    crosses 1.7 surfaces before it is spent, or through.
    """
    rng = np.random.Generator(np.random.PCG64(7))
    radii = rng.uniform(0.48, 0.74, spheres)
    steps = 0.96 * (radii[1:] + radii[:-1])
    places = np.concatenate([[0.0], np.cumsum(steps)])
    places -= places.mean()
    width = float(places[-1] - places[0]) + 2.0
    parts = [_placed("room", WALL, box(24.0, width, 6.0), (0.0, 0.0, 2.0))]
    for i, (radius, y) in enumerate(zip(radii.tolist(), places.tolist(), strict=True)):
        parts.append(_placed(f"bush_{i}", FOLIAGE, sphere(radius), (0.0, y, 0.35)))
    return Scene("foliage_wall", "FoliageWall", tuple(parts))


def bumpy_room(triangles: int) -> Scene:
    """Create an opaque room whose far wall has about the given number of triangles."""
    n = max(2, round(math.sqrt(triangles / 2)))
    steps = np.linspace(-8.0, 8.0, n + 1)
    y, z = np.meshgrid(steps, steps * 0.25 + 1.0, indexing="ij")
    x = 6.0 + 0.2 * np.sin(3.0 * y) * np.cos(5.0 * z)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([a, a + 1, a + n + 2]),
            np.column_stack([a, a + n + 2, a + n + 1]),
        ]
    )
    room = _placed("room", WALL, box(20.0, 20.0, 8.0), (0.0, 0.0, 2.0))
    return Scene("bumpy", "Bumpy", (room, Part("far", WALL, vertices, faces)))


def curtains(count: int) -> Scene:
    """Create a room with thin volumes in a row; a ray crosses two surfaces of each."""
    thin = Material("thin", density=0.001)
    parts = [_placed("room", WALL, box(40.0, 40.0, 6.0), (0.0, 0.0, 2.0))]
    for i in range(count):
        place = (-4.0 + 0.5 * i, 0.0, 1.0)
        parts.append(_placed(f"curtain_{i}", thin, box(0.2, 30.0, 3.0), place))
    return Scene("curtains", "Curtains", tuple(parts))


def hall_of_mirrors() -> Scene:
    """Create a room whose walls are mirrors, with a wall of foliage across it."""
    silver = Material("silver", radar_mirror=True)
    parts = [
        Part(part.object_name, silver, part.vertices, part.faces)
        if part.object_name == "room"
        else part
        for part in foliage_wall().parts
    ]
    return Scene("mirrors", "Mirrors", tuple(parts))


def _placed(
    name: str,
    material: Material,
    shape: tuple[Floats, Faces],
    place: tuple[float, float, float],
) -> Part:
    vertices, faces = shape
    return Part(name, material, vertices + np.array(place), faces)
