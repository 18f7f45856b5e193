"""Meshes, and several of them as one."""

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.plants.growth import PlantParameters, Skeleton
from radarsim.scene.shapes import Faces

Mesh: TypeAlias = tuple[Floats, Faces]  # (V, 3) m and (F, 3), wound outward if closed


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes into one, each with vertices of its own; at least one."""
    counts = [len(vertices) for vertices, _ in meshes]
    starts = np.cumsum([0, *counts[:-1]])
    moved = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(moved).astype(np.int32)


# Section from plants.tubes.
# Bark: closed tapered tubes along the middle lines of wood, and small balls.

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


# Section from plants.leaves.
# Leaves: open rhombs of two triangles that share the midrib.


def foliage(
    form: PlantParameters, skeleton: Skeleton, rng: np.random.Generator
) -> Mesh:
    """Hang leaves around the ends of twigs, as many around each; all in the crown.

    They point away from their twig's end, and face any way.
    """
    ends = skeleton.points[skeleton.tips]
    owners = np.arange(form.leaves) % len(ends)
    offsets = _offsets(form, ends[owners], rng)
    ribs = offsets / form.cluster + rng.standard_normal(offsets.shape)
    return rhombs(form, ends[owners] + offsets, ribs, rng)


def rhombs(
    form: PlantParameters, middles: Floats, ribs: Floats, rng: np.random.Generator
) -> Mesh:
    """Make a leaf around each of some points, turned about its rib at random.

    Args:
        form: Says how large leaves are.
        middles: (N, 3) m.
        ribs: (N, 3) where they point, of any length but none.
        rng: What turns them.

    Returns:
        Of each leaf base, right, tip, left: (4N, 3) m; and (2N, 3) faces, which have
        the edge from base to tip in common.
    """
    ribs = ribs / np.linalg.norm(ribs, axis=1, keepdims=True)
    others = rng.standard_normal(ribs.shape)
    blades = np.cross(ribs, others)
    blades /= np.linalg.norm(blades, axis=1, keepdims=True)
    rib, blade = ribs * form.leaf_length / 2, blades * form.leaf_width / 2
    corners = [middles - rib, middles - blade, middles + rib, middles + blade]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(middles))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def _offsets(form: PlantParameters, ends: Floats, rng: np.random.Generator) -> Floats:
    """Draw where leaves are, seen from their twigs' ends, until all are in the crown.

    A leaf is in it with all its corners, whichever way it faces.
    """
    share = form.leaf_length / 2 / form.half_axes.min()
    room = form.half_axes * (1 - share)
    offsets = np.zeros_like(ends)
    out = np.arange(len(ends))
    while len(out):
        offsets[out] = rng.normal(0, form.cluster, (len(out), 3))
        places = (ends[out] + offsets[out] - form.centre) / room
        out = out[np.linalg.norm(places, axis=1) > 1]
    return offsets
