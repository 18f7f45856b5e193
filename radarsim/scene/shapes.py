"""Primitive shapes as closed triangle meshes.

Every shape is centred on the origin, closed, and oriented outward: seen from outside,
the corners of a face run counter-clockwise. Round shapes are inscribed: all vertices
lie on the true surface, without rounding errors on the axes, and every face lies inside
the surface.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats

Faces: TypeAlias = NDArray[np.int32]
Mesh: TypeAlias = tuple[Floats, Faces]  # (V, 3) m and (F, 3) vertex indices

SPHERE_SUBDIVISIONS = 3  # 1280 faces, at most 0.46 % of the radius inside the sphere
CYLINDER_SIDES = 64  # sides are at most 0.12 % of the radius inside the cylinder

_BOX_CORNERS = np.array(
    [[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
)
_BOX_SIDES = [  # two triangles each
    [[0, 2, 3], [0, 3, 1]],  # bottom
    [[4, 5, 7], [4, 7, 6]],  # top
    [[0, 1, 5], [0, 5, 4]],  # right, -y
    [[2, 6, 7], [2, 7, 3]],  # left, +y
    [[0, 4, 6], [0, 6, 2]],  # back, -x
    [[1, 3, 7], [1, 7, 5]],  # front, +x
]
_BOX_FACES = np.array(_BOX_SIDES, dtype=np.int32).reshape(-1, 3)
_ICOSAHEDRON_FACES = [
    *([0, 1, 2], [0, 7, 1], [0, 2, 6], [0, 6, 5], [0, 5, 7], [1, 8, 2], [1, 7, 3]),
    *([1, 3, 8], [2, 4, 6], [2, 8, 4], [3, 7, 11], [3, 9, 8], [3, 11, 9], [4, 10, 6]),
    *([4, 8, 9], [4, 9, 10], [5, 6, 10], [5, 11, 7], [5, 10, 11], [9, 11, 10]),
]


class Surface(NamedTuple):
    """One piece of a mesh file, in the frame of the file.

    Attributes:
        material: Name of the material in the file; None if it has no name.
        vertices: (V, 3) in the file's unit.
        faces: (F, 3) vertex indices.
    """

    material: str | None
    vertices: Floats
    faces: Faces


def box(length: float, width: float, height: float) -> Mesh:
    """Create a box; length, width and height are along x, y and z, in m."""
    return _BOX_CORNERS * [length, width, height], _BOX_FACES.copy()


def sphere(radius: float) -> Mesh:
    """Create a sphere of 1280 faces; radius in m."""
    vertices, faces = _unit_sphere()
    return vertices * radius, faces.copy()


def cylinder(radius: float, height: float) -> Mesh:
    """Create an upright cylinder of 64 sides; radius and height in m."""
    n = CYLINDER_SIDES
    angles = np.arange(n) * (2 * np.pi / n)
    rim = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    low, high = np.full((n, 1), -height / 2), np.full((n, 1), height / 2)
    centres = [[0.0, 0.0, -height / 2], [0.0, 0.0, height / 2]]
    vertices = np.vstack([np.hstack([rim, low]), np.hstack([rim, high]), centres])
    here = np.arange(n)
    following = (here + 1) % n
    bottom, top = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    triangles = [
        (here, following, following + n),
        (here, following + n, here + n),
        (bottom, following, here),
        (top, here + n, following + n),
    ]
    faces = np.vstack([np.column_stack(corners) for corners in triangles])
    return vertices, faces.astype(np.int32)


def octahedron(radius: float) -> Mesh:
    """Create an octahedron with a corner at ``radius``, m, on each half-axis."""
    vertices = radius * np.vstack([np.eye(3), -np.eye(3)])
    faces = [
        (x, y, z) if (x < 3) ^ (y < 3) ^ (z < 3) else (x, z, y)
        for x in (0, 3)
        for y in (1, 4)
        for z in (2, 5)
    ]
    return vertices, np.array(faces, dtype=np.int32)


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Join one or more meshes into one; vertices are not merged."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = accumulate((len(vertices) for vertices, _ in meshes[:-1]), initial=0)
    shifted = [
        faces + offset for (_, faces), offset in zip(meshes, offsets, strict=True)
    ]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(shifted).astype(np.int32)


@lru_cache(maxsize=1)
def _unit_sphere() -> Mesh:
    """Subdivide an icosahedron; the midpoints of some of its edges are on the axes."""
    vertices, faces = _icosahedron()
    for _ in range(SPHERE_SUBDIVISIONS):
        vertices, faces = _subdivide(vertices, faces)
    return vertices, faces


def _icosahedron() -> Mesh:
    """Return the 12 corners, on the unit sphere, and the 20 faces, oriented outward."""
    golden = (1 + 5**0.5) / 2
    pairs = [(a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    corners = [
        corner for a, b in pairs for corner in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))
    ]
    faces = np.array(_ICOSAHEDRON_FACES, dtype=np.int32)
    return _on_unit_sphere(np.array(corners)), faces


def _subdivide(vertices: Floats, faces: Faces) -> Mesh:
    """Split every face into four, projecting the edges' midpoints onto the sphere."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, indices = np.unique(edges, axis=0, return_inverse=True)
    midpoints = _on_unit_sphere(vertices[unique].sum(axis=1))
    ab, bc, ca = (indices.reshape(-1, 3) + len(vertices)).T
    a, b, c = faces.T
    corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    split = np.vstack([np.column_stack(corner) for corner in corners])
    return np.vstack([vertices, midpoints]), split.astype(np.int32)


def _on_unit_sphere(points: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(points, axis=1, keepdims=True)
    return points / lengths
