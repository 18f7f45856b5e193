"""Bounding boxes of the parts of triangles that are between two heights.

A level ray crosses a triangle where the triangle has the ray's height. A box around
that part alone is smaller than one around the triangle, and fewer rays meet it.
"""

from typing import Final

import numpy as np

from radarsim.geometry import Floats

_BLOCK: Final = 50_000  # triangles of which intermediate results fit into memory


def clip_to_slab(triangles: Floats, low: float, high: float) -> Floats:
    """Return points that have the bounding boxes of the parts within a slab.

    Args:
        triangles: (T, 9) m, the corners of triangles that reach into the slab.
        low: z, m, at which it begins.
        high: z, m, at which it ends.

    Returns:
        (T, 9) m, three points for each triangle: the lower corner of the box, its upper
        corner, and the lower one again.
    """
    outlines = np.zeros((len(triangles), 9))
    for start in range(0, len(triangles), _BLOCK):
        rows = slice(start, start + _BLOCK)
        points = _outline(triangles[rows].reshape(-1, 3, 3), low, high)
        outlines[rows, :3] = outlines[rows, 6:] = np.nanmin(points, axis=1)
        outlines[rows, 3:6] = np.nanmax(points, axis=1)
    return outlines


def _outline(corners: Floats, low: float, high: float) -> Floats:
    """Return the corners of the parts, (T, 9, 3) m; nan for those that there are not.

    They are the triangle's corners within the slab, and the points at which its edges
    cross the slab's faces.
    """
    z = corners[:, :, 2:]
    points = [np.where((z >= low) & (z <= high), corners, np.nan)]
    ends = np.roll(corners, -1, axis=1)
    for height in (low, high):
        before, after = z - height, ends[:, :, 2:] - height
        crosses = before * after < 0.0
        share = before / np.where(crosses, before - after, 1.0)
        points.append(np.where(crosses, corners + share * (ends - corners), np.nan))
    return np.concatenate(points, axis=1)
