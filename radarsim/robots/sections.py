"""Cutting triangles with level planes."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.robots.footprint import NO_SEGMENTS
from radarsim.scene.scene import Part


def section(vertices: Floats, faces: NDArray[np.int32], height: float) -> Floats:
    """Cut a mesh at one height.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) rows of vertex numbers.
        height: z of the plane, m. A vertex in the plane counts as above it, so that
            the section of a closed mesh is closed, and a mesh that stands on the plane
            leaves no line.

    Returns:
        Line segments, (S, 2, 2) m: x and y of both ends; where the plane only grazes
        a corner, the ends are the same.
    """
    corners = vertices[faces]  # (F, 3, 3)
    above = corners[:, :, 2] >= height
    cut = above.any(axis=1) & ~above.all(axis=1)
    corners, above = corners[cut], above[cut]
    # the corner that is alone on its side goes first
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    first, others = corners[:, :1], corners[:, 1:]
    share = (height - first[..., 2:]) / (others[..., 2:] - first[..., 2:])
    ends = (first + share * (others - first))[..., :2]
    return np.ascontiguousarray(ends)


def outlines(parts: Iterable[Part], height: float) -> Floats:
    """Cut parts of a scene at one height.

    Args:
        parts: All of them, solid or not.
        height: z of the plane, m, map frame.

    Returns:
        The sections one after the other, (S, 2, 2) m: x and y of both ends.
    """
    cuts = [section(part.vertices, part.faces, height) for part in parts]
    return np.concatenate([NO_SEGMENTS, *cuts])
