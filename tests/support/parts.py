"""Parts of scenes: boxes of a material; rays along x; volumes of meshes."""

import math
from typing import Any

import numpy as np

from radarsim.geometry import Floats, rotation_matrix
from radarsim.raycast.rays import Rays
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Faces, box

Triple = tuple[float, float, float]
STONE = Material("stone")


def block(
    name: str, material: Material, size: Triple, place: Triple, yaw_deg: float = 0.0
) -> Part:
    """Return a box around a place."""
    vertices, faces = box(*size)
    turned = vertices @ rotation_matrix(0, 0, math.radians(yaw_deg)).T
    return Part(name, material, turned + np.array(place), faces)


def brick(
    material: Material, size: Triple, place: Triple, yaw_deg: float = 0.0
) -> Part:
    """Return a box with the name of its material."""
    return block(material.name, material, size, place, yaw_deg)


def layer(name: str, material: Material, near: float, far: float) -> Part:
    """Return what a ray along x crosses between two distances."""
    return block(name, material, (far - near, 4, 4), ((near + far) / 2, 0, 0))


def rays_ahead(count: int = 1, **settings: Any) -> Rays:
    """Return rays along x from the origin."""
    directions = np.tile([1.0, 0.0, 0.0], (count, 1))
    return Rays.uniform(
        np.zeros((count, 3)), directions, **{"max_range": 50.0} | settings
    )


def slab(
    x: float,
    y: float,
    size: tuple[float, float],
    *,
    z: float | None = None,
    high: float = 1.0,
) -> Part:
    """Return a box of stone that stands on the floor, or is around a height."""
    return brick(STONE, (*size, high), (x, y, high / 2 if z is None else z))


def volume(vertices: Floats, faces: Faces) -> float:
    """Return the volume of a closed mesh, positive if it is wound outward."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
