"""Topology of triangle meshes: connected components, orientation, degenerate faces.

Theory of operation
===================
A mesh is closed if every edge is used as often in one direction as in the other. The
rule also holds where several volumes touch along an edge or coincide, and it makes the
winding number of every point an integer, so densities of nested volumes can be added.

Faces that share an edge belong to one connected component; a common vertex alone does
not connect them.

A sheet whose faces are all present in both orientations satisfies the rule of a closed
mesh, but its faces cancel each other, so beams would pass it without loss. The same
holds for a volume that is folded flat. Faces may cancel in one case: inside a volume,
as the common wall of two volumes that touch. All other cancelling faces, and all
components without a volume, are degenerate. Faces cancel if they have the same three
corners in opposite orientations. If the two sides of a sheet are triangulated
differently, the volume of the component, which is 0, reveals the sheet.

Each pass takes time and memory proportional to the number of faces, in any order.

Equal vertices are found with a hash table with open addressing.

Edges are found by a counting sort of the sides of all faces by their lower vertex.
Among the sides at one vertex, all sides with the same other end form one edge: for each
other end, an array holds the position of its first side; positions before the sides of
the current vertex are stale entries of earlier vertices. So a fan of a million faces
around one vertex takes no longer than a grid of a million faces.

Faces are joined across their edges in a disjoint-set forest (union-find): the root of
a tree is the first face of its component. Each face also stores whether its orientation
disagrees with its parent's, so the forest shows which faces must be flipped to agree
with the first face.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces

FLATNESS = 1e-9  # limit of volume / (area * diagonal), far above rounding errors

_Booleans: TypeAlias = NDArray[np.bool_]
_Components: TypeAlias = NDArray[np.void]  # rows of the engine's Component
Labels: TypeAlias = NDArray[np.int32]


class Connections(NamedTuple):
    """How the faces of a mesh are connected by shared edges.

    Attributes:
        labels: (F,) the connected component of each face; components are numbered in
            the order of their first faces.
        flips: (F,) whether the face disagrees with the first of its component.
        components: The number of components.
        open_edges: The number of edges that are not used as often in one direction as
            in the other.
        unpaired_edges: The number of edges that are not used by exactly two faces.
        has_one_side: 1 if a component cannot be oriented, such as a Möbius strip;
            undefined if there are unpaired edges.
        may_coincide: 1 if some faces may have the same three corners.
    """

    labels: Labels
    flips: _Booleans
    components: int
    open_edges: int
    unpaired_edges: int
    has_one_side: int
    may_coincide: int


def weld_vertices(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Merge vertices at equal positions, and drop faces that become degenerate.

    Args:
        vertices: (V, 3) m, finite.
        faces: (F, 3) vertex indices.

    Returns:
        The used vertices in the order of their first use, and the remaining faces.
    """
    vertices = np.ascontiguousarray(vertices)
    corners = np.ascontiguousarray(faces).ravel()
    merged, kept = np.zeros_like(corners), np.zeros(len(vertices), np.int32)
    count = engine.merge_vertices(vertices, corners, merged, kept)
    left = merged.reshape(-1, 3)
    a, b, c = left.T
    has_corners = (a != b) & (b != c) & (c != a)
    positions = vertices[kept[:count]] + 0.0  # -0.0 and 0.0 are one position
    return positions, left if has_corners.all() else left[has_corners]


def connect_faces(faces: Faces) -> Connections:
    """Find the connected components of faces that share edges.

    Args:
        faces: (F, 3) indices of merged vertices.
    """
    corners = np.ascontiguousarray(faces).ravel()
    labels, flips = np.zeros(len(faces), np.int32), np.zeros(len(faces), np.bool_)
    counts = np.zeros(4, np.int64)
    size = int(corners.max(initial=-1)) + 1
    components = engine.connect_faces(corners, size, labels, flips, counts)
    return Connections(labels, flips, components, *counts.tolist())


def is_closed(faces: Faces) -> bool:
    """Return whether (F, 3) faces form a closed mesh; True without faces.

    Vertices at equal positions must be merged, see `weld_vertices`.
    """
    return connect_faces(faces).open_edges == 0


def orient_outward(vertices: Floats, faces: Faces) -> Faces | None:
    """Orient the faces of a closed surface so that their normals point outward.

    Flips faces where neighbours disagree, and components that are inside out. A
    component that is inside out within another component is a cavity and stays
    unchanged. If neighbours disagree, a cavity cannot be distinguished from a nested
    volume, so every component is oriented outward.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        The faces; None if the surface is not closed, or has only one side.
    """
    connections = connect_faces(faces)
    if connections.open_edges == 0:
        return _flip_inverted_components(vertices, faces, connections)
    if connections.unpaired_edges or connections.has_one_side:
        return None
    # Each edge has two faces, so the mesh is closed once their orientations agree.
    consistent = _flip(faces, connections.flips)
    volumes = _measure(vertices, consistent, connections)["volume"]
    return _flip(consistent, (volumes < 0)[connections.labels])


