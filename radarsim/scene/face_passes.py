"""Compiled passes over the faces of triangle meshes.

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

Rule: arrays are created outside of the kernels, which then take half as long to
compile.
"""

from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
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
        vertex_table = _VertexTable(
            vertices, vertices.view(np.int64), np.full(size, -1, np.int32), kept
        )
        numbers.fill(-1)
        count, rows = _merge(vertex_table, faces, numbers, merged)
        size *= 4
    positions = vertices[kept[:count]] + 0.0  # -0.0 and 0.0 are one position
    return positions, merged[:rows].copy()


def connect_faces(faces: Faces) -> Connections:
    """Find out how faces share edges.

    Args:
        faces: (F, 3) indices of merged vertices.
    """
    faces = _readable(faces, np.int32)
    vertices = int(faces.max(initial=-1)) + 1
    sides = _Sides(np.zeros(faces.size, np.int32), np.zeros(vertices + 2, np.int32))
    edges = _Edges(*np.full((3, vertices), -1, np.int32))
    forest = _Forest(np.arange(len(faces), dtype=np.int32), np.zeros(len(faces), bool))
    counts = _unite(faces, sides, edges, forest)
    labels = np.zeros(len(faces), np.int32)
    components = _label(forest, labels)
    return Connections(labels, forest.flips, components, *counts)


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
    _measure(
        _readable(vertices, np.float64),
        _readable(faces, np.int32),
        _readable(labels, np.int32),
        _readable(origins, np.float64),
        sizes,
    )
    return sizes


def _readable(array: NDArray[_Number], dtype: type[_Number]) -> NDArray[_Number]:
    """Return an array in the one form for which kernels are compiled."""
    view = np.ascontiguousarray(array, dtype).view()
    view.flags.writeable = False
    return view


class _VertexTable(NamedTuple):
    """The vertices that are left so far, found by their positions.

    Attributes:
        positions: (V, 3) m, of all vertices.
        bits: (V, 3) the same numbers as integers.
        slots: The numbers of those that are left, -1 where a slot is free; as many as
            a power of two.
        kept: (V,) their indices.
    """

    positions: Floats
    bits: NDArray[np.int64]
    slots: _Integers
    kept: _Integers


@njit_inline
def _find_slot(table: _VertexTable, vertex: int) -> np.uint64:
    """Return the slot of a vertex's position, or the free one where it belongs."""
    # Mixed as by splitmix64: coordinates on a grid differ in few bits, and a plain hash
    # would put a whole plane of vertices into one run of slots.
    mixed = np.uint64(0)
    for axis in range(3):
        if table.positions[vertex, axis] != 0.0:  # both zeros are equal
            mixed ^= np.uint64(table.bits[vertex, axis])
        mixed *= np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
        mixed *= np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(32)
    last = np.uint64(len(table.slots) - 1)
    slot = mixed & last
    while table.slots[slot] >= 0:
        other = table.kept[table.slots[slot]]
        if (
            table.positions[other, 0] == table.positions[vertex, 0]
            and table.positions[other, 1] == table.positions[vertex, 1]
            and table.positions[other, 2] == table.positions[vertex, 2]
        ):
            break
        slot = (slot + np.uint64(1)) & last
    return slot


@njit_cached
def _merge(
    table: _VertexTable, faces: Faces, numbers: _Integers, merged: Faces
) -> tuple[int, int]:
    """Number the vertices, and write the faces that keep their corners.

    Args:
        table: Without vertices.
        faces: (F, 3) vertex indices.
        numbers: (V,) -1; to be filled with the numbers of vertices that are left.
        merged: (F, 3) to be filled from the beginning.

    Returns:
        How many vertices and how many faces are left; -1 faces if the table became
        too full to be fast.
    """
    count = rows = 0
    for face in range(len(faces)):
        # three quarters full: probes become long, so begin again with more slots
        if 4 * count > 3 * len(table.slots) - 12:
            return count, -1
        for corner in range(3):
            vertex = faces[face, corner]
            if numbers[vertex] < 0:
                slot = _find_slot(table, vertex)
                if table.slots[slot] < 0:
                    table.slots[slot] = count
                    table.kept[count] = vertex
                    count += 1
                numbers[vertex] = table.slots[slot]
            merged[rows, corner] = numbers[vertex]
        if (
            merged[rows, 0] != merged[rows, 1]
            and merged[rows, 1] != merged[rows, 2]
            and merged[rows, 2] != merged[rows, 0]
        ):
            rows += 1
    return count, rows


class _Sides(NamedTuple):
    """The sides of faces, sorted by their lower vertex.

    Attributes:
        sides: (3F,) three times the face plus the corner where the side begins.
        starts: (V + 2,) where those of each vertex begin, and where the last ends.
    """

    sides: _Integers
    starts: _Integers


class _Edges(NamedTuple):
    """The edges at one vertex, by the vertex at their other end.

    Attributes:
        places: (V,) the place of the edge's first side; a lower one than this vertex's
            sides have if there is none.
        users: (V,) the number of its sides so far.
        balance: (V,) how many more of them lead upwards than downwards.
    """

    places: _Integers
    users: _Integers
    balance: _Integers


class _Forest(NamedTuple):
    """Faces that are connected, as trees.

    Attributes:
        parents: (F,) a face before this one in the same component, or itself.
        flips: (F,) whether the face disagrees with its parent.
    """

    parents: _Integers
    flips: NDArray[np.bool_]


