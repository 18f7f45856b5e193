"""Faces that look like a volume's but have nothing inside.

Every edge of a sheet whose faces stand there in both windings is run through as often
one way as the other, so that it passes for a closed surface; but its windings cancel,
and beams would go through it as if it were not there. The same holds for what is
folded flat.

Faces that cancel are right in one place: inside of a volume, as the common wall of two
that touch. Everything else that cancels, and every shell without a volume, is empty.
Faces cancel if they have the same three corners; where two sides are cut into triangles
differently, it is the volume of the whole shell that tells.
"""

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces
from radarsim.scene.shells import contains, shell_boxes, split_shells

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
    shells = split_shells(hull)
    lows, highs = shell_boxes(vertices, hull, shells, int(shells.max(initial=-1)) + 1)
    flat = _is_flat(vertices, hull, shells, lows, highs)
    walls = faces[cancelled]
    groups, firsts, sizes = np.unique(
        split_shells(walls), return_index=True, return_counts=True
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
