"""Round things of metal, such as posts and spheres, which return as points.

Theory of operation
===================
What is round returns from where it faces the antenna. By geometrical optics that is a
cross section of

    pi / (1 / r + 1 / R)^2

of the radius of curvature r at a distance R, which is pi r^2 of a small sphere, and pi
R^2 of a flat mirror. What is round in one direction only, such as a post, returns by
physical optics along the line at which it faces the antenna,

    2 pi F / (lambda (1 / r + 1 / R)), F = |integral of e^(2 i k z^2 / 2 R) dz|^2:

far away F is the square of its length L, so that a cylinder has 2 pi r L^2 / lambda.

Meshes have flat faces, so that their curvature is that of their corners: the angle that
the faces around a vertex lack of a whole turn is the product of both curvatures, times
a third of their area. Two faces at an edge, each of width w, that turn by an angle a
are as round as w / (2 sin(a / 2)); edges that are longer than that are those of posts.
A vertex, or an edge, faces the antenna if all around it is farther away.

Source: E. F. Knott, J. F. Shaeffer and M. T. Tuley, Radar Cross Section, chapters 5
and 6; for meshes: M. Meyer et al., Discrete Differential-Geometry Operators, 2003.
"""

import math
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

from radarsim.addons.fmcw.point_echoes import Points, head_on_reflection
from radarsim.geometry import Floats
from radarsim.raycast.tracer import Tracer

BENT: Final = 0.8  # cosine between the normals of faces that are round, at least
FLAT: Final = 1e-6  # how far that cosine of faces of one plane is off 1
LEAST_ROUND: Final = 1e-4  # m^2, of a cross section that counts
MOST_ROUND: Final = 64  # of one antenna; the strongest
MOST_TRIANGLES: Final = 20_000  # of a part: meshes of more are scanned
LEAST_LACK: Final = 1e-5  # rad, of the angle that the faces around a vertex lack
TIE: Final = 1e-9 * np.array([1.0, 2.0, 3.0])  # m, by which no two places are as near
OFF: Final = 0.002  # m off a surface, which then does not hide the point
_DIGITS: Final = 6  # of places, so that vertices at one place are one

# A vertex or an edge of a round part.
_ROUND: Final = np.dtype(
    [
        ("foot", np.float64, 3),  # m, map frame; of an edge its beginning
        ("along", np.float64, 3),  # unit vector of an edge; 0 of a vertex
        ("normal", np.float64, 3),  # unit vector of one of the faces around
        ("length", np.float64),  # m, of an edge
        ("curvature", np.float64),  # 1/m
        ("part", np.int64),
    ]
)


class _Round(NamedTuple):
    """What is round in a scene of P parts; N vertices and edges."""

    parts: NDArray[np.bool_]  # (P,) whether each is round for the most part
    rows: NDArray[np.void]  # (N,) of these parts
    owners: NDArray[np.int64]  # (K,) rows that have neighbours
    away: Floats  # (K, 3) m, from each neighbour to the row, across an edge


_known: WeakKeyDictionary[Tracer, _Round] = WeakKeyDictionary()


def round_parts(tracer: Tracer) -> NDArray[np.bool_]:
    """Return which parts of a scene are mirrors that are round, (P,)."""
    return _round_of(tracer).parts


def round_points(tracer: Tracer, origin: Floats, wavelength: float) -> Points:
    """Return the points of round metal that return to an antenna.

    Args:
        tracer: Tracer of the scene.
        origin: (3,) m, place of the antenna, map frame.
        wavelength: m.
    """
    _, rows, owners, away = _round_of(tracer)
    way = origin - rows["foot"]
    place = np.einsum("ni,ni->n", way, rows["along"])
    across = way - place[:, None] * rows["along"]
    faces = np.einsum("ni,ni->n", across, rows["normal"]) > 0
    # The nearest of its neighbours faces the antenna; of two as near, one.
    middle = across[owners] + away / 2 + TIE
    np.logical_and.at(faces, owners, np.einsum("ki,ki->k", away, middle) > 0)
    rows, place, across = rows[faces], place[faces], across[faces]
    distance = np.maximum(np.linalg.norm(across, axis=1), 1e-6)
    radius = 1 / (rows["curvature"] + 1 / distance)
    ends = np.column_stack([-place, rows["length"] - place])
    line = 2 * radius * fresnel_square(ends, wavelength, distance) / wavelength
    rcs = math.pi * np.where(rows["length"] > 0, line, radius**2)
    rcs *= [head_on_reflection(tracer.parts[i].material) for i in rows["part"]]
    order = np.argsort(-rcs / distance**4, kind="stable")[:MOST_ROUND]
    lit = order[rcs[order] > LEAST_ROUND]
    near = np.clip(place, 0, rows["length"])[:, None] * rows["along"]
    positions = rows["foot"] + near + OFF * across / distance[:, None]
    return Points(positions[lit], rcs[lit])


def fresnel_square(ends: Floats, wavelength: float, distance: Floats) -> Floats:
    """Return F of lines that an antenna sees from the side, (N,) m^2.

    Args:
        ends: (N, 2) m, from where to where they are, from the foot of the antenna.
        wavelength: m.
        distance: (N,) m, from the antenna to its foot.
    """
    # The line integral of a spherical wave, by Fresnel's integrals.
    scale = np.sqrt(4 / (wavelength * distance))
    sines, cosines = fresnel(ends * scale[:, None])
    square = np.diff(sines) ** 2 + np.diff(cosines) ** 2
    return np.asarray(square.ravel() / scale**2)


