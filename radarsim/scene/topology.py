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

Equal vertices, the sides of an edge, and equal triangles find each other by sorting.

To orient a surface, each face is taken twice, as it is and flipped, and each is
connected to what agrees with it over an edge. A face is to be flipped if it is the
flipped one that is connected to the first face of the component. If both are, the
surface has only one side.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces

FLATNESS = 1e-9  # volume over (area times size); rounding errors are far below

_Booleans: TypeAlias = NDArray[np.bool_]
_Indices: TypeAlias = NDArray[np.intp]
Labels: TypeAlias = NDArray[np.int32]


class Connections(NamedTuple):
    """How faces share edges.

    Attributes:
        labels: (F,) the connected component of each face; components are numbered in
            the order of their first faces.
        components: The number of components.
        open_edges: The number of edges that are not used as often in one direction as
            in the other.
        unpaired_edges: The number of edges that are not used by two faces.
        neighbours: (2, N) faces that share an edge.
        disagree: (N,) whether two neighbours run along their edge in one direction.
    """

    labels: Labels
    components: int
    open_edges: int
    unpaired_edges: int
    neighbours: _Indices
    disagree: _Booleans


def weld_vertices(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Merge vertices at equal positions, and drop faces that lose a corner by it.

    Args:
        vertices: (V, 3) m, finite.
        faces: (F, 3) vertex indices.

    Returns:
        The vertices that faces use, in the order of their first use, and the faces that
        are left.
    """
    order = np.lexsort(vertices.T)
    numbers = np.zeros(len(order), np.int32)
    differ = np.zeros(len(order[1:]), np.bool_)
    for coordinates in vertices.T:  # one by one: together they take much memory
        differ |= np.diff(coordinates[order]) != 0
    numbers[order[1:]] = np.cumsum(differ)
    corners = numbers[faces.ravel()]
    first_uses = np.full(len(order), len(corners), np.int32)
    places = np.arange(len(corners), dtype=np.int32)
    first_uses[corners[::-1]] = places[::-1]  # the last one stays
    used = np.argsort(first_uses, kind="stable")
    used = used[first_uses[used] < len(corners)]
    numbers[used] = np.arange(len(used))
    merged = numbers[corners].reshape(-1, 3)
    is_kept = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    positions = vertices[faces.ravel()[first_uses[used]]]
    return positions + 0.0, merged[is_kept]  # -0.0 and 0.0 are one position


def connect_faces(faces: Faces) -> Connections:
    """Find out how faces share edges.

    Args:
        faces: (F, 3) indices of merged vertices.
    """
    begins, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(begins, ends), np.maximum(begins, ends)
    edges = low.astype(np.int64) * (int(high.max(initial=0)) + 1) + high
    order = np.argsort(edges, kind="stable")
    is_first = np.diff(edges[order], prepend=-1) > 0
    of_edge = np.cumsum(is_first) - 1
    upward = (begins < ends)[order]
    balances = np.bincount(of_edge, np.where(upward, 1, -1))
    firsts = np.flatnonzero(is_first)[of_edge]  # each side's first one at its edge
    neighbours = order[np.stack([firsts, np.arange(len(order))])[:, ~is_first]] // 3
    components, labels = _connect(neighbours, len(faces))
    return Connections(
        labels,
        components,
        open_edges=int(np.count_nonzero(balances)),
        unpaired_edges=int(np.count_nonzero(np.bincount(of_edge) != 2)),
        neighbours=neighbours,
        disagree=(upward == upward[firsts])[~is_first],
    )


def _connect(pairs: _Indices, count: int) -> tuple[int, Labels]:
    """Return the number of connected components, and the one of each node.

    Args:
        pairs: (2, N) nodes that are connected.
        count: The number of nodes.
    """
    graph = coo_array((np.ones(pairs.shape[1], np.bool_), pairs), (count, count))
    components, labels = connected_components(graph, directed=False)
    return components, labels


def _flips(connections: Connections) -> _Booleans | None:
    """Return which faces disagree with the first of their component, (F,).

    Returns:
        None if a component has only one side, such as a Möbius strip.
    """
    labels, disagree = connections.labels, connections.disagree
    count = len(labels)
    one, other = connections.neighbours
    ends = np.hstack([other + count * disagree, other + count * ~disagree])
    _, sides = _connect(np.stack([np.hstack([one, one + count]), ends]), 2 * count)
    if (sides[:count] == sides[count:]).any():
        return None
    flips: _Booleans = sides[:count] != sides[_first_faces(labels)][labels]
    return flips


def is_closed(faces: Faces) -> bool:
    """Return whether (F, 3) faces, if there are any, enclose a volume.

    Vertices at equal positions must be merged, see `weld_vertices`.
    """
    return connect_faces(faces).open_edges == 0


def orient_outward(vertices: Floats, faces: Faces) -> Faces | None:
    """Orient the faces of a closed surface so that their normals point outward.

    Flips faces where neighbours disagree, and components that are inside out. A
    component that is inside out and lies in another one is a cavity and stays as it
    is; in a mesh whose neighbours disagree a cavity cannot be told from a nested
    volume, and every component is oriented outward.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        The faces; None if the surface is not closed, or has only one side.
    """
    connections = connect_faces(faces)
    if connections.open_edges == 0:
        return _flip_inverted_components(vertices, faces, connections.labels)
    flips = None if connections.unpaired_edges else _flips(connections)
    if flips is None:
        return None
    # All edges have two faces, which disagree at some: made consistent, it is closed.
    consistent = _flip(faces, flips)
    volumes = _volumes(vertices, consistent, connections.labels)
    return _flip(consistent, (volumes < 0)[connections.labels])


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


def count_degenerate(vertices: Floats, faces: Faces) -> tuple[int, int]:
    """Count the faces of a closed mesh, oriented outward, that enclose nothing.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        How many faces are present in both orientations, each counted once, without
        being a wall inside of a volume; and how many of the others belong to flat
        components.
    """
    cancelled = _cancelled(faces)
    faces, walls = faces[~cancelled], faces[cancelled]
    labels = connect_faces(faces).labels
    lows, highs = boxes = _boxes(vertices, faces, labels)
    # As seen from the components' own corners, since volumes far away are inexact.
    volumes = _volumes(vertices, faces, labels, lows[labels])
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.bincount(labels, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    diagonals = np.linalg.norm(highs - lows, axis=1)
    is_flat = np.abs(volumes) <= FLATNESS * areas * diagonals
    flat = np.count_nonzero(is_flat[labels])
    if not len(walls):
        return 0, int(flat)
    every = np.ones(len(volumes), np.bool_)  # also cavities
    hulls = _Hulls(vertices, faces, labels, boxes, every)
    of_walls = connect_faces(walls).labels
    points = vertices[walls[_first_faces(of_walls)]].mean(axis=1)
    outside = [not hulls.enclose(point, point, point) for point in points]
    return int(np.bincount(of_walls)[outside].sum()) // 2, int(flat)


def _flip_inverted_components(vertices: Floats, faces: Faces, labels: Labels) -> Faces:
    """Flip all if the whole is inside out, then components that are no cavities."""
    volumes = _volumes(vertices, faces, labels)
    # Exporters agree on no orientation, so the volume tells: an outward one is
    # positive.
    if volumes.sum() < 0:
        faces, volumes = faces[:, ::-1], -volumes
    inverted = volumes < 0
    if inverted.any():
        lows, highs = boxes = _boxes(vertices, faces, labels)
        hulls = _Hulls(vertices, faces, labels, boxes, volumes > 0)
        inner = np.flatnonzero(inverted)
        points = vertices[faces[_first_faces(labels)[inner]]].mean(axis=1)
        for index, point in zip(inner, points, strict=True):
            inverted[index] = not hulls.enclose(lows[index], highs[index], point)
    return _flip(faces, inverted[labels])


class _Hulls:
    """Components of a mesh, found by the boxes around them."""

    def __init__(
        self,
        vertices: Floats,
        faces: Faces,
        labels: Labels,
        boxes: tuple[Floats, Floats],
        which: _Booleans,
    ) -> None:
        from shapely import STRtree, box  # noqa: PLC0415 - slow; seldom needed

        self._hulls = np.flatnonzero(which)
        self._lows, self._highs = (corner[which] for corner in boxes)
        self._tree = STRtree(box(*self._lows[:, :2].T, *self._highs[:, :2].T))
        self._corners = vertices, faces
        order = np.argsort(labels, kind="stable")
        self._faces = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

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


def _boxes(vertices: Floats, faces: Faces, labels: Labels) -> tuple[Floats, Floats]:
    """Return the smallest and the largest x, y, z of components, (C, 3) each."""
    order = np.argsort(labels, kind="stable")
    firsts = np.flatnonzero(np.diff(labels[order], prepend=-1))
    corners = vertices[faces[order]]
    lows: Floats = np.minimum.reduceat(corners.min(axis=1), firsts)
    highs: Floats = np.maximum.reduceat(corners.max(axis=1), firsts)
    return lows, highs


def _volumes(
    vertices: Floats, faces: Faces, labels: Labels, origins: Floats | None = None
) -> Floats:
    """Return the volumes of components, (C,) m³; negative if they are inside out.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices.
        labels: (F,) the component of each face.
        origins: (F, 3) m, near each component, since volumes far away are inexact; the
            middle of the mesh by default.
    """
    if origins is None:
        origins = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
    a, b, c = (vertices[faces[:, k]] - origins for k in range(3))
    x, y, z = (a * np.cross(b, c)).T
    return np.bincount(labels, (x + y + z) / 6).astype(np.float64)


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
