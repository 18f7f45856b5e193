"""Meshes, and several of them as one."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces

Mesh: TypeAlias = tuple[Floats, Faces]  # (V, 3) m and (F, 3), wound outward if closed


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Put meshes into one, each with vertices of its own; at least one."""
    counts = [len(vertices) for vertices, _ in meshes]
    starts = np.cumsum([0, *counts[:-1]])
    moved = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(moved).astype(np.int32)
