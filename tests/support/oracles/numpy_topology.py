"""Topology of triangle meshes by sorting with numpy: slower, and without kernels."""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces
from radarsim.scene.topology import FLATNESS, encloses

Labels: TypeAlias = NDArray[np.int32]
_Booleans: TypeAlias = NDArray[np.bool_]
_Integers: TypeAlias = NDArray[np.int64]


def weld_vertices(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Merge vertices at exactly equal positions.

    Drops vertices without faces, and faces that lose a corner by the merging.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3) vertex indices.
    """
    used = np.flatnonzero(np.bincount(faces.ravel(), minlength=len(vertices)))
    positions = vertices[used] + 0.0  # -0.0 and 0.0 are one position
    # np.unique finds equal rows too, but takes four times as long.
    order = np.lexsort(positions.T[::-1])
    positions = positions[order]
    is_first = np.ones(len(used), dtype=bool)
    is_first[1:] = (positions[1:] != positions[:-1]).any(axis=1)
    merged = positions[is_first]
    targets = np.zeros(len(vertices), dtype=np.int32)
    targets[used[order]] = np.cumsum(is_first) - 1
    renamed = targets[faces]
    a, b, c = renamed.T
    return merged, renamed[(a != b) & (b != c) & (c != a)]


def count_open_edges(faces: Faces) -> int:
    """Count the edges of (F, 3) faces that are not used equally in both directions."""
    return _count_open(_half_edges(faces))


def label_components(faces: Faces) -> Labels:
    """Label the connected components of (F, 3) faces.

    Vertices at equal positions must be merged, see `weld_vertices`.

    Returns:
        (F,) the component of each face, from 0.
    """
    return _label(_half_edges(faces))


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
        The faces, or None if the surface is not closed, or has only one side.
    """
    half_edges = _half_edges(faces)
    if _count_open(half_edges) == 0:
        return _flip_inverted_components(vertices, faces, _label(half_edges))
    consistent = _orient_consistently(faces)
    if consistent is None:
        return None
    labels = label_components(consistent)
    return _flip(consistent, (_volumes(vertices, consistent, labels) < 0)[labels])


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
    hull = faces[~cancelled]
    labels = label_components(hull)
    lows, highs = _bounding_boxes(vertices, hull, labels)
    flat = _is_flat(vertices[hull] - lows[labels][:, None], labels, highs - lows)
    walls = faces[cancelled]
    groups, firsts, sizes = np.unique(
        label_components(walls), return_index=True, return_counts=True
    )
    degenerate = 0
    for group in groups:
        point = vertices[walls[firsts[group]]].mean(axis=0)
        candidates = ((lows <= point) & (point <= highs)).all(axis=1)
        if not encloses(vertices, hull[candidates[labels]], point):
            degenerate += int(sizes[group])
    return degenerate // 2, int(np.count_nonzero(flat[labels]))


class _HalfEdges(NamedTuple):
    """The edges of F faces, three of each.

    Attributes:
        edges: (3F,) index of the edge, which is the same in both directions.
        directions: (3F,) 1 or -1.
        owners: (3F,) index of the face.
    """

    edges: _Integers
    directions: _Integers
    owners: _Integers


def _half_edges(faces: Faces) -> _HalfEdges:
    starts = faces.astype(np.int64)
    ends = np.roll(starts, -1, axis=1)
    low, high = np.minimum(starts, ends).ravel(), np.maximum(starts, ends).ravel()
    size = int(high.max(initial=0)) + 1
    _, edges = np.unique(low * size + high, return_inverse=True)
    directions = np.where(starts < ends, 1, -1).ravel()
    return _HalfEdges(edges.ravel(), directions, np.repeat(np.arange(len(faces)), 3))


def _count_open(half_edges: _HalfEdges) -> int:
    sums = np.bincount(half_edges.edges, weights=half_edges.directions)
    return int(np.count_nonzero(sums))


