"""Shells: the connected surfaces of a mesh, and which side of them is inside.

A surface encloses a volume if every edge is run through as often in one direction
as in the other. That holds as well where several volumes touch along an edge, or lie
exactly upon one another, and it makes "how many times does the surface contain this
point" a whole number, from which densities add up.

Faces that share an edge belong to one shell; a common vertex alone does not join.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces

Labels: TypeAlias = NDArray[np.int32]
_Ints: TypeAlias = NDArray[np.int64]


def weld_vertices(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Give vertices at exactly equal places one number.

    Vertices without faces are left out, and faces that vanish by the merging.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
    """
    used, numbers = np.unique(faces, return_inverse=True)
    tidy = vertices[used] + 0.0  # -0.0 and 0.0 are one place
    merged, places = np.unique(tidy, axis=0, return_inverse=True)
    renamed = places.reshape(-1)[numbers.reshape(-1, 3)].astype(np.int32)
    a, b, c = renamed.T
    return merged, renamed[(a != b) & (b != c) & (c != a)]


def count_open_edges(faces: Faces) -> int:
    """Count the edges of (F, 3) faces that are not used equally in both directions."""
    edges, directions, _ = _edges(faces)
    return int(np.count_nonzero(np.bincount(edges, weights=directions)))


def is_closed(faces: Faces) -> bool:
    """Tell whether (F, 3) faces, if there are any, enclose a volume."""
    return count_open_edges(faces) == 0


def label_components(faces: Faces) -> Labels:
    """Number the shells of (F, 3) faces: (F,) int32, from 0 in the order of faces.

    Vertices at equal places must have equal numbers, see `weld_vertices`.
    """
    edges, _, owners = _edges(faces)
    order = np.argsort(edges, kind="stable")
    same = edges[order][1:] == edges[order][:-1]
    pairs = np.column_stack([owners[order][:-1], owners[order][1:]])[same]
    return _components(len(faces), pairs)


def orient_outward(vertices: Floats, faces: Faces) -> Faces | None:
    """Wind the faces of a closed surface so that outward is outward.

    Where neighbours disagree, or a shell is inside out, faces are turned round. A
    shell that is inside out and lies in another one is a cavity and stays as it is;
    in a mesh whose neighbours disagree no cavity can be told from a nested volume,
    and every shell is wound outward.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) rows of vertex numbers.

    Returns:
        The faces, or None if the surface is not closed, or has only one side.
    """
    if is_closed(faces):
        return _turn_stray_shells(vertices, faces)
    consistent = _make_consistent(faces)
    if consistent is None:
        return None
    shells = label_components(consistent)
    return _turned(
        consistent, (_shell_volumes(vertices, consistent, shells) < 0)[shells]
    )


