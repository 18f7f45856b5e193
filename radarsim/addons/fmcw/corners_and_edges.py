"""Echoes of dihedral corners of smooth surfaces, and of edges of metal plates.

Both are modelled as points with a radar cross section.

Theory of operation of corners
==============================
Two flat surfaces that meet at a right angle reflect a wave back to its source by double
reflection. Seen from the antenna they act as a single mirror, which is at their common
line and faces the antenna. Its width is the width over which both surfaces reflect, at
most twice the narrower of their projections. A large smooth mirror at the distance R
has the cross section pi R^2. Each bounce multiplies it by the Fresnel reflection for
its angle of incidence, the mean of both polarisations.

The slopes of rough surfaces tilt parts of that mirror, so its reflections are spread
over a normally distributed lobe. The corner reflects the part of the lobe that it
covers, and the beam illuminates a part of it. A corner that is small compared with the
Fresnel zone acts as flat and returns 4 pi A^2 / lambda^2, which is 8 pi a^2 b^2 /
lambda^2 for a corner of two plates a x b that opens to the antenna.

Corners of two mirrors are left to the ray tracer, which reflects rays at mirrors.

Theory of operation of edges
============================
By physical optics, only the edges of a flat upright plate that does not face the
antenna return power. Each upright edge is a line with the cross section

    F / (4 pi tan^2 theta), F = |integral of e^(2 i k z^2 / 2 R) dz|^2,

where theta is the horizontal angle between the wave and the normal of the plate. Far
away F is the square of the edge's length; near the plate it is at most lambda R / 2.
The two edges of a plate interfere as beat components of the spectrum, which gives the
lobes of the plate, whose mean falls with 1 / theta^2. Near the normal the specular
reflection dominates, which the ray tracer computes. Other plates have no edges.

Source: E. F. Knott, J. F. Shaeffer and M. T. Tuley, Radar Cross Section, chapters 5
and 6.
"""

import math
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.special import erf

from radarsim.addons.fmcw.point_echoes import (
    NO_POINTS,
    Points,
    fresnel_reflections,
    head_on_reflection,
)
from radarsim.addons.fmcw.round_metal import fresnel_square
from radarsim.addons.fmcw.scattering import DENT_AREA, lobe_of, mirror_area
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Part

LEAST_CORNER: Final = 1e-4  # m^2, least cross section of a corner
MOST_CORNERS: Final = 64  # maximum number of corners for an antenna, strongest first
MOST_FACETS: Final = 2000  # maximum number of facets of a scene, largest first
MOST_TRIANGLES: Final = 20_000  # parts with more triangles are curved or scanned
GAP: Final = 0.05  # m, maximum gap between two surfaces that form a corner
NARROWEST: Final = 0.05  # m, least width of a surface next to the line of a corner
SQUARE: Final = 0.01  # maximum cosine between the surfaces of a corner
OFF: Final = 0.002  # m, offset of points, so that their own surfaces do not hide them
LEAST_EDGE: Final = 1e-6  # m^2, least cross section of an edge
FLAT: Final = 1e-6  # tolerance for horizontal normals and vertical edges
SHARP: Final = 0.5  # maximum cosine between the normals of faces that meet at an edge
_DIGITS: Final = 4  # digits to which planes are rounded to merge their triangles


class Facet(NamedTuple):
    """A flat, connected piece of a smooth surface.

    Attributes:
        normal: Outward unit vector, (3,).
        offset: Distance of the plane from the origin along the normal, m.
        vertices: Vertices, (V, 3) m, map frame.
        reflected: Share of the power that the facet reflects at normal incidence.
        is_mirror: Whether this share is the same at all angles of incidence.
        slope: Variance of the slopes of the facet's surface, rad^2.
    """

    normal: Floats
    offset: float
    vertices: Floats
    reflected: float
    is_mirror: bool
    slope: float


# A line at which two facets meet at a right angle.
_CORNER: Final = np.dtype(
    [
        ("foot", np.float64, 3),  # m, a point on the line, map frame
        ("along", np.float64, 3),  # unit vector of the line
        ("ends", np.float64, 2),  # m, ends of the common line, along it from the foot
        ("normals", np.float64, (2, 3)),  # unit normals of the facets
        ("depths", np.float64, 2),  # m, widths of the facets from the line
        ("reflected", np.float64, 2),  # share of power reflected at normal incidence
        ("is_mirror", np.bool_, 2),  # whether that share is the same at all angles
        ("slopes", np.float64, 2),  # variances of the facets' slopes, rad^2
    ]
)
_corners: WeakKeyDictionary[Tracer, NDArray[np.void]] = WeakKeyDictionary()