@njit_inline
def _next(corner: int) -> int:
    return corner + 1 if corner < 2 else 0


@njit_inline
def _sort_sides(faces: Faces, sides: _Sides) -> None:
    """Sort the sides of all faces; ``starts`` is 0 before."""
    starts = sides.starts
    for face in range(len(faces)):
        for corner in range(3):
            # two places ahead, as a place moves on by its own sides below
            starts[min(faces[face, corner], faces[face, _next(corner)]) + 2] += 1
    for vertex in range(1, len(starts)):
        starts[vertex] += starts[vertex - 1]
    for face in range(len(faces)):
        for corner in range(3):
            low = min(faces[face, corner], faces[face, _next(corner)])
            sides.sides[starts[low + 1]] = 3 * face + corner
            starts[low + 1] += 1


@njit_inline
def _find_root(forest: _Forest, face: int) -> tuple[int, bool]:
    """Return a face's root, and whether the face disagrees with it; shorten the way."""
    parents, flips = forest
    flipped = False
    while parents[face] != face:
        parent = parents[face]
        flips[face] ^= flips[parent]
        parents[face] = parents[parent]  # halves the way for whoever comes next
        flipped ^= flips[face]
        face = parents[face]
    return face, flipped


@njit_inline
def _join(forest: _Forest, face: int, other: int, disagree: bool) -> bool:
    """Join the trees of two faces; return whether they contradict, being of one."""
    root, is_flipped = _find_root(forest, face)
    other_root, other_is_flipped = _find_root(forest, other)
    roots_disagree = disagree ^ is_flipped ^ other_is_flipped
    if root == other_root:
        return roots_disagree
    # the lower face is the root, so that components are numbered by first faces
    forest.parents[max(root, other_root)] = min(root, other_root)
    forest.flips[max(root, other_root)] = roots_disagree
    return False


@njit_cached
def _unite(
    faces: Faces, sides: _Sides, edges: _Edges, forest: _Forest
) -> tuple[int, int, bool, bool]:
    """Unite faces that share edges; return the counts of ``Connections``.

    Args:
        faces: (F, 3) vertex indices.
        sides: To be filled; ``starts`` is 0.
        edges: ``places`` is -1.
        forest: Trees of one face each.
    """
    _sort_sides(faces, sides)
    places, users, balance = edges
    open_edges = unpaired_edges = 0
    has_one_side = may_coincide = False
    for vertex in range(len(places)):
        for place in range(sides.starts[vertex], sides.starts[vertex + 1]):
            face, corner = sides.sides[place] // 3, sides.sides[place] % 3
            begin, end = faces[face, corner], faces[face, _next(corner)]
            high, step = (end, 1) if begin < end else (begin, -1)
            if places[high] < sides.starts[vertex]:  # left by an earlier vertex
                places[high], users[high], balance[high] = place, 1, step
                open_edges += 1
                unpaired_edges += 1
                continue
            users[high] += 1
            unpaired_edges += int(users[high] == 3) - int(users[high] == 2)
            # neighbours agree if they run along their edge in opposite directions
            disagree = balance[high] == step
            open_edges -= int(balance[high] != 0)
            balance[high] += step
            open_edges += int(balance[high] != 0)
            first = sides.sides[places[high]]
            other, opposite = first // 3, _next(_next(first % 3))
            # equal triangles share all edges: cheap to exclude here, slow to search for
            may_coincide |= users[high] > 2
            may_coincide |= faces[other, opposite] == faces[face, _next(_next(corner))]
            has_one_side |= _join(forest, face, other, disagree)
    return open_edges, unpaired_edges, has_one_side, may_coincide


@njit_cached
def _label(forest: _Forest, labels: Labels) -> int:
    """Fill labels, and make ``flips`` relative to roots; return how many there are."""
    components = 0
    for face in range(len(labels)):
        root, flipped = _find_root(forest, face)
        forest.parents[face] = root
        forest.flips[face] = flipped
        if root == face:
            labels[face] = components
            components += 1
        else:
            labels[face] = labels[root]
    return components


@njit_cached
def _measure(
    vertices: Floats, faces: Faces, labels: Labels, origins: Floats, sizes: Sizes
) -> None:
    """Add up the sizes of components; arguments as of ``measure_components``."""
    for face in range(len(faces)):
        label = labels[face]
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        for axis in range(3):
            p, q, r = vertices[a, axis], vertices[b, axis], vertices[c, axis]
            sizes.lows[label, axis] = min(sizes.lows[label, axis], p, q, r)
            sizes.highs[label, axis] = max(sizes.highs[label, axis], p, q, r)
        volume = square = 0.0
        for x in range(3):
            y, z = _next(x), _next(_next(x))
            ax = vertices[a, x] - origins[label, x]
            oy, oz = origins[label, y], origins[label, z]
            ay, az = vertices[a, y] - oy, vertices[a, z] - oz
            by, bz = vertices[b, y] - oy, vertices[b, z] - oz
            cy, cz = vertices[c, y] - oy, vertices[c, z] - oz
            volume += ax * (by * cz - bz * cy)
            normal = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
            square += normal * normal
        sizes.volumes[label] += volume / 6.0
        sizes.areas[label] += np.sqrt(square) / 2.0


def warm_up() -> None:
    """Compile what maps with mesh files need, or read it from the cache."""
    vertices, faces = weld_vertices(np.eye(3), np.arange(3, dtype=np.int32)[None])
    labels = connect_faces(faces).labels
    measure_components(vertices, faces, labels, np.zeros((1, 3)))
