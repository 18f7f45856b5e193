"""The triangles of a scene in float64, and the crossings that a ray has with them.

Embree says which triangles a ray meets; where it meets them is computed here, from
the planes. A ray through an edge or a vertex meets several triangles of one surface.
Two crossings are one if their triangles face the same way, share a vertex, and the
ray passes that vertex, or the edge they share, as near as float32 can tell.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.penetration import Toll, sort_crossings
from radarsim.scene.scene import Part

NO_FACES: Final = np.zeros((0, 3), np.int32)
REFINED: Final = 2e-3  # m; how far float64 may move a distance of Embree's
BLUR: Final = 4e-7  # m per m; float32 knows a ray's place no better


class Surfaces(NamedTuple):
    """The triangles of a scene, as the loop looks them up.

    Attributes:
        first: (P,) int64, the row of each part's first triangle.
        plane: (T, 4) normal and offset of each triangle: ``normal @ x == offset``.
        corner: (T, 3) int32 rows of ``vertex``.
        vertex: (V, 3) m.
        sheet: (P,) uint8, the parts that take power per surface.
        volume: (K,) int32, the parts that are penetrable volumes.
        low: (K, 3) m, their least corners.
        high: (K, 3) m, their greatest corners.
    """

    first: NDArray[np.int64]
    plane: Floats
    corner: NDArray[np.int32]
    vertex: Floats
    sheet: NDArray[np.uint8]
    volume: NDArray[np.int32]
    low: Floats
    high: Floats


def middle_of(parts: Sequence[Part]) -> Floats:
    """Give the middle of the box around all parts, (3,) m."""
    corners = [part.vertices for part in parts if len(part.vertices)]
    if not corners:
        return np.zeros(3)
    low = np.min([vertices.min(axis=0) for vertices in corners], axis=0)
    high = np.max([vertices.max(axis=0) for vertices in corners], axis=0)
    return np.asarray((low + high) / 2)


def toll_of(parts: Sequence[Part], column: str) -> Toll:
    """Collect what parts cost, from a column of their materials."""
    density = np.array([getattr(part.material, column) for part in parts], np.float64)
    loss = [
        np.nan if part.material.sheet_loss is None else part.material.sheet_loss
        for part in parts
    ]
    if column == "laser_density":  # a sheet that lets light through takes none
        loss = [0.0 if np.isfinite(number) else np.nan for number in loss]
    return Toll(density, np.array(loss, np.float64))


def tabulate(
    parts: Sequence[Part], middle: Floats, listed: NDArray[np.bool_]
) -> Surfaces:
    """Make the tables of triangles, and of volumes.

    Raises:
        EngineError: If a volume is not closed.
    """
    planes, corners, vertices = [np.zeros((0, 4))], [NO_FACES], [np.zeros((0, 3))]
    first, placed = [], 0
    rows = 0
    volumes = []
    for index, part in enumerate(parts):
        points = part.vertices - middle
        a, b, c = (points[part.faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        planes.append(np.column_stack([normals, np.einsum("ij,ij->i", normals, a)]))
        corners.append(part.faces + np.int32(placed))
        vertices.append(points)
        first.append(rows)
        rows += len(part.faces)
        placed += len(points)
        if not listed[index] or part.material.sheet_loss is not None:
            continue
        if not part.closed:
            raise EngineError(
                f"{part.object_name!r} of {part.material.name!r} has open edges,"
                " expected a closed volume or a material with sheet_loss"
            )
        if len(part.faces):
            volumes.append((index, a.min(axis=0), a.max(axis=0)))
    return Surfaces(
        np.array(first, np.int64),
        np.concatenate(planes),
        np.concatenate(corners).astype(np.int32),
        np.concatenate(vertices),
        np.array([part.material.sheet_loss is not None for part in parts], np.uint8),
        np.array([index for index, _, _ in volumes], np.int32),
        np.array([low for _, low, _ in volumes], np.float64).reshape(-1, 3),
        np.array([high for _, _, high in volumes], np.float64).reshape(-1, 3),
    )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def refine(surfaces: Any, row: Any, origin: Any, direction: Any, t: Any) -> Any:
    """Give the float64 distance to a triangle's plane, and 1 for its front, -1 back.

    A ray that is all but parallel to the plane keeps Embree's distance.
    """
    slope, height = 0.0, surfaces.plane[row, 3]
    for axis in range(3):
        slope += surfaces.plane[row, axis] * direction[axis]
        height -= surfaces.plane[row, axis] * origin[axis]
    exact = np.float64(t)
    if slope != 0.0 and abs(height / slope - exact) <= REFINED:
        exact = max(height / slope, 0.0)
    return exact, np.int32(1 if slope < 0.0 else -1)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _distance_to_line(origin: Any, direction: Any, point: Any, along: Any) -> Any:
    """Give how far a ray's line passes a line through a point, m.

    A line along nothing is the point itself.
    """
    gap = point - origin
    normal = np.cross(direction, along)
    length = np.sqrt(_dot(normal, normal))
    if length <= 1e-9 * np.sqrt(_dot(along, along)):
        off = gap - _dot(gap, direction) * direction
        return np.sqrt(_dot(off, off))
    return abs(_dot(gap, normal)) / length


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _is_double(
    surfaces: Any, walk: Any, i: Any, j: Any, origin: Any, direction: Any
) -> Any:
    """Say whether two crossings are one: the ray goes through what they share."""
    shared, first, second = 0, 0, 0
    for a in range(3):
        for b in range(3):
            corner = surfaces.corner[walk.row[i], a]
            if corner == surfaces.corner[walk.row[j], b]:
                shared += 1
                first, second = second, corner
    if shared == 0:
        return False
    point = surfaces.vertex[second]
    along = point - surfaces.vertex[first] if shared > 1 else np.zeros(3)
    blur = BLUR * (1.0 + walk.t[i] + np.abs(origin).max())
    return _distance_to_line(origin, direction, point, along) <= blur


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _drop_doubles(
    surfaces: Any, walk: Any, count: Any, origin: Any, direction: Any
) -> Any:
    """Count each surface once; the list stays sorted.

    Returns:
        How many crossings are left.
    """
    kept = 0
    for i in range(count):
        double = False
        j = kept - 1
        while j >= 0 and walk.t[i] - walk.t[j] <= REFINED and not double:
            if walk.part[i] == walk.part[j] and walk.turn[i] == walk.turn[j]:
                double = _is_double(surfaces, walk, i, j, origin, direction)
            j -= 1
        if not double:
            walk.t[kept], walk.part[kept] = walk.t[i], walk.part[i]
            walk.turn[kept], walk.row[kept] = walk.turn[i], walk.row[i]
            kept += 1
    return kept


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def list_crossings(
    surfaces: Any, walk: Any, hits: Any, count: Any, ray: Any, end: Any
) -> Any:
    """Take Embree's hits over into the walk: refined, sorted, each surface once."""
    origin, direction = ray
    n = 0
    for i in range(count):
        part = np.int64(hits[i].geometry)
        row = surfaces.first[part] + hits[i].triangle
        t, turn = refine(surfaces, row, origin, direction, hits[i].t)
        if t <= end:
            walk.t[n], walk.part[n] = t, part
            walk.turn[n], walk.row[n] = turn, row
            n += 1
    if n > 1:
        sort_crossings(walk, n)
        n = _drop_doubles(surfaces, walk, n, origin, direction)
    return n