def corner_points(tracer: Tracer, origin: Floats, settings: FmcwSettings) -> Points:
    """Return points for the strongest corners of a scene, as seen from an antenna.

    Args:
        tracer: Tracer of the scene.
        origin: Position of the antenna, (3,) m, map frame.
        settings: Settings of the radar.
    """
    corners = _corners.get(tracer)
    if corners is None:
        corners = _corners[tracer] = _find_corners(tracer)
    if not len(corners):
        return NO_POINTS
    way = origin - corners["foot"]
    heights = np.einsum("nki,ni->nk", corners["normals"], way)  # above both facets
    inside = heights.min(axis=1, initial=np.inf) > GAP
    corners, way, heights = corners[inside], way[inside], heights[inside]
    place = np.einsum("ni,ni->n", corners["along"], way)
    distance = np.hypot(*heights.T)
    rcs = _cross_sections(corners, heights, place, settings)
    near = np.clip(place, *corners["ends"].T)
    positions = corners["foot"] + near[:, None] * corners["along"]
    positions = positions + OFF * corners["normals"].sum(axis=1)
    order = np.argsort(-rcs / distance**4, kind="stable")[:MOST_CORNERS]
    strongest = order[rcs[order] > LEAST_CORNER]
    return Points(positions[strongest], rcs[strongest])


def _cross_sections(
    corners: NDArray[np.void], heights: Floats, place: Floats, settings: FmcwSettings
) -> Floats:
    """Return the radar cross sections of corners, (N,) m^2.

    Args:
        corners: N corners.
        heights: Heights of the antenna above both facets, (N, 2) m.
        place: Positions of the antenna along the lines, (N,) m.
        settings: Settings of the radar.
    """
    distance = np.hypot(*heights.T)
    cosines = heights / distance[:, None]
    across, along = fresnel_reflections(corners["reflected"], cosines)
    smooth = (across.prod(axis=1) + along.prod(axis=1)) / 2
    mirrors = np.where(corners["is_mirror"], corners["reflected"], (across + along) / 2)
    is_mixed = corners["is_mirror"].any(axis=1)
    share = np.where(is_mixed, mirrors.prod(axis=1), smooth)
    half = (corners["depths"] * cosines).min(axis=1)
    length = np.ptp(corners["ends"], axis=1)
    # On a facet that is smaller than a dent, slopes are smaller than on a large one.
    dents = np.minimum(corners["depths"] * length[:, None] / DENT_AREA, 1.0)
    slopes = corners["slopes"] * dents
    wavelength = settings.wavelength
    area = np.minimum(2 * half * length, wavelength * distance / 2)
    waves = wavelength**2 / (8 * math.pi * area)
    # Slopes across the common line deflect the wave fully. Slopes along it deflect the
    # wave in proportion to the cosine of the angle of incidence on the facet.
    beside, ahead = slopes.sum(axis=1), (slopes * cosines**2).sum(axis=1)
    widths = [settings.beamwidth_az_deg, settings.beamwidth_el_deg]
    azimuth, elevation = (
        math.radians(each) ** 2 / (16 * math.log(2)) for each in widths
    )
    is_upright = np.abs(corners["along"][:, 2]) > math.sqrt(0.5)
    seen = _share_of_lobe(
        *(beside, waves),
        np.where(is_upright, azimuth, elevation),
        np.column_stack([-half, half]) / distance[:, None],
    )
    seen *= _share_of_lobe(
        *(ahead, waves),
        np.where(is_upright, elevation, azimuth),
        (corners["ends"] - place[:, None]) / distance[:, None],
    )
    return np.asarray(math.pi * distance**2 * share * seen)


