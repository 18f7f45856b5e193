"""Echoes of round metal objects, such as posts and spheres, modelled as points.

Theory of operation
===================
The echo of a round object comes from the point at which its surface faces the antenna.
By geometrical optics the cross section is

    pi / (1 / r + 1 / R)^2

for the radius of curvature r and the distance R; it is pi r^2 for a small sphere and
pi R^2 for a flat mirror. If an object is curved in one direction only, such as a post,
its echo comes from the line at which it faces the antenna. By physical optics it has

    2 pi F / (lambda (1 / r + 1 / R)), F = |integral of e^(2 i k z^2 / 2 R) dz|^2

Far away F is the square of the length L, so a cylinder has 2 pi r L^2 / lambda.

Meshes have flat faces, so their curvature is concentrated in vertices and edges: the
angle defect at a vertex (2 pi minus the angles of the faces around it) is the product
of both curvatures times a third of the faces' area. Two faces at an edge, each of width
w and at an angle a, have a radius of w / (2 sin(a / 2)); an edge that is longer than
its radius belongs to a post. A vertex or an edge faces the antenna if its neighbours
are farther away.

Source: E. F. Knott, J. F. Shaeffer and M. T. Tuley, Radar Cross Section, chapters 5
and 6; for meshes: M. Meyer et al., Discrete Differential-Geometry Operators, 2003.
"""

import math
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

from radarsim.addons.fmcw.point_echoes import NO_POINTS, Points, head_on_reflection
from radarsim.geometry import Floats
from radarsim.raycast.tracer import Tracer

BENT: Final = 0.8  # least cosine between the normals of adjacent faces of round objects
FLAT: Final = 1e-6  # faces are in a plane if this cosine differs from 1 by less
LEAST_ROUND: Final = 1e-4  # m^2, least cross section of a point
MOST_ROUND: Final = 64  # maximum number of points for an antenna, strongest first
MOST_TRIANGLES: Final = 20_000  # parts with more triangles are scanned meshes
LEAST_LACK: Final = 1e-5  # rad, least angle defect at a vertex of a round object
TIE: Final = 1e-9 * np.array([1.0, 2.0, 3.0])  # m, offset that breaks ties of distance
OFF: Final = 0.002  # m, offset of points, so that their own surfaces do not hide them
_DIGITS: Final = 6  # digits to which positions are rounded to merge vertices

# A vertex or an edge of a round part.
_ROUND: Final = np.dtype(
    [
        ("foot", np.float64, 3),  # m, vertex or beginning of the edge, map frame
        ("along", np.float64, 3),  # unit vector of the edge; 0 for a vertex
        ("normal", np.float64, 3),  # unit normal of an adjacent face
        ("length", np.float64),  # m, length of the edge; 0 for a vertex
        ("curvature", np.float64),  # 1/m
        ("part", np.int64),
    ]
)


class _Round(NamedTuple):
    """The N round vertices and edges in a scene of P parts."""

    parts: NDArray[np.bool_]  # (P,) whether most of the part's surface is round
    rows: NDArray[np.void]  # (N,) vertices and edges of these parts
    owners: NDArray[np.int64]  # (K,) for each neighbour the row to which it belongs
    away: Floats  # (K, 3) m, from each neighbour to its row, perpendicular to an edge


_known: WeakKeyDictionary[Tracer, _Round] = WeakKeyDictionary()


def round_parts(tracer: Tracer) -> NDArray[np.bool_]:
    """Return a mask of the parts of a scene that are round mirrors, (P,)."""
    return _round_of(tracer).parts


def round_points(tracer: Tracer, origin: Floats, wavelength: float) -> Points:
    """Return the strongest points of round metal objects, as seen from an antenna.

    Args:
        tracer: Tracer of the scene.
        origin: Position of the antenna, (3,) m, map frame.
        wavelength: Wavelength, m.
    """
    _, rows, owners, away = _round_of(tracer)
    if not len(rows):
        return NO_POINTS
    way = origin - rows["foot"]
    place = np.einsum("ni,ni->n", way, rows["along"])
    across = way - place[:, None] * rows["along"]
    faces = np.einsum("ni,ni->n", across, rows["normal"]) > 0
    # A vertex or edge faces the antenna if it is closer than all its neighbours; TIE
    # decides ties.
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
    """Return the squared Fresnel integrals of lines beside an antenna, (N,) m^2.

    Args:
        ends: Both ends along each line, from the foot of the perpendicular from the
            antenna, (N, 2) m.
        wavelength: Wavelength, m.
        distance: Distances from the antenna to these feet, (N,) m.
    """
    # Fresnel integrals give the line integral of a spherical wave.
    scale = np.sqrt(4 / (wavelength * distance))
    sines, cosines = fresnel(ends * scale[:, None])
    square = (sines[:, 1] - sines[:, 0]) ** 2 + (cosines[:, 1] - cosines[:, 0]) ** 2
    return np.asarray(square / scale**2)


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
    """Half-edges of meshes: the sides of all faces, linked to their twins."""

    def __init__(self, triangles: Floats, part: NDArray[np.int64]) -> None:
        """Link the half-edges.

        Args:
            triangles: Corners of triangles, (F, 3, 3) m.
            part: Parts of the triangles, (F,).
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
        self.places = corners[self.first]  # positions of vertices
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
        # The cosine between the normals of both faces; -1 at the boundary of a mesh.
        cosine = np.einsum("hi,hi->h", self.normals, self.normals[self.twin])
        self.cosine = np.where(here[self.twin] == there, cosine, -1.0)

    def find_round(self, count: int) -> _Round:
        """Return the round vertices and edges; ``count`` is the number of parts."""
        beyond = self.places[self.third[self.twin]] - self.places[self.begin]
        is_bent = (self.cosine >= BENT) & (self.cosine < 1 - FLAT)
        is_bent &= np.einsum("hi,hi->h", beyond, self.normals) < 0
        # A part is round if faces at bent edges form most of its area.
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
        """Return the round vertices of the selected parts, and their curvatures."""
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
        """Return the bent edges that belong to posts, and their curvatures."""
        width = (self.doubled + self.doubled[self.twin]) / (2 * self.length)
        curvature = np.sqrt(np.maximum(2 - 2 * self.cosine, 0)) / width
        found = is_bent & (self.begin < self.end) & (self.length * curvature > 1)
        return np.flatnonzero(found), curvature[found]
