"""Topology of triangle meshes: connected components, orientation, degenerate faces.

Theory of operation
===================
A mesh is closed if every edge is used as often in one direction as in the other. That
also holds where several volumes touch along an edge or lie exactly upon one another,
and it makes the winding number of a point a whole number, from which densities add up.

Faces that share an edge belong to one connected component; a common vertex alone does
not connect them.

A sheet whose faces are all present in both orientations passes for a closed mesh, but
its faces cancel each other, and beams would pass it as if it were not there. The same
holds for a volume that is folded flat. Faces that cancel are legitimate in one place:
inside of a volume, as the common wall of two volumes that touch. All others, and all
components without a volume, are degenerate. Faces cancel if they have the same three
corners in opposite orientations; where the two sides of a sheet are triangulated
differently, the volume of the whole component shows it.

Each pass over the faces takes time and memory in proportion to them, whatever their
order.

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

FLATNESS = 1e-9  # volume over (area times size); rounding errors are far below

_Booleans: TypeAlias = NDArray[np.bool_]
Labels: TypeAlias = NDArray[np.int32]
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


def is_closed(faces: Faces) -> bool:
    """Return whether (F, 3) faces, if there are any, enclose a volume.

    Vertices at equal positions must be merged, see `weld_vertices`.
    """
    return connect_faces(faces).open_edges == 0


def orient_outward(vertices: Floats, faces: Faces) -> tuple[Faces, Connections] | None:
    """Orient the faces of a closed surface so that their normals point outward.

    Flips faces where neighbours disagree, and components that are inside out. A
    component that is inside out and lies in another one is a cavity and stays as it
    is; in a mesh whose neighbours disagree a cavity cannot be told from a nested
    volume, and every component is oriented outward.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        The faces, and how they shared edges before, which ``flipped`` refers to; None
        if the surface is not closed, or has only one side.
    """
    connections = connect_faces(faces)
    if connections.open_edges == 0:
        oriented = _flip_inverted_components(vertices, faces, connections)
        return oriented, connections
    if connections.unpaired_edges or connections.has_one_side:
        return None
    # All edges have two faces, which disagree at some: made consistent, it is closed.
    consistent = _flip(faces, connections.flipped)
    volumes, *_ = _measure(vertices, consistent, connections)
    oriented = _flip(consistent, (volumes < 0)[connections.labels])
    return oriented, connections


def encloses(vertices: Floats, faces: Faces, point: Floats) -> bool:
    """Return whether closed faces, oriented outward, enclose a point.

    Uses the solid angle of the faces as seen from the point (Van Oosterom and
    Strackee): 4 pi from inside, 0 from outside.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices.
        point: (3,) m, on none of the faces.
    """
    corners = vertices[faces] - point
    a, b, c = (corners[:, i] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    angles = 2 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(angles.sum() > 2 * np.pi)


def count_degenerate(
    vertices: Floats, faces: Faces, connections: Connections | None = None
) -> tuple[int, int]:
    """Count the faces of a closed mesh, oriented outward, that enclose nothing.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.
        connections: How the faces share edges, if that is known; whether they were
            flipped since then does not matter.

    Returns:
        How many faces are present in both orientations, each counted once, without
        being a wall inside of a volume; and how many of the others belong to flat
        components.
    """
    connections = connections or connect_faces(faces)
    walls = faces[:0]
    if connections.may_coincide:  # else the sorting of all faces is saved
        cancelled = _cancelled(faces)
        faces, walls = faces[~cancelled], faces[cancelled]
        connections = connect_faces(faces)
    sizes = _measure(vertices, faces, connections)
    # As seen from the components' own corners, since volumes far away are inexact.
    sizes = measure_components(vertices, faces, connections.labels, sizes.lows)
    flat = np.count_nonzero(_is_flat(sizes)[connections.labels])
    if not len(walls):
        return 0, int(flat)
    every = np.ones(connections.components, np.bool_)  # also cavities
    hulls = _Hulls(vertices, faces, connections.labels, sizes, every)
    labels = connect_faces(walls).labels
    points = vertices[walls[_first_faces(labels)]].mean(axis=1)
    outside = [not hulls.enclose(point, point, point) for point in points]
    return int(np.bincount(labels)[outside].sum()) // 2, int(flat)


def _flip_inverted_components(
    vertices: Floats, faces: Faces, connections: Connections
) -> Faces:
    """Flip all if the whole is inside out, then components that are no cavities."""
    labels = connections.labels
    sizes = _measure(vertices, faces, connections)
    # Exporters agree on no orientation, so the volume tells: an outward one is
    # positive.
    if sizes.volumes.sum() < 0:
        faces, sizes = faces[:, ::-1], sizes._replace(volumes=-sizes.volumes)
    inverted = sizes.volumes < 0
    if inverted.any():
        hulls = _Hulls(vertices, faces, labels, sizes, sizes.volumes > 0)
        inner = np.flatnonzero(inverted)
        points = vertices[faces[_first_faces(labels)[inner]]].mean(axis=1)
        for index, point in zip(inner, points, strict=True):
            low, high = sizes.lows[index], sizes.highs[index]
            inverted[index] = not hulls.enclose(low, high, point)
    return _flip(faces, inverted[labels])


class _Hulls:
    """Components of a mesh, found by the boxes around them."""

    def __init__(
        self,
        vertices: Floats,
        faces: Faces,
        labels: Labels,
        sizes: Sizes,
        which: _Booleans,
    ) -> None:
        from shapely import STRtree, box  # noqa: PLC0415 - slow; seldom needed

        self._hulls = np.flatnonzero(which)
        self._lows, self._highs = sizes.lows[self._hulls], sizes.highs[self._hulls]
        self._tree = STRtree(box(*self._lows[:, :2].T, *self._highs[:, :2].T))
        self._corners = vertices, faces
        order = np.argsort(labels, kind="stable")
        firsts = np.searchsorted(labels[order], np.arange(1, len(sizes.volumes)))
        self._faces = np.split(order, firsts)

    def enclose(self, low: Floats, high: Floats, point: Floats) -> bool:
        """Return whether a point is in hulls whose boxes contain all of another box.

        Args:
            low: (3,) m, the other box.
            high: (3,) m.
            point: (3,) m, in it.
        """
        from shapely import Point  # noqa: PLC0415

        found = self._tree.query(Point(low[:2]))
        found = found[(self._lows[found] <= low).all(axis=1)]
        found = found[(self._highs[found] >= high).all(axis=1)]
        if not len(found):
            return False
        chosen = [self._faces[hull] for hull in self._hulls[found]]
        vertices, faces = self._corners
        return encloses(vertices, faces[np.sort(np.concatenate(chosen))], point)


def _first_faces(labels: Labels) -> NDArray[np.intp]:
    """Return the index of each component's first face, (C,)."""
    return np.flatnonzero(np.diff(np.maximum.accumulate(labels), prepend=-1))