def _share_of_lobe(
    slopes: Floats, waves: Floats, beam: Floats, angles: Floats
) -> Floats:
    """Return the shares of lobes that are both on the corner and in the beam, (N,).

    Args:
        slopes: Variances of the reflection angles from slopes, (N,) rad^2.
        waves: Variances from diffraction at the reflecting zone, (N,) rad^2.
        beam: Variances of the two-way beam, (N,) rad^2.
        angles: Lower and upper angle of the corner, (N, 2) rad.
    """
    lit = beam / (beam + slopes)
    within = erf(angles / np.sqrt(2 * (lit * slopes + waves))[:, None])
    return np.asarray(np.sqrt(lit) * np.ptp(within, axis=1) / 2)


def _find_corners(tracer: Tracer) -> NDArray[np.void]:
    facets = _find_facets(tracer)
    if not facets:
        return np.zeros(0, _CORNER)
    normals = np.array([each.normal for each in facets])
    low = np.array([each.vertices.min(axis=0) for each in facets]) - GAP
    high = np.array([each.vertices.max(axis=0) for each in facets]) + GAP
    meet = np.abs(normals @ normals.T) < SQUARE
    for axis in range(3):
        meet &= low[:, None, axis] <= high[None, :, axis]
        meet &= low[None, :, axis] <= high[:, None, axis]
    pairs = np.argwhere(np.triu(meet))
    found = (_corner_of(facets[i], facets[j]) for i, j in pairs.tolist())
    return np.array([corner for corner in found if corner is not None], _CORNER)


def _corner_of(first: Facet, second: Facet) -> tuple[object, ...] | None:
    """Return the corner that two facets form, as a row; None if they form none."""
    if first.is_mirror and second.is_mirror:
        return None
    cosine = float(first.normal @ second.normal)
    along = np.cross(first.normal, second.normal)
    along /= np.linalg.norm(along)
    square = 1 - cosine**2
    foot = (first.offset - cosine * second.offset) / square * first.normal
    foot = foot + (second.offset - cosine * first.offset) / square * second.normal
    depths, ends = [], []
    for facet, other in ((first, second), (second, first)):
        before = facet.vertices @ other.normal - other.offset
        if before.min() > GAP or before.max() < NARROWEST:
            return None
        depths.append(before.max())
        places = (facet.vertices - foot) @ along
        ends.append((places.min(), places.max()))
    low, high = max(ends[0][0], ends[1][0]), min(ends[0][1], ends[1][1])
    if high - low < NARROWEST:
        return None
    both = (first, second)
    return (
        *(foot, along, (low, high), [each.normal for each in both], depths),
        [each.reflected for each in both],
        [each.is_mirror for each in both],
        [each.slope for each in both],
    )


def _find_facets(tracer: Tracer) -> list[Facet]:
    """Return the largest facets of the smooth surfaces of a scene."""
    parts = [
        part
        for part in tracer.parts
        if 0 < len(part.faces) <= MOST_TRIANGLES
        and head_on_reflection(part.material) > 0
        and lobe_of(part.material)[1] > 0
    ]
    if not parts:
        return []
    triangles = np.concatenate([part.vertices[part.faces] for part in parts])
    numbers = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    crosses = np.cross(
        triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    )
    areas = np.linalg.norm(crosses, axis=1) / 2
    kept = np.flatnonzero(areas > 0)
    triangles, numbers, areas = triangles[kept], numbers[kept], areas[kept]
    normals = crosses[kept] / (2 * areas[:, None])
    offsets = np.einsum("fi,fi->f", normals, triangles[:, 0])
    pieces = _pieces(triangles, np.column_stack([numbers, normals, offsets]))
    totals = np.bincount(pieces, areas)
    order = np.argsort(pieces, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(pieces))[:-1])
    found = []
    for piece in np.argsort(-totals, kind="stable")[:MOST_FACETS].tolist():
        own = members[piece]
        material = parts[numbers[own[0]]].material
        found.append(
            Facet(
                normals[own[0]],
                float(offsets[own[0]]),
                triangles[own].reshape(-1, 3),
                head_on_reflection(material),
                material.radar_mirror,
                0.5 / lobe_of(material)[1],
            )
        )
    return found