def _edges(faces: Faces) -> tuple[_Ints, _Ints, _Ints]:
    """Give each face's three edges: edge number, direction (1 or -1), owning face."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    low, high = ends.min(axis=1), ends.max(axis=1)
    size = int(high.max(initial=0)) + 1
    _, numbers = np.unique(low * size + high, return_inverse=True)
    directions = np.where(ends[:, 0] < ends[:, 1], 1, -1)
    return numbers.reshape(-1), directions, np.repeat(np.arange(len(faces)), 3)


def _components(count: int, pairs: _Ints) -> Labels:
    """Number the connected components of ``count`` nodes that (P, 2) pairs join."""
    roots = np.arange(count)
    while pairs.size:
        ends = roots[pairs]
        pairs = pairs[ends[:, 0] != ends[:, 1]]
        ends = roots[pairs]
        np.minimum.at(roots, ends.max(axis=1), ends.min(axis=1))
        while np.any(roots != roots[roots]):
            roots = roots[roots]
    _, labels = np.unique(roots, return_inverse=True)
    return labels.reshape(-1).astype(np.int32)


def _make_consistent(faces: Faces) -> Faces | None:
    """Turn faces until neighbours agree; None if edges are open or it can't be done.

    Each face stands twice in a graph, as it is and turned round. Two neighbours that
    agree join like with like, two that disagree join unlike. A face that is joined to
    its own turned copy lies on a surface with one side.
    """
    edges, directions, owners = _edges(faces)
    if np.any(np.bincount(edges) != 2):
        return None
    order = np.argsort(edges, kind="stable").reshape(-1, 2)
    first, second = owners[order].T
    agree = directions[order].sum(axis=1) == 0
    count = len(faces)
    partner = np.where(agree, second, second + count)
    opposite = np.where(agree, second + count, second)
    pairs = np.vstack(
        [np.column_stack([first, partner]), np.column_stack([first + count, opposite])]
    )
    labels = _components(2 * count, pairs)
    as_is, turned = labels[:count], labels[count:]
    return None if np.any(as_is == turned) else _turned(faces, as_is > turned)


def _turn_stray_shells(vertices: Floats, faces: Faces) -> Faces:
    """Turn everything if the whole is inside out, then shells that are in no other."""
    shells = label_components(faces)
    volumes = _shell_volumes(vertices, faces, shells)
    if volumes.sum() < 0:
        faces, volumes = _turned(faces, np.ones(len(faces), dtype=bool)), -volumes
    lows, highs = shell_boxes(vertices, faces, shells, len(volumes))
    stray = np.zeros(len(volumes), dtype=bool)
    for shell in np.flatnonzero(volumes < 0):
        around = (lows <= lows[shell]).all(axis=1) & (highs >= highs[shell]).all(axis=1)
        hull = faces[(around & (volumes > 0))[shells]]
        inner = vertices[faces[shells == shell][0]].mean(axis=0)
        stray[shell] = not contains(vertices, hull, inner)
    return _turned(faces, stray[shells])


def _turned(faces: Faces, which: NDArray[np.bool_]) -> Faces:
    turned = faces.copy()
    turned[which] = faces[which][:, ::-1]
    return turned


def _shell_volumes(vertices: Floats, faces: Faces, shells: Labels) -> Floats:
    """Give the signed volume of each shell, m³; negative where it is inside out."""
    centre = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
    a, b, c = (vertices[faces[:, i]] - centre for i in range(3))
    sixths: Floats = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(shells, weights=sixths).astype(np.float64)


def shell_boxes(
    vertices: Floats, faces: Faces, shells: Labels, count: int
) -> tuple[Floats, Floats]:
    """Give the smallest and the largest x, y, z of each shell, (S, 3) m each.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
        shells: (F,) the shell of each face, from 0.
        count: S, the number of shells.
    """
    lows, highs = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lows, shells, vertices[faces].min(axis=1))
    np.maximum.at(highs, shells, vertices[faces].max(axis=1))
    return lows, highs


def contains(vertices: Floats, faces: Faces, point: Floats) -> bool:
    """Tell whether closed faces, wound outward, enclose a point.

    Uses the solid angle of the faces as seen from there, by Van Oosterom and
    Strackee: 4 pi from inside, 0 from outside.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
        point: (3,) m, on none of the faces.
    """
    corners = vertices[faces] - point
    a, b, c = (corners[:, i] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    angles = 2 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(angles.sum() > 2 * np.pi)


# Section from scene.emptiness.
# Faces that look like a volume's but have nothing inside.
#
# Every edge of a sheet whose faces stand there in both windings is run through as
# often
# one way as the other, so that it passes for a closed surface; but its windings
# cancel,
# and beams would go through it as if it were not there. The same holds for what is
# folded flat.
#
# Faces that cancel are right in one place: inside of a volume, as the common wall of
# two
# that touch. Everything else that cancels, and every shell without a volume, is
# empty.
# Faces cancel if they have the same three corners; where two sides are cut into
# triangles
# differently, it is the volume of the whole shell that tells.

FLATNESS = 1e-9  # a shell's volume over its area and size; rounding is far below


def count_empty(vertices: Floats, faces: Faces) -> tuple[int, int]:
    """Count the faces of a closed mesh, wound outward, that enclose nothing.

    Args:
        vertices: (V, 3) m; equal places that are to meet have one number.
        faces: (F, 3) rows of vertex numbers.

    Returns:
        How many stand there in both windings, each counted once, without being a wall
        inside of a volume; and how many of the others belong to flat shells.
    """
    cancelled = _cancelled(faces)
    hull = faces[~cancelled]
    shells = label_components(hull)
    lows, highs = shell_boxes(vertices, hull, shells, int(shells.max(initial=-1)) + 1)
    flat = _is_flat(vertices, hull, shells, lows, highs)
    walls = faces[cancelled]
    groups, firsts, sizes = np.unique(
        label_components(walls), return_index=True, return_counts=True
    )
    empty = 0
    for group in groups:
        point = vertices[walls[firsts[group]]].mean(axis=0)
        around = ((lows <= point) & (point <= highs)).all(axis=1)
        if not contains(vertices, hull[around[shells]], point):
            empty += int(sizes[group])
    return empty // 2, int(np.count_nonzero(flat[shells]))


def _cancelled(faces: Faces) -> NDArray[np.bool_]:
    """Mark the faces that stand there as often in one winding as in the other."""
    _, numbers = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    a, b, c = faces.T
    forward = ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))
    numbers = numbers.reshape(-1)
    sums = np.bincount(numbers, weights=np.where(forward, 1, -1))
    cancelled: NDArray[np.bool_] = sums[numbers] == 0
    return cancelled


def _is_flat(
    vertices: Floats, faces: Faces, shells: NDArray[np.int32], low: Floats, high: Floats
) -> NDArray[np.bool_]:
    """Tell which shells enclose no volume, (S,)."""
    corners = vertices[faces] - low[shells][:, None]
    a, b, c = (corners[:, i] for i in range(3))
    volumes = np.bincount(shells, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)
    areas = np.bincount(shells, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    sizes = np.linalg.norm(high - low, axis=1)
    flat: NDArray[np.bool_] = np.abs(volumes) <= FLATNESS * areas * sizes
    return flat