def encloses(vertices: Floats, faces: Faces, point: Floats) -> bool:
    """Return whether a closed mesh with outward faces encloses a point.

    Uses the solid angle of the faces as seen from the point (Van Oosterom and
    Strackee): 4 pi from inside, 0 from outside.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices.
        point: (3,) m, not on a face.
    """
    corners = vertices[faces] - point
    a, b, c = (corners[:, i] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    angles = 2 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(angles.sum() > 2 * np.pi)


def count_degenerate(vertices: Floats, faces: Faces) -> tuple[int, int]:
    """Count the faces that bound no volume in a closed mesh with outward faces.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        The number of faces present in both orientations, without walls inside volumes
        and each pair counted once; and the number of other faces in flat components.
    """
    connections, walls = connect_faces(faces), faces[:0]
    if connections.may_coincide:  # Otherwise there is no need to sort the faces.
        cancelled = _cancelled(faces)
        faces, walls = faces[~cancelled], faces[cancelled]
        connections = connect_faces(faces)
    components = _measure(vertices, faces, connections)
    diagonals = np.linalg.norm(components["high"] - components["low"], axis=1)
    limits = FLATNESS * components["area"] * diagonals
    is_flat = np.abs(components["volume"]) <= limits
    flat = np.count_nonzero(is_flat[connections.labels])
    if not len(walls):
        return 0, int(flat)
    every = np.ones(len(components), np.bool_)  # all components, including cavities
    shells = _Shells(vertices, faces, connections.labels, components, every)
    of_walls = connect_faces(walls).labels
    points = vertices[walls[_first_faces(of_walls)]].mean(axis=1)
    outside = [not shells.enclose(point, point, point) for point in points]
    return int(np.bincount(of_walls)[outside].sum()) // 2, int(flat)


def _flip_inverted_components(
    vertices: Floats, faces: Faces, connections: Connections
) -> Faces:
    """Flip a mesh that is inside out, then single inverted parts except cavities."""
    labels = connections.labels
    components = _measure(vertices, faces, connections)
    volumes = components["volume"]
    # Exporters use either orientation, so the sign of the volume decides: the volume
    # of an outward mesh is positive.
    if volumes.sum() < 0:
        faces, volumes = faces[:, ::-1], -volumes
    inverted = volumes < 0
    if inverted.any():
        shells = _Shells(vertices, faces, labels, components, volumes > 0)
        inner = np.flatnonzero(inverted)
        points = vertices[faces[_first_faces(labels)[inner]]].mean(axis=1)
        for index, point in zip(inner, points, strict=True):
            component = components[index]
            inverted[index] = not shells.enclose(
                component["low"], component["high"], point
            )
    return _flip(faces, inverted[labels])


class _Shells:
    """An index of a mesh's components by their bounding boxes."""

    def __init__(
        self,
        vertices: Floats,
        faces: Faces,
        labels: Labels,
        components: _Components,
        which: _Booleans,
    ) -> None:
        from shapely import STRtree, box  # noqa: PLC0415 - slow; seldom needed

        self._shells = np.flatnonzero(which)
        self._lows, self._highs = (components[which][end] for end in ("low", "high"))
        self._tree = STRtree(box(*self._lows[:, :2].T, *self._highs[:, :2].T))
        self._corners = vertices, faces
        order = np.argsort(labels, kind="stable")
        self._faces = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

    def enclose(self, low: Floats, high: Floats, point: Floats) -> bool:
        """Return whether a point is inside the components that surround its box.

        Args:
            low: (3,) lower corner of the box, m.
            high: (3,) upper corner of the box, m.
            point: (3,) a point in the box, m.
        """
        from shapely import Point  # noqa: PLC0415

        found = self._tree.query(Point(low[:2]))
        found = found[(self._lows[found] <= low).all(axis=1)]
        found = found[(self._highs[found] >= high).all(axis=1)]
        if not len(found):
            return False
        chosen = [self._faces[shell] for shell in self._shells[found]]
        vertices, faces = self._corners
        return encloses(vertices, faces[np.sort(np.concatenate(chosen))], point)


def _first_faces(labels: Labels) -> NDArray[np.intp]:
    """Return the index of each component's first face, (C,)."""
    return np.flatnonzero(np.diff(np.maximum.accumulate(labels), prepend=-1))


def _flip(faces: Faces, which: _Booleans) -> Faces:
    """Return the faces after reversing the orientation of the marked faces."""
    if not which.any():
        return np.ascontiguousarray(faces)
    flipped = faces.copy()
    flipped[which] = faces[which][:, ::-1]
    return flipped


def _measure(vertices: Floats, faces: Faces, connections: Connections) -> _Components:
    """Return bounds, area and volume of each connected component of a mesh."""
    components = np.zeros(connections.components, engine.rows["Component"])
    vertices, faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    engine.measure_components(vertices, faces, connections.labels, components)
    return components


def _cancelled(faces: Faces) -> _Booleans:
    """Mark the faces that are present equally often in both orientations."""
    a, b, c = faces.T.astype(np.int64)
    forward = ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    # A triangle is identified by its lowest, highest and middle vertex index. The
    # lowest and the highest index are first combined to the number of an edge.
    size = int(high.max(initial=0)) + 1
    _, edges = np.unique(low * size + high, return_inverse=True)
    middle = a + b + c - low - high
    _, indices = np.unique(edges.ravel() * size + middle, return_inverse=True)
    indices = indices.ravel()
    sums = np.bincount(indices, weights=np.where(forward, 1, -1))
    cancelled: _Booleans = sums[indices] == 0
    return cancelled
