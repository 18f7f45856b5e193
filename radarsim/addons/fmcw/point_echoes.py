"""Computes the echoes of points on direct and reflected paths (multipath).

Theory of operation
===================
A point, such as a corner reflector, is visible directly and by reflections at mirrors,
smooth walls and level ground. Through a plane it appears at its mirror image, at the
distance of the image. A wave may travel out on one path and return on another. So paths
i and j give a beat component at the range (Ri + Rj) / 2 with the phase 2 pi (Ri + Rj) /
lambda. If i and j differ, its field is doubled. The direct path and the path over level
ground differ by less than a bin, so they interfere: as heights and ranges change, the
power varies between zero and 12 dB above the point alone.

The reflection of a surface follows from the Fresnel equations, as the mean of both
polarisations, with the refractive index that gives its reflection at normal incidence.
Roughness reduces it by Rayleigh's criterion.

Every azimuth receives all points, in its main lobe or its sidelobes.

Source: M. I. Skolnik, Introduction to Radar Systems, on the pattern over flat ground;
P. Beckmann and A. Spizzichino, The Scattering of Electromagnetic Waves from Rough
Surfaces.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antenna import Viewpoints, azimuth_pattern, elevation_pattern
from radarsim.addons.fmcw.beat_signal import Tones
from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    noise_power,
    radar_constant,
)
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.rays import Boxes, Outcome, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import OPAQUE, Material

if TYPE_CHECKING:
    from radarsim.addons.fmcw.radar import FmcwRadar

CLEARANCE: Final = 1e-3  # m; surfaces closer than this to a point do not hide the point
FAINT: Final = 0.01  # power relative to the noise; weaker components are left out
MOST_PLANES: Final = 64  # maximum number of planes that reflect points, largest first
ROUGHNESS: Final = 1e-3  # m rms, for smooth surfaces that are not mirrors; estimate
_DIGITS: Final = 4  # digits to which planes are rounded to merge their faces


class Points(NamedTuple):
    """N points that reflect radar waves.

    Attributes:
        positions: Positions, (N, 3) m, map frame.
        rcs: Radar cross sections, (N,) m^2.
    """

    positions: Floats
    rcs: Floats


NO_POINTS: Final = Points(np.zeros((0, 3)), np.zeros(0))

# Flat surfaces that reflect radar waves like mirrors.
_PLANE: Final = np.dtype(
    [
        ("area", np.float64),  # m^2
        ("normal", np.float64, 3),  # unit vector, map frame
        ("offset", np.float64),  # m, distance from the origin along the normal
        ("part", np.int64),
        ("reflected", np.float64),  # share of power reflected at normal incidence
        ("is_mirror", np.bool_),  # whether that share is the same at all angles
        ("absorbed_db", np.float64),  # absorption in the ray tracer
    ]
)


class Ways(NamedTuple):
    """K propagation paths from an antenna to points.

    Attributes:
        points: Indices of the points, (K,) int64.
        images: Apparent positions (mirror images) of the points, (K, 3) m, map frame.
        fields: One-way factors of the field, (K,); negative if the phase is inverted.
    """

    points: NDArray[np.int64]
    images: Floats
    fields: Floats


class Sight(NamedTuple):
    """Traces the lines of sight between an antenna, surfaces and points.

    Attributes:
        radar: The radar.
        tracer: Tracer of the scene.
        origin: Position of the antenna, (3,) m, map frame.
        boxes: The boxes of robots.
        carrier_id: Id of the robot that carries the radar; -1 for none.
    """

    radar: "FmcwRadar"
    tracer: Tracer
    origin: Floats
    boxes: Boxes | None
    carrier_id: int

    def losses(self, starts: Floats, ends: Floats) -> Floats:
        """Return one-way losses between N pairs of positions, dB; inf if hidden."""
        loss = np.full(len(ends), np.inf)
        rows = np.flatnonzero(np.linalg.norm(ends - starts, axis=1) > 2 * CLEARANCE)
        if len(rows):
            # A mirror between two positions hides them like any other surface.
            traces, _ = self._trace(starts[rows], ends[rows], -CLEARANCE)
            passed = traces.outcomes == Outcome.NOTHING
            loss[rows[passed]] = self._decibels(traces.power[passed])
        return loss

    def losses_to_parts(
        self, ends: Floats, parts: NDArray[np.int64], absorbed_db: Floats
    ) -> Floats:
        """Return one-way losses from antenna to parts, (N,) dB; inf if hidden."""
        starts = np.broadcast_to(self.origin, ends.shape)
        traces, reach = self._trace(starts, ends, CLEARANCE)
        met = (traces.outcomes == Outcome.HIT) & (traces.parts == parts)
        met &= np.abs(traces.ranges - reach) < 3 * CLEARANCE
        return np.where(met, self._decibels(traces.power) - absorbed_db, np.inf)

    def _trace(
        self, starts: Floats, ends: Floats, longer: float
    ) -> tuple[Traces, Floats]:
        """Trace rays to ``longer`` m behind ``ends``; return traces and lengths, m."""
        offsets = ends - starts
        distance = np.linalg.norm(offsets, axis=1)
        reach, directions = distance + longer, offsets / distance[:, None]
        rays = self.radar.rays(
            starts, directions, max_range=reach, carrier_id=self.carrier_id
        )
        straight = (self.radar.ray_class._replace(max_reflections=0),)
        traces = self.tracer.trace(replace(rays, ray_classes=straight), self.boxes)
        return traces, reach

    def _decibels(self, power: Floats) -> Floats:
        lost = self.radar.full_power - power
        return np.asarray(lost / self.radar.ray_class.power_per_db)


_known: WeakKeyDictionary[Tracer, NDArray[np.void]] = WeakKeyDictionary()


def reflecting_planes(tracer: Tracer) -> NDArray[np.void]:
    """Return the largest reflecting planes of a scene, rows of ``_PLANE``."""
    if tracer not in _known:
        planes = np.array(list(_find_planes(tracer)), _PLANE)
        largest = np.argsort(-planes["area"], kind="stable")[:MOST_PLANES]
        _known[tracer] = planes[largest]
    return _known[tracer]


def _find_planes(tracer: Tracer) -> Iterator[tuple[object, ...]]:
    """Yield a row of ``_PLANE`` for each plane of each reflecting part."""
    for number, part in enumerate(tracer.parts):
        reflected, material = head_on_reflection(part.material), part.material
        if reflected <= 0 or not part.faces.size:
            continue
        a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        area = np.linalg.norm(normals, axis=1)
        normals = normals[area > 0] / area[area > 0, None]
        planes = np.column_stack([normals, np.einsum("fi,fi->f", normals, a[area > 0])])
        found, which = np.unique(np.round(planes, _DIGITS), axis=0, return_inverse=True)
        areas = np.bincount(which.ravel(), area[area > 0] / 2)
        absorbed = material.absorption_db if material.radar_mirror else 0.0
        kind = (number, reflected, material.radar_mirror, absorbed)
        for size, plane in zip(areas.tolist(), found, strict=True):
            # The exact normal is kept, since a rounded normal would shift distant
            # mirror images.
            exact = planes[(np.abs(planes - plane) < 10**-_DIGITS).all(axis=1)][0]
            yield (size, exact[:3], exact[3], *kind)


def head_on_reflection(material: Material) -> float:
    """Return the share of power that a flat surface reflects at normal incidence."""
    if material.density != OPAQUE or math.isinf(material.absorption_db):
        return 0.0
    if material.radar_mirror:
        return float(10 ** (-material.absorption_db / 10))
    db = material.specular_db
    return 0.0 if db is None else float(10 ** (db / 10))


def fresnel_reflections(head_on: Floats, cosine: Floats) -> tuple[Floats, Floats]:
    """Return the shares of power that smooth surfaces reflect (Fresnel equations).

    Args:
        head_on: Share that is reflected at normal incidence, below 1.
        cosine: Cosine of the angle of incidence.

    Returns:
        Shares for fields perpendicular and parallel to the plane of incidence.
    """
    root = np.sqrt(np.minimum(head_on, 0.999))
    square = ((1 + root) / (1 - root)) ** 2  # square of the refractive index
    inside = np.sqrt(square - 1 + cosine**2)
    across = (cosine - inside) / (cosine + inside)
    along = (square * cosine - inside) / (square * cosine + inside)
    return np.asarray(across**2), np.asarray(along**2)


def straight_ways(sight: Sight, points: Points, _wavelength: float) -> Ways:
    """Return the direct paths from the antenna to all visible points."""
    places = points.positions
    loss = sight.losses(np.broadcast_to(sight.origin, places.shape), places)
    seen = np.flatnonzero(np.isfinite(loss))
    return Ways(seen, places[seen], 10 ** (-loss[seen] / 20))


def find_ways(sight: Sight, points: Points, wavelength: float) -> Ways:
    """Return the direct paths to points, and the paths with a single reflection.

    Args:
        sight: Lines of sight of the antenna.
        points: The points.
        wavelength: Wavelength, m.
    """
    origin, places = sight.origin, points.positions
    found = [straight_ways(sight, points, wavelength)]
    planes = reflecting_planes(sight.tracer)
    # Normals are copied to contiguous memory, since numpy's rounding depends on the
    # layout.
    directions = planes["normal"].copy()
    height = directions @ origin - planes["offset"]
    heights = places @ directions.T - planes["offset"]  # (N, M)
    point, plane = np.nonzero((heights > CLEARANCE) & (height > CLEARANCE))
    if len(point):
        normals, above = directions[plane], heights[point, plane]
        images = places[point] - 2 * above[:, None] * normals
        share = height[plane] / (height[plane] + above)
        middle = origin + share[:, None] * (images - origin)
        own = planes[plane]
        loss = sight.losses_to_parts(middle, own["part"], own["absorbed_db"])
        lit = np.flatnonzero(np.isfinite(loss))
        loss[lit] += sight.losses(places[point[lit]], middle[lit])
        lit = np.flatnonzero(np.isfinite(loss))
        way = images[lit] - origin
        cosine = np.abs(np.einsum("ki,ki->k", way, normals[lit]))
        cosine /= np.linalg.norm(way, axis=1)
        share = reflected_share(own[lit], cosine, wavelength)
        fields = -np.sqrt(share) * 10 ** (-loss[lit] / 20)
        found.append(Ways(point[lit], images[lit], fields))
    return Ways._make(np.concatenate(column) for column in zip(*found, strict=True))


def reflected_share(
    planes: NDArray[np.void], cosine: Floats, wavelength: float
) -> Floats:
    """Return the share of the power that planes reflect specularly."""
    head_on = planes["reflected"]
    # The surface's roughness changes the phase of the wave by this rms value, rad.
    turn = 4 * math.pi * ROUGHNESS * cosine / wavelength
    across, along = fresnel_reflections(head_on, cosine)
    smooth = (across + along) / 2 * np.exp(-(turn**2))
    return np.where(planes["is_mirror"], head_on, smooth)


def point_tones(
    settings: FmcwSettings, view: Viewpoints, rows: range, points: Points, ways: Ways
) -> Tones:
    """Return the beat components that azimuths receive from points.

    Args:
        settings: Settings of the radar.
        view: Viewpoints of the antenna at the azimuths.
        rows: Indices of the azimuths.
        points: The points.
        ways: Paths to the points.
    """
    offsets = ways.images[None, :, :] - view.positions[:, None, :]
    distance = np.linalg.norm(offsets, axis=2)  # (R, K)
    seen = np.einsum("rni,rij->rnj", offsets, view.rotations)
    across = settings.step * np.array(rows)[:, None]
    across = across + np.arctan2(seen[..., 1], seen[..., 0])
    across = np.remainder(across + math.pi, 2 * math.pi) - math.pi
    elevation = np.arcsin(np.clip(seen[..., 2] / np.maximum(distance, 1e-9), -1, 1))
    # In dB, the one-way level of sidelobes is half of their two-way level.
    pattern = azimuth_pattern(settings, across)
    pattern = np.maximum(pattern, 10 ** (settings.sidelobe_db / 20))
    pattern *= elevation_pattern(settings, elevation)
    field = np.sqrt(pattern) * ways.fields / np.maximum(distance, 1e-9)
    speed = np.einsum("rki,ri->rk", offsets, view.velocities)
    speed /= np.maximum(distance, 1e-9)
    first, second = _pairs(ways.points)
    both = np.where(first == second, 1.0, 2.0) * field[:, first] * field[:, second]
    strength = radar_constant(settings) / noise_power(settings)
    power = strength * points.rcs[ways.points[first]] * both**2
    row, pair = np.nonzero((power > FAINT) & (distance[:, first] > CLEARANCE))
    length = (distance[row, first[pair]] + distance[row, second[pair]]) / 2
    approach = (speed[row, first[pair]] + speed[row, second[pair]]) / 2
    # The phase depends on the true distance, and the beat frequency also on the Doppler
    # shift. In an up-sweep, phase and frequency rise with the distance, as for speckle.
    phases = 4 * math.pi * length / settings.wavelength
    phases += np.where(both[row, pair] < 0, math.pi, 0.0)
    shifted = length + doppler_shift(settings, approach)
    return Tones(row + rows.start, shifted, phases, power[row, pair])


def _pairs(points: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of all pairs of paths to the same point, each pair once."""
    numbers = np.arange(len(points))
    same = points[:, None] == points[None, :]
    first, second = np.nonzero(same & (numbers[:, None] <= numbers[None, :]))
    return first, second