def _label(half_edges: _HalfEdges) -> Labels:
    order = np.argsort(half_edges.edges, kind="stable")
    edges, owners = half_edges.edges[order], half_edges.owners[order]
    same = edges[1:] == edges[:-1]
    return _connect(len(order) // 3, owners[:-1][same], owners[1:][same])


def _connect(count: int, first: _Integers, second: _Integers) -> Labels:
    """Label the connected components of ``count`` nodes, joined in pairs."""
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)


def _orient_consistently(faces: Faces) -> Faces | None:
    """Flip faces until neighbours agree; None if edges are open or it can't be done.

    Each face is two nodes of a graph, as it is and flipped. Two neighbours that agree
    join like with like, two that disagree join unlike. A face that is connected to its
    own flipped copy lies on a surface with one side, such as a Möbius strip.
    """
    edges, directions, owners = _half_edges(faces)
    if np.any(np.bincount(edges) != 2):
        return None
    order = np.argsort(edges, kind="stable").reshape(-1, 2)
    first, second = owners[order].T
    agree = directions[order].sum(axis=1) == 0
    count = len(faces)
    labels = _connect(
        2 * count,
        np.concatenate([first, first + count]),
        np.concatenate(
            [
                np.where(agree, second, second + count),
                np.where(agree, second + count, second),
            ]
        ),
    )
    as_is, flipped = labels[:count], labels[count:]
    return None if np.any(as_is == flipped) else _flip(faces, as_is > flipped)


def _flip_inverted_components(vertices: Floats, faces: Faces, labels: Labels) -> Faces:
    """Flip all if the whole is inside out, then components that are no cavities."""
    volumes = _volumes(vertices, faces, labels)
    if volumes.sum() < 0:
        faces, volumes = faces[:, ::-1], -volumes
    lows, highs = _bounding_boxes(vertices, faces, labels)
    inverted = np.zeros(len(volumes), dtype=bool)
    for index in np.flatnonzero(volumes < 0):
        around = (lows <= lows[index]).all(axis=1) & (highs >= highs[index]).all(axis=1)
        hull = faces[(around & (volumes > 0))[labels]]
        inner = vertices[faces[labels == index][0]].mean(axis=0)
        inverted[index] = not encloses(vertices, hull, inner)
    return _flip(faces, inverted[labels])


def _flip(faces: Faces, which: _Booleans) -> Faces:
    flipped = faces.copy()
    flipped[which] = faces[which][:, ::-1]
    return flipped


def _volumes(vertices: Floats, faces: Faces, labels: Labels) -> Floats:
    """Return the signed volume of each component, m³; negative if it is inside out."""
    centre = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
    return _volumes_below(vertices[faces] - centre, labels)


def _volumes_below(corners: Floats, labels: Labels) -> Floats:
    """Sum the volumes between the origin and faces, (F, 3, 3) m, per component."""
    a, b, c = (corners[:, i] for i in range(3))
    sixths: Floats = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(labels, weights=sixths).astype(np.float64)


def _bounding_boxes(
    vertices: Floats, faces: Faces, labels: Labels
) -> tuple[Floats, Floats]:
    """Return the smallest and the largest x, y, z of each component, (C, 3) m each."""
    count = int(labels.max(initial=-1)) + 1
    if count == 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    order = np.argsort(labels, kind="stable")
    firsts = np.searchsorted(labels[order], np.arange(count))
    a, b, c = (vertices[corner] for corner in faces[order].T)
    lows = np.minimum.reduceat(np.minimum(np.minimum(a, b), c), firsts)
    highs = np.maximum.reduceat(np.maximum(np.maximum(a, b), c), firsts)
    return lows, highs


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


def _is_flat(corners: Floats, labels: Labels, extents: Floats) -> _Booleans:
    """Return which components enclose no volume, (C,).

    Args:
        corners: (F, 3, 3) m, relative to the low corner of the component's box, since
            volumes far from the origin are inexact.
        labels: (F,) the component of each face.
        extents: (C, 3) m, of the components' boxes.
    """
    a, b, c = (corners[:, i] for i in range(3))
    areas = np.bincount(labels, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    thinnest = FLATNESS * areas * np.linalg.norm(extents, axis=1)
    flat: _Booleans = np.abs(_volumes_below(corners, labels)) <= thinnest
    return flat