def _flip(faces: Faces, which: _Booleans) -> Faces:
    """Return faces, those flipped that are marked."""
    if not which.any():
        return np.ascontiguousarray(faces)
    flipped = faces.copy()
    flipped[which] = faces[which][:, ::-1]
    return flipped


def _measure(vertices: Floats, faces: Faces, connections: Connections) -> Sizes:
    """Measure components, with volumes as seen from the middle of the mesh."""
    centre = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
    origins = np.tile(centre, (connections.components, 1))
    return measure_components(vertices, faces, connections.labels, origins)


def _is_flat(sizes: Sizes) -> _Booleans:
    """Return which components enclose no volume, (C,)."""
    diagonals = np.linalg.norm(sizes.highs - sizes.lows, axis=1)
    flat: _Booleans = np.abs(sizes.volumes) <= FLATNESS * sizes.areas * diagonals
    return flat


def _cancelled(faces: Faces) -> _Booleans:
    """Mark the faces that are present equally often in both orientations."""
    a, b, c = faces.T.astype(np.int64)
    forward = ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    # Two of the corners number the edge, the edge and the third one the triangle.
    size = int(high.max(initial=0)) + 1
    _, edges = np.unique(low * size + high, return_inverse=True)
    middle = a + b + c - low - high
    _, indices = np.unique(edges.ravel() * size + middle, return_inverse=True)
    indices = indices.ravel()
    sums = np.bincount(indices, weights=np.where(forward, 1, -1))
    cancelled: _Booleans = sums[indices] == 0
    return cancelled
