"""Passes over the faces of triangle meshes.

Theory of operation
===================
Each pass takes time and memory in proportion to the faces, whatever their order.

Equal vertices find each other in a hash table with open addressing.

Edges are found by a counting sort of the sides of all faces by their lower vertex.
Among the sides at one vertex, those with the same other end are one edge: for each
other end an array holds the place of its first side, and a place before the vertex's
own sides is one that an earlier vertex has left. So a fan of a million faces around one
vertex takes no longer than a grid of as many.

Faces are united over their edges in a forest (union-find): the root of a tree is the
first face of its component. Each face also holds whether it disagrees with its parent,
so that the forest tells which faces to flip for all to agree with the first one.
"""

from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces

Labels: TypeAlias = NDArray[np.int32]
_Integers: TypeAlias = NDArray[np.int32]
_Number = TypeVar("_Number", np.float64, np.int32)


class Connections(NamedTuple):
    """How faces share edges.

    Attributes:
        labels: (F,) the connected component of each face; components are numbered in
            the order of their first faces.
        flipped: (F,) whether the face disagrees with the first of its component.
        components: The number of components.
        open_edges: The number of edges that are not used as often in one direction as
            in the other.
        unpaired_edges: The number of edges that are not used by two faces.
        has_one_side: Whether a component cannot be oriented, such as a Möbius strip;
            means nothing if there are unpaired edges.
        may_coincide: Whether some faces may have the same three corners.
    """

    labels: Labels
    flipped: NDArray[np.bool_]
    components: int
    open_edges: int
    unpaired_edges: int
    has_one_side: bool
    may_coincide: bool


class Sizes(NamedTuple):
    """Sizes of C connected components.

    Attributes:
        volumes: (C,) m³; negative if a component is inside out.
        areas: (C,) m².
        lows: (C, 3) m, the smallest x, y, z.
        highs: (C, 3) m, the largest ones.
    """

    volumes: Floats
    areas: Floats
    lows: Floats
    highs: Floats


def weld_vertices(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Merge vertices at equal positions, and drop faces that lose a corner by it.

    Args:
        vertices: (V, 3) m, finite.
        faces: (F, 3) vertex indices.

    Returns:
        The vertices that faces use, in the order of their first use, and the faces that
        are left.
    """
    vertices, faces = _readable(vertices, np.float64), _readable(faces, np.int32)
    numbers = np.zeros(len(vertices), np.int32)
    kept = np.zeros(len(vertices), np.int32)
    merged = np.zeros(faces.shape, np.int32)
    # A closed mesh has half as many vertices as faces; loose triangles need more slots.
    size = 2 ** (2 * min(len(vertices), len(faces))).bit_length()
    rows = -1
    while rows < 0:
        slots = np.full(size, -1, np.int32)
        numbers.fill(-1)
        count = np.zeros(1, np.int64)
        rows = engine.merge_vertices(
            vertices, faces, slots, kept, numbers, merged, count
        )
        size *= 4
    positions = vertices[kept[: count[0]]] + 0.0  # -0.0 and 0.0 are one position
    return positions, merged[:rows].copy()


def connect_faces(faces: Faces) -> Connections:
    """Find out how faces share edges.

    Args:
        faces: (F, 3) indices of merged vertices.
    """
    faces = _readable(faces, np.int32)
    vertices = int(faces.max(initial=-1)) + 1
    sides, starts = np.zeros(faces.size, np.int32), np.zeros(vertices + 2, np.int32)
    edges = np.full((3, vertices), -1, np.int32)
    parents, flips = np.arange(len(faces), dtype=np.int32), np.zeros(len(faces), bool)
    counts = np.zeros(4, np.int64)
    engine.unite_faces(faces, sides, starts, edges, parents, flips, counts)
    labels = np.zeros(len(faces), np.int32)
    components = engine.label_faces(parents, flips, labels)
    open_edges, unpaired, has_one_side, may_coincide = counts.tolist()
    return Connections(
        labels,
        flips,
        components,
        open_edges,
        unpaired,
        bool(has_one_side),
        bool(may_coincide),
    )


def measure_components(
    vertices: Floats, faces: Faces, labels: Labels, origins: Floats
) -> Sizes:
    """Measure connected components.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices.
        labels: (F,) the component of each face.
        origins: (C, 3) m, near each component: volumes far from it are inexact.
    """
    count = len(origins)
    sizes = Sizes(
        volumes=np.zeros(count),
        areas=np.zeros(count),
        lows=np.full((count, 3), np.inf),
        highs=np.full((count, 3), -np.inf),
    )
    vertices, faces = _readable(vertices, np.float64), _readable(faces, np.int32)
    labels, origins = _readable(labels, np.int32), _readable(origins, np.float64)
    engine.measure_components(vertices, faces, labels, origins, *sizes)
    return sizes


def _readable(array: NDArray[_Number], dtype: type[_Number]) -> NDArray[_Number]:
    """Return an array in the form that the engine takes."""
    return np.ascontiguousarray(array, dtype)