def _pieces(triangles: Floats, planes: Floats) -> NDArray[np.int64]:
    """Return for each triangle the number of the facet that contains it, (F,).

    Triangles of a plane that share a vertex belong to the same facet.

    Args:
        triangles: Corners of triangles, (F, 3, 3) m.
        planes: Part, normal and offset of each triangle, (F, 5).
    """
    count = len(triangles)
    keys = np.repeat(np.round(planes, _DIGITS), 3, axis=0)
    places = np.round(triangles.reshape(-1, 3), _DIGITS)
    corners = np.hstack([keys, places]) + 0.0  # turns -0.0 into 0.0
    _, vertex = np.unique(corners, axis=0, return_inverse=True)
    # The graph links each triangle to the vertices in its plane.
    rows, columns = np.repeat(np.arange(count), 3), vertex.ravel() + count
    size = int(columns.max()) + 1
    links = sparse.coo_matrix((np.ones(3 * count), (rows, columns)), (size, size))
    _, labels = connected_components(links, directed=False)
    _, pieces = np.unique(labels[:count], return_inverse=True)
    return np.asarray(pieces, np.int64)


_edges: WeakKeyDictionary[Tracer, Floats] = WeakKeyDictionary()


def edge_points(tracer: Tracer, origin: Floats, wavelength: float) -> Points:
    """Return points for the edges of a scene's metal plates, as seen from an antenna.

    Args:
        tracer: Tracer of the scene.
        origin: Position of the antenna, (3,) m, map frame.
        wavelength: Wavelength, m.
    """
    edges = _edges.get(tracer)
    if edges is None:
        edges = _edges[tracer] = _find_edges(tracer)
    if not len(edges):
        return NO_POINTS
    columns = np.split(edges, [2, 4, 6, 8, 9], axis=1)
    places, outward, upright, normals, slopes, area = columns
    way = places - origin[:2]
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
    cosine = -np.einsum("ni,ni->n", way, normals) / distance
    cosine = np.clip(cosine, 0.0, 1 - 1e-12)
    slant = (1 - cosine**2) / np.maximum(cosine, 1e-6) ** 2  # tan^2
    # Within the plate's specular lobe, the lobe already contains the echo of the edges.
    zone = np.minimum(area.ravel(), wavelength * distance / 2)
    spread = slopes.ravel() + wavelength**2 / (8 * math.pi * zone)
    away = 1 - np.exp(-slant / (2 * spread))
    square = fresnel_square(upright - origin[2], wavelength, distance)
    rcs = np.where(cosine > 0, square * away / (4 * math.pi * slant), 0.0)
    near = np.clip(origin[2], *upright.T)
    positions = np.column_stack([places + OFF * outward, near])
    lit = rcs > LEAST_EDGE
    return Points(positions[lit], rcs[lit])


def _find_edges(tracer: Tracer) -> Floats:
    """Return the upright edges of metal plates: a row for each face at each edge.

    The columns are x and y of the edge, m; a unit vector away from the plate; z of both
    ends, m; the normal of the face, x and y; the variance of its slopes, rad^2; and the
    area of the plate, m^2.
    """
    rows = [
        row
        for part in tracer.parts
        if part.material.radar_mirror and part.material.transmission_db is None
        for row in _edges_of(part)
    ]
    return np.array(rows, np.float64).reshape(-1, 10)


def _edges_of(part: Part) -> list[list[float]]:
    """Return the upright edges of a part."""
    corners = part.vertices[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    middle = part.bounds.mean(axis=0)[:2]
    area = mirror_area(part)
    slopes = 0.5 / lobe_of(part.material, area)[1]
    found: dict[tuple[float, ...], list[Floats]] = {}
    for triangle, normal in zip(corners, normals, strict=True):
        if abs(normal[2]) > FLAT:
            continue
        for first, second in ((0, 1), (1, 2), (2, 0)):
            a, b = triangle[first], triangle[second]
            if np.abs(a[:2] - b[:2]).max() < FLAT and a[2] != b[2]:
                low, high = sorted((float(a[2]), float(b[2])))
                key = (round(float(a[0]), 6), round(float(a[1]), 6), low, high)
                found.setdefault(key, []).append(normal[:2])
    rows = []
    for (x, y, low, high), faces in found.items():
        if len(faces) > 1 and faces[0] @ faces[1] > SHARP:
            continue  # the edge of a rounded object, whose faces are nearly parallel
        out = np.array([x, y]) - middle
        out /= max(float(np.linalg.norm(out)), 1e-9)
        rows += [[x, y, *out, low, high, *face, slopes, area] for face in faces]
    return rows
