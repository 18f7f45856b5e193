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
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.face_passes import (
    Connections,
    Labels,
    Sizes,
    connect_faces,
    measure_components,
)
from radarsim.scene.shapes import Faces

FLATNESS = 1e-9  # volume over (area times size); rounding errors are far below

_Booleans: TypeAlias = NDArray[np.bool_]


def is_closed(faces: Faces) -> bool:
    """Return whether (F, 3) faces, if there are any, enclose a volume.

    Vertices at equal positions must be merged, see `weld_vertices`.
    """
    return connect_faces(faces).open_edges == 0


class OrientedFaces(NamedTuple):
    """The faces of a closed surface, oriented outward, and how they share edges.

    Attributes:
        faces: (F, 3) vertex indices.
        connections: Of the faces as they were before; ``flipped`` refers to those.
    """

    faces: Faces
    connections: Connections


def orient_outward(vertices: Floats, faces: Faces) -> OrientedFaces | None:
    """Orient the faces of a closed surface so that their normals point outward.

    Flips faces where neighbours disagree, and components that are inside out. A
    component that is inside out and lies in another one is a cavity and stays as it
    is; in a mesh whose neighbours disagree a cavity cannot be told from a nested
    volume, and every component is oriented outward.

    Args:
        vertices: (V, 3) m, merged.
        faces: (F, 3) vertex indices.

    Returns:
        The faces, or None if the surface is not closed, or has only one side.
    """
    connections = connect_faces(faces)
    if connections.open_edges == 0:
        oriented = _flip_inverted_components(vertices, faces, connections)
        return OrientedFaces(oriented, connections)
    if connections.unpaired_edges or connections.has_one_side:
        return None
    # All edges have two faces, which disagree at some: made consistent, it is closed.
    consistent = _flip(faces, connections.flipped)
    volumes, *_ = _measure(vertices, consistent, connections)
    oriented = _flip(consistent, (volumes < 0)[connections.labels])
    return OrientedFaces(oriented, connections)


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
