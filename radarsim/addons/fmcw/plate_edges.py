"""The edges of upright plates of metal, which return far off their glint.

Theory of operation
===================
Of a flat plate that is turned away, only the edges return, by physical optics: each
upright edge as a line whose cross section is

    F / (4 pi tan^2 theta), F = |integral of e^(2 i k z^2 / 2 R) dz|^2,

theta being the angle on the level between the wave and the normal of the plate. Far
away F is the square of the edge's length, near the plate half of lambda R at most. The
two edges of a plate beat with each other, as tones of the spectrum: that makes its
lobes, whose mean falls with 1 / theta^2. Near the normal its glint takes over, which
is the rays' matter. Where the map has plates of other directions, they have none.

Source: E. F. Knott, J. F. Shaeffer and M. T. Tuley, Radar Cross Section, chapter 5.
"""

import math
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import fresnel

from radarsim.addons.fmcw.point_echoes import Points
from radarsim.addons.fmcw.scattering import lobe_of
from radarsim.geometry import Floats
from radarsim.raycast.tracer import Tracer
from radarsim.scene.scene import Part

LEAST: Final = 1e-6  # m^2, of an edge that counts
OFF: Final = 0.002  # m outside of the edge, so that its own plate does not hide it
FLAT: Final = 1e-6  # how far a normal is off the level, and an edge off the vertical
SHARP: Final = 0.5  # cosine between the normals of faces that meet in an edge, at most


class Edges(NamedTuple):
    """Upright edges of plates of metal; N of them, one for each face at an edge.

    Attributes:
        places: (N, 2) m, x and y.
        outward: (N, 2) unit vectors to the outside of the plate.
        heights: (N, 2) m, z of both ends.
        normals: (N, 2) unit vectors of the faces.
        narrowness: (N,) of the glint of their material, as in ``Scattering``.
    """

    places: Floats
    outward: Floats
    heights: Floats
    normals: Floats
    narrowness: Floats


_known: WeakKeyDictionary[Tracer, Edges] = WeakKeyDictionary()


def edge_points(tracer: Tracer, origin: Floats, wavelength: float) -> Points:
    """Return the points of edges that return to an antenna.

    Args:
        tracer: Tracer of the scene.
        origin: (3,) m, place of the antenna, map frame.
        wavelength: m.
    """
    edges = _known.get(tracer)
    if edges is None:
        edges = _known[tracer] = _find_edges(tracer)
    way = edges.places - origin[:2]
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
    cosine = -np.einsum("ni,ni->n", way, edges.normals) / distance
    cosine = np.clip(cosine, 0.0, 1 - 1e-12)
    slant = (1 - cosine**2) / np.maximum(cosine, 1e-6) ** 2  # tan^2
    # Where the plate glints, its edges are part of that.
    away = 1 - np.exp(-slant * edges.narrowness)
    # The line integral of a spherical wave, by Fresnel's integrals.
    scale = np.sqrt(4 / (wavelength * distance))
    ends = (edges.heights - origin[2]) * scale[:, None]
    sines, cosines = fresnel(ends)
    square = (np.diff(sines) ** 2 + np.diff(cosines) ** 2).ravel() / scale**2
    rcs = np.where(cosine > 0, square * away / (4 * math.pi * slant), 0.0)
    near = np.clip(origin[2], edges.heights[:, 0], edges.heights[:, 1])
    places = np.column_stack([edges.places + OFF * edges.outward, near])
    lit = rcs > LEAST
    return Points(places[lit], rcs[lit])


def _find_edges(tracer: Tracer) -> Edges:
    rows = [
        row
        for part in tracer.parts
        if part.material.radar_mirror and part.material.transmission_db is None
        for row in _edges_of(part)
    ]
    table = np.array(rows, np.float64).reshape(-1, 9)
    return Edges(
        table[:, 0:2], table[:, 2:4], table[:, 4:6], table[:, 6:8], table[:, 8]
    )


def _edges_of(part: Part) -> list[list[float]]:
    """Return the upright edges of a part, a row of ``Edges`` for each face at one."""
    corners = part.vertices[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    middle = part.bounds.mean(axis=0)[:2]
    narrowness = lobe_of(part.material)[1]
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
            continue  # an edge of a rounded thing, whose faces turn little there
        out = np.array([x, y]) - middle
        out /= max(float(np.linalg.norm(out)), 1e-9)
        rows += [[x, y, *out, low, high, *face, narrowness] for face in faces]
    return rows