def _round_of(tracer: Tracer) -> _Round:
    if tracer not in _known:
        meshes = [
            (number, part.vertices[part.faces])
            for number, part in enumerate(tracer.parts)
            if part.material.radar_mirror and 0 < len(part.faces) <= MOST_TRIANGLES
        ]
        none = np.zeros((0, 3, 3))
        triangles = np.concatenate([none, *(mesh for _, mesh in meshes)])
        numbers = np.repeat([n for n, _ in meshes], [len(mesh) for _, mesh in meshes])
        halves = _HalfEdges(triangles, numbers.astype(np.int64))
        _known[tracer] = halves.find_round(len(tracer.parts))
    return _known[tracer]


class _HalfEdges:
    """Edges of meshes as each of their faces has them, from a corner to the next."""

    def __init__(self, triangles: Floats, part: NDArray[np.int64]) -> None:
        """Link the halves.

        Args:
            triangles: (F, 3, 3) m.
            part: (F,) the part of each.
        """
        sides = np.roll(triangles, -1, axis=1) - triangles
        crosses = np.cross(sides[:, 0], sides[:, 1])
        double = np.linalg.norm(crosses, axis=1)
        is_face = double > 0
        self.part = np.repeat(part[is_face], 3)
        self.doubled = np.repeat(double[is_face], 3)  # m^2, twice the area of the face
        self.normals = np.repeat(crosses[is_face] / double[is_face, None], 3, axis=0)
        self.length = np.linalg.norm(sides[is_face], axis=2).ravel()
        self.along = sides[is_face].reshape(-1, 3) / self.length[:, None]
        corners = triangles[is_face].reshape(-1, 3)
        keys = np.column_stack([self.part, np.round(corners, _DIGITS)]) + 0.0
        _, self.first, begin = np.unique(
            keys, axis=0, return_index=True, return_inverse=True
        )
        self.places = corners[self.first]  # of vertices
        self.begin = begin.ravel()
        self.end, self.third = (
            np.roll(self.begin.reshape(-1, 3), -k, axis=1).ravel() for k in (1, 2)
        )
        here, there = (
            one * len(self.places) + other
            for one, other in ((self.begin, self.end), (self.end, self.begin))
        )
        order = np.argsort(here, kind="stable")
        found = np.searchsorted(here, there, sorter=order)
        self.twin = order[np.minimum(found, max(len(order) - 1, 0))]
        # Between the normals of both faces; -1 at the rim of a mesh.
        cosine = np.einsum("hi,hi->h", self.normals, self.normals[self.twin])
        self.cosine = np.where(here[self.twin] == there, cosine, -1.0)

    def find_round(self, count: int) -> _Round:
        """Return what is round in as many parts."""
        beyond = self.places[self.third[self.twin]] - self.places[self.begin]
        is_bent = (self.cosine >= BENT) & (self.cosine < 1 - FLAT)
        is_bent &= np.einsum("hi,hi->h", beyond, self.normals) < 0
        # Parts of most of whose area the faces are bent against others.
        of_faces = np.repeat(is_bent.reshape(-1, 3).any(axis=1), 3)
        weights = np.where(of_faces, self.doubled, -self.doubled)
        parts = np.bincount(self.part, weights, count) > 0
        vertices, bends = self._round_vertices(parts)
        edges, curvature = self._round_edges(is_bent & parts[self.part])
        rows = np.zeros(len(vertices) + len(edges), _ROUND)
        rows["foot"] = self.places[np.concatenate([vertices, self.begin[edges]])]
        halves = np.concatenate([self.first[vertices], edges])
        rows["part"], rows["normal"] = self.part[halves], self.normals[halves]
        rows["curvature"] = np.concatenate([bends, curvature])
        of_edges = rows[len(vertices) :]
        of_edges["along"], of_edges["length"] = self.along[edges], self.length[edges]
        around = np.flatnonzero(np.isin(self.begin, vertices))
        numbers = np.arange(len(vertices), len(rows))
        owners = np.concatenate(
            [np.searchsorted(vertices, self.begin[around]), numbers, numbers]
        )
        others = self.third[edges], self.third[self.twin[edges]]
        neighbours = np.concatenate([self.end[around], *others])
        away, along = rows["foot"][owners] - self.places[neighbours], rows["along"]
        away -= np.einsum("ki,ki->k", away, along[owners])[:, None] * along[owners]
        return _Round(parts, rows, owners, away)

    def _round_vertices(
        self, parts: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], Floats]:
        """Return the vertices of some parts that are round, and their curvature."""
        count, along = len(self.places), self.along.reshape(-1, 3, 3)
        cosines = -(along * np.roll(along, 1, axis=1)).sum(axis=2)
        angles = np.arccos(np.clip(cosines, -1, 1)).ravel()
        lack = 2 * math.pi - np.bincount(self.begin, angles, count)
        share = np.bincount(self.begin, self.doubled / 6, count)
        is_smooth = parts[self.part[self.first]] & (lack > LEAST_LACK)
        np.logical_and.at(is_smooth, self.begin, self.cosine >= BENT)
        found = np.flatnonzero(is_smooth)
        return found, np.sqrt(lack[found] / share[found])

    def _round_edges(
        self, is_bent: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], Floats]:
        """Return the bent edges that are those of posts, and their curvature."""
        width = (self.doubled + self.doubled[self.twin]) / (2 * self.length)
        curvature = np.sqrt(np.maximum(2 - 2 * self.cosine, 0)) / width
        found = is_bent & (self.begin < self.end) & (self.length * curvature > 1)
        return np.flatnonzero(found), curvature[found]
