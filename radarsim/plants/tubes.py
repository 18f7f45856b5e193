"""Bark: closed tapered tubes along the middle lines of wood, and small balls."""

from typing import Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.plants.growth import Skeleton
from radarsim.plants.joining import Mesh, join
from radarsim.scene.shapes import Faces

FEWEST_SIDES: Final = 4
MOST_SIDES: Final = 10
SIDE: Final = 0.07  # m; how wide a side of thick wood may be


def bark(skeleton: Skeleton) -> Mesh:
    """Give wood a surface: a closed tube for each branch, which begins inside another.

    A stem's tube begins on the ground.
    """
    return join([_branch(skeleton, chain) for chain in _chains(skeleton)])


def tube(middle: Floats, radii: Floats, sides: int) -> Mesh:
    """Make a closed tube that is flat at its beginning and pointed at its end.

    Args:
        middle: (N, 3) m, its middle line; at least two points.
        radii: (N,) m; the last one does not count.
        sides: At least 3.
    """
    rings = len(middle) - 1
    u, v = _across(middle)
    angles = 2 * np.pi * np.arange(sides) / sides
    around = np.cos(angles)[:, None] * u[:, None] + np.sin(angles)[:, None] * v[:, None]
    walls = middle[:-1, None] + radii[:-1, None, None] * around[:-1]
    vertices = np.vstack([walls.reshape(-1, 3), middle[0], middle[-1]])
    return vertices, _tube_faces(rings, sides)


def ball(centre: Floats, radius: float, sides: int = 8, rings: int = 5) -> Mesh:
    """Make a small closed sphere of few faces; all its vertices are on the sphere."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 2)[1:-1]
    middle = np.zeros((rings + 1, 3))
    middle[:-1, 2], middle[-1, 2] = radius * np.sin(angles), radius
    vertices, faces = tube(middle, np.append(radius * np.cos(angles), 0.0), sides)
    vertices[-2] = [0.0, 0.0, -radius]  # the flat beginning becomes round, too
    return vertices + centre, faces


def _chains(skeleton: Skeleton) -> list[list[int]]:
    """Cut wood into branches: points of each, from where it leaves another one.

    Where wood branches, its thickest branch goes on.
    """
    count = len(skeleton.points)
    children: list[list[int]] = [[] for _ in range(count)]
    for point, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            children[parent].append(point)
    chains = []
    begun = [[point] for point in np.flatnonzero(skeleton.parents < 0).tolist()]
    while begun:
        chain = begun.pop()
        while children[chain[-1]]:
            fork = chain[-1]
            first, *others = sorted(
                children[fork], key=lambda point: -skeleton.radii[point]
            )
            begun += [[fork, other] for other in others]
            chain.append(first)
        chains.append(chain)
    return chains


def _branch(skeleton: Skeleton, chain: list[int]) -> Mesh:
    radii = skeleton.radii[chain]
    if skeleton.parents[chain[0]] >= 0:
        radii[0] = radii[1]  # as thick as the branch, not as what it leaves
    girth = 2 * np.pi * float(radii[0])
    sides = int(np.clip(round(girth / SIDE), FEWEST_SIDES, MOST_SIDES))
    return tube(skeleton.points[chain], radii, sides)


def _across(middle: Floats) -> tuple[Floats, Floats]:
    """Give two directions across a line at each of its points, (N, 3) each.

    Seen from its end, the second one is counter-clockwise of the first.
    """
    ways = np.gradient(middle, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    least = np.abs(ways).mean(axis=0).argmin()  # an axis that it is never along
    u = np.cross(np.eye(3)[least], ways)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(ways, u)


def _tube_faces(rings: int, sides: int) -> Faces:
    here = np.arange(sides)
    there = (here + 1) % sides
    foot, tip = np.full(sides, rings * sides), np.full(sides, rings * sides + 1)
    last = (rings - 1) * sides
    triangles = [(foot, there, here), (tip, last + here, last + there)]
    for ring in range(rings - 1):
        low, high = ring * sides, (ring + 1) * sides
        triangles.append((low + here, low + there, high + there))
        triangles.append((low + here, high + there, high + here))
    faces = np.vstack([np.column_stack(corners) for corners in triangles])
    return faces.astype(np.int32)
