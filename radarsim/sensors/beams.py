"""The rays of a scan: where they start, where they point, and which are traced.

Theory of operation
===================
A beam has one or several rays, its nodes. Three of them, right, centre and left, stand
for the edges and the middle of a beam that diverges, N Unreal units apart. A cone has
any number, over a beam that has a horizontal and a vertical width.

The power of a beam falls off with the angle like a Gaussian, once on transmission and
once on reception: if ``w`` is the angle between the one-way half-power points, both
together have the standard deviation w / (4 sqrt(ln 2)) = 0.3003 w. The nodes of a
quadrature are those of Gauss and Hermite, a grid of them where the beam is wide in both
directions. Three across stand at 0 and 0.5201 w with weights 2/3 and 1/6: the main ray
and two side rays. Over a smooth target, n nodes in a row are exact to the order 2n - 1;
over an edge three are off by at most 1/3 of the beam, where the edge runs through the
main ray, and more nodes by less. Random rays are drawn from that Gaussian and have
equal weights.

Either one ray of each beam is drawn, by the nodes' weights, or all are traced.

Source: the noise model of a thesis on navigation with a radar in USARSim, section 4.3;
for the cone, what it proposes in section 7.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.divergence import (
    METRES_PER_UNIT,
    offset_angle,
    two_way_deviation,
)
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import LASER, RADAR, RayClass, Rays

Sides: TypeAlias = NDArray[np.int8]
Nodes: TypeAlias = NDArray[np.int16]

EMPTY: Final = np.zeros(0)
NO_CHANCES: Final = np.zeros((1, 0))
RIGHT, CENTRE, LEFT = -1, 0, 1
FEW_EDGES: Final = 8
CENTRE_TOLERANCE: Final = 1e-9  # rad off the middle of a beam


class NodeTable(NamedTuple):
    """All nodes of all beams, sensor frame.

    Attributes:
        directions: (K, N, 3) unit vectors.
        starts: (K, N, 3) m, or (1, N, 3) if all nodes of a beam start at one point.
        edges: (K - 1,) between 0 and 1, the random numbers from which on the next node
            is drawn.
        sides: (K,) int8, the side of its beam on which each node is.
    """

    directions: Floats
    starts: Floats
    edges: Floats
    sides: Sides


class AimedRays(NamedTuple):
    """The rays of J scans with M rays each, scan by scan and beam by beam.

    Attributes:
        nodes: (J * M,) node of its beam that each ray is.
        sides: (J * M,) side of its beam: -1 right, 0 centre, 1 left.
        origins: (J * M, 3) m, map frame.
        directions: (J * M, 3) unit vectors, map frame.
    """

    nodes: Nodes
    sides: Sides
    origins: Floats
    directions: Floats

    @classmethod
    def empty(cls, count: int) -> "AimedRays":
        """Allocate a number of rays, to be filled."""
        nodes, sides = np.zeros(count, np.int16), np.zeros(count, np.int8)
        return cls(nodes, sides, np.zeros((count, 3)), np.zeros((count, 3)))

    def rows(self, start: int, end: int) -> "AimedRays":
        """Return views of some of the rays."""
        return AimedRays(
            self.nodes[start:end],
            self.sides[start:end],
            self.origins[start:end],
            self.directions[start:end],
        )


class BeamPattern:
    """The beams of a sensor in its own frame, computed once.

    Attributes:
        angles: (N,) directions of the beams, rad, counter-clockwise from the right.
        radius: Largest distance from the sensor at which a ray starts, m.
        is_random: Whether sampling needs random numbers.
        weights: (K,) share of each node in its beam; equal for random rays.
        rays: Number of rays of each beam that are traced.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.angles = beam_angles(settings)
        offsets, self.weights = _nodes(settings)
        self._deviations = _random_deviations(settings)
        starts = _starts(settings, self.angles)
        sides = _sides(offsets)
        # Three rays may differ in their starts only, not in their angles.
        if settings.side_mode != "cone" and len(self.weights) == 3:
            sides = np.array([RIGHT, CENTRE, LEFT], np.int8)
        # The last edge is 1 but for rounding; without it no draw can lie beyond it.
        edges = np.cumsum(self.weights)[:-1]
        directions = node_directions(self.angles, offsets)
        self._table = NodeTable(directions, starts, edges, sides)
        self.radius = float(np.linalg.norm(starts, axis=2).max())
        traces_all = settings.combines_rays or settings.incidence_weights
        self.rays = len(self.weights) if traces_all else 1
        self.is_random = self._deviations is not None or self.rays < len(self.weights)
        self.rays_per_scan = len(self.angles) * self.rays

    def draw(self, rng: np.random.Generator | None) -> Floats:
        """Draw the random numbers of one scan; ``rng`` is unused if it needs none.

        Returns:
            (N,) 0 to 1, which select a node of each beam; or (K, N, 2), the angles of
            random rays to the left and up, in standard deviations; or nothing.
        """
        if not self.is_random or rng is None:
            return EMPTY
        if self._deviations is None:
            return rng.random(len(self.angles))
        return rng.standard_normal((self.rays, len(self.angles), 2))

    def aim(
        self, poses: Floats, draws: Sequence[Floats], rays: AimedRays | None = None
    ) -> AimedRays:
        """Aim the rays of scans.

        Args:
            poses: (J, 6) x, y, z, roll, pitch, yaw of the sensor in each, map frame.
            draws: What ``draw`` returned for each.
            rays: To be filled; None for new ones.
        """
        if rays is None:
            rays = AimedRays.empty(len(poses) * self.rays_per_scan)
        if self._deviations is not None:
            for i, draw in enumerate(draws):
                first = i * self.rays_per_scan
                some = rays.rows(first, first + self.rays_per_scan)
                self._aim_random(poses[i : i + 1], draw * self._deviations, some)
        elif self.is_random:
            chances = draws[0] if len(draws) == 1 else np.concatenate(draws)
            chances = chances.reshape(len(draws), -1)
            aim_scans(poses, DRAWN, chances, *self._table, *rays)
        else:
            aim_scans(poses, ALL, NO_CHANCES, *self._table, *rays)
        return rays

    def aim_nodes(self, poses: Floats, nodes: Nodes) -> AimedRays:
        """Aim given nodes.

        Args:
            poses: (J, 6) as in ``aim``.
            nodes: (J * M,) node of its beam that each ray is.
        """
        rays = AimedRays.empty(len(nodes))
        rays.nodes[:] = nodes
        aim_scans(poses, GIVEN, NO_CHANCES, *self._table, *rays)
        return rays

    def aim_side(self, poses: Floats, side: int) -> AimedRays:
        """Aim one ray of each beam.

        Args:
            poses: (J, 6) as in ``aim``.
            side: -1 for the right one of three, 0 for the centre, 1 for the left one.

        Raises:
            ValueError: If the beams do not have three rays.
        """
        matching = np.flatnonzero(self._table.sides == side)
        if self._deviations is not None or len(matching) != 1 or len(self.weights) > 3:
            raise ValueError(f"ray {side}, expected a beam of three rays")
        count = len(poses) * len(self.angles)
        return self.aim_nodes(poses, np.full(count, matching[0], np.int16))

    def _aim_random(self, pose: Floats, offsets: Floats, rays: AimedRays) -> None:
        """Aim random rays, of which each scan has its own."""
        directions = node_directions(self.angles, offsets)
        table = self._table._replace(directions=directions)
        aim_scans(pose, ALL, NO_CHANCES, *table, *rays)
        rays.sides[:] = _sides(offsets).T.ravel()


class RayTemplate:
    """The rays of a sensor before they are aimed.

    Most scans are as long as others before, and what they have in common is shared.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self._limits = settings.max_range, settings.penetration_power
        self._ray_class = ray_class_of(settings)
        self._rays = self._allocate(0)

    def rays_from(
        self, aimed: "AimedRays", carrier_ids: NDArray[np.int64] | None
    ) -> Rays:
        """Return aimed rays with range, power and class of the sensor's rays.

        Args:
            aimed: M rays.
            carrier_ids: (M,) the box that carries the sensor; None for none.
        """
        # Read once: other threads may replace it, also by a shorter one.
        n, rays = len(aimed.nodes), self._rays
        if n > len(rays.power):
            rays = self._rays = self._allocate(n)
        return Rays(
            aimed.origins,
            aimed.directions,
            rays.max_range[:n],
            rays.power[:n],
            rays.class_index[:n],
            rays.carrier_id[:n] if carrier_ids is None else carrier_ids,
            rays.ray_classes,
        )

    def _allocate(self, count: int) -> Rays:
        nowhere, (max_range, power) = np.zeros((count, 3)), self._limits
        rays = Rays.uniform(nowhere, nowhere, max_range=max_range, power=power)
        return replace(rays, ray_classes=(self._ray_class,))


@lru_cache(maxsize=64)
def template_of(settings: SensorSettings) -> RayTemplate:
    """Return the template of a sensor's rays; sensors of equal settings share it."""
    return RayTemplate(settings)


@lru_cache(maxsize=64)
def pattern_of(settings: SensorSettings) -> BeamPattern:
    """Return the beams of a sensor; sensors of equal settings share them."""
    return BeamPattern(settings)


# Which nodes `aim_scans` aims: those that the random numbers select, all of each beam,
# or those that are given.
DRAWN, ALL, GIVEN = range(3)


@njit_inline
def _node_of(edges: Any, chance: Any) -> Any:
    """Return the node that a random number selects: how many edges it has reached."""
    low, high = 0, len(edges)
    if high <= FEW_EDGES:
        # All are compared: where branches depend on random numbers, the processor
        # guesses them wrong, and a beam would take three times as long.
        for k in range(high):
            low += edges[k] <= chance
        return low
    while low < high:
        middle = (low + high) // 2
        if edges[middle] <= chance:
            low = middle + 1
        else:
            high = middle
    return low


class Frame(NamedTuple):
    """The frame of a sensor in the map frame.

    Attributes:
        position: (3,) m.
        rotation: (3, 3) from the sensor frame to the map frame.
    """

    position: Floats
    rotation: Floats


@njit_inline
def _fill_frame(poses: Any, scan: Any, frame: Any) -> None:
    """Set a frame to a pose; see ``geometry.rotation_matrix``, which it equals."""
    cr, sr = np.cos(poses[scan, 3]), np.sin(poses[scan, 3])
    cp, sp = np.cos(poses[scan, 4]), np.sin(poses[scan, 4])
    cy, sy = np.cos(poses[scan, 5]), np.sin(poses[scan, 5])
    rotation = frame.rotation
    rotation[0, 0], rotation[1, 0], rotation[2, 0] = cy * cp, sy * cp, -sp
    rotation[0, 1] = cy * sp * sr - sy * cr
    rotation[1, 1] = sy * sp * sr + cy * cr
    rotation[2, 1], rotation[2, 2] = cp * sr, cp * cr
    rotation[0, 2] = cy * sp * cr + sy * sr
    rotation[1, 2] = sy * sp * cr - cy * sr
    for axis in range(3):
        frame.position[axis] = poses[scan, axis]


@njit_inline
def _aim_ray(table: Any, frame: Any, beam: Any, rays: Any, i: Any) -> None:
    """Transform ray ``i`` of a beam, whose node is known, to the map frame."""
    node = np.int64(rays.nodes[i])
    rays.sides[i] = table.sides[node]
    starts, directions = table.starts, table.directions
    first = node if starts.shape[0] > 1 else 0
    sx, sy, sz = starts[first, beam, 0], starts[first, beam, 1], starts[first, beam, 2]
    dx, dy = directions[node, beam, 0], directions[node, beam, 1]
    dz = directions[node, beam, 2]
    for row in range(3):
        x, y, z = frame.rotation[row, 0], frame.rotation[row, 1], frame.rotation[row, 2]
        # The sums begin with 0.0, so that none of them is -0.0.
        rays.origins[i, row] = frame.position[row] + (0.0 + x * sx + y * sy + z * sz)
        rays.directions[i, row] = 0.0 + x * dx + y * dy + z * dz


@njit_inline
def _aim_scan(table: Any, frame: Any, choice: Any, chances: Any, rays: Any) -> None:
    """Aim the rays of one scan; arguments as in ``aim_scans``.

    The loop is here and not there, where it would count references to the arrays.
    """
    beams, i = table.directions.shape[1], 0
    rays_per_beam = len(rays.nodes) // max(beams, 1)
    for beam in range(beams):
        for ray in range(rays_per_beam):
            if choice == DRAWN:
                rays.nodes[i] = _node_of(table.edges, chances[i])
            elif choice == ALL:
                rays.nodes[i] = ray
            _aim_ray(table, frame, beam, rays, i)
            i += 1


@njit_cached
def aim_scans(poses: Any, choice: Any, chances: Any, *columns: Any) -> None:
    """Select the rays of scans, and transform them to the map frame.

    Columns come one by one: numba takes twice as long to unpack tuples of arrays.

    Args:
        poses: (J, 6) x, y, z, roll, pitch, yaw of the sensor in each scan, map frame.
        choice: ``DRAWN``, ``ALL`` or ``GIVEN``.
        chances: (J, N) random numbers from 0 to 1; not read unless ``DRAWN``.
        columns: The NodeTable, and then the AimedRays to be filled, as many for each
            beam; its nodes are read if they are ``GIVEN``.
    """
    table, rays = NodeTable(*columns[:4]), AimedRays(*columns[4:])
    frame, each = Frame(np.zeros(3), np.zeros((3, 3))), len(rays.nodes) // len(poses)
    for scan in range(len(poses)):
        some = slice(scan * each, (scan + 1) * each)
        _fill_frame(poses, scan, frame)
        own = AimedRays(
            rays.nodes[some],
            rays.sides[some],
            rays.origins[some],
            rays.directions[some],
        )
        _aim_scan(table, frame, choice, chances[scan if choice == DRAWN else 0], own)


def ray_class_of(settings: SensorSettings) -> RayClass:
    """Return the ray class of a sensor, on which the effect of materials depends."""
    radar = settings.medium == "radar"
    return RayClass(
        RADAR if radar else LASER,
        BANDS_GHZ.index(settings.band_ghz) if radar else 0,
        settings.power_per_db,
        settings.max_bounces,
    )


def beam_angles(settings: SensorSettings) -> Floats:
    """Return the beams' directions, (N,) rad, counter-clockwise from the right."""
    step = math.radians(settings.resolution_deg)
    first = -math.radians(settings.fov_deg) / 2
    angles: Floats = first + step * np.arange(settings.beams, dtype=np.float64)
    return angles


def node_directions(angles: Floats, offsets: Floats) -> Floats:
    """Return the directions of nodes, sensor frame.

    Args:
        angles: (N,) directions of the beams, rad.
        offsets: (K, N, 2) or (K, 1, 2) offsets of the nodes to the left and up, rad.

    Returns:
        (K, N, 3) unit vectors.
    """
    directions = np.zeros((len(offsets), len(angles), 3))
    _fill_directions(angles, offsets, directions)
    return directions


@njit_cached
def _fill_directions(angles: Any, offsets: Any, directions: Any) -> None:
    per_beam = offsets.shape[1] > 1
    for k in range(len(offsets)):
        for i in range(len(angles)):
            offset = offsets[k, i if per_beam else 0]
            azimuth, level = angles[i] + offset[0], np.cos(offset[1])
            directions[k, i, 0] = level * np.cos(azimuth)
            directions[k, i, 1] = level * np.sin(azimuth)
            directions[k, i, 2] = np.sin(offset[1])


def _nodes(settings: SensorSettings) -> tuple[Floats, Floats]:
    """Return the nodes' offsets to the left and up, (K, 1, 2) rad, and their weights.

    Random rays have zeros here: their offsets are drawn for each scan.
    """
    if settings.rays_per_beam == 1:
        return np.zeros((1, 1, 2)), np.ones(1)
    if settings.side_mode == "cone":
        return _cone_nodes(settings)
    weights = np.array(settings.ray_weights) / sum(settings.ray_weights)
    offsets = np.zeros((3, 1, 2))
    if settings.side_mode == "divergent":
        angle = offset_angle(settings.side_offset_uu, settings.divergence_distance)
        offsets[:, 0, 0] = -angle, 0.0, angle
    return offsets, weights


def _cone_nodes(settings: SensorSettings) -> tuple[Floats, Floats]:
    if settings.cone_sampling == "random":
        count = settings.cone_rays
        return np.zeros((count, 1, 2)), np.full(count, 1 / count)
    widths = settings.beamwidth_az_deg, settings.beamwidth_el_deg
    deviations = [two_way_deviation(math.radians(width)) for width in widths]
    (left, left_share), (up, up_share) = (
        quadrature(count) for count in settings.cone_grid
    )
    across, above = np.meshgrid(left * deviations[0], up * deviations[1])
    offsets = np.stack([across.ravel(), above.ravel()], axis=-1)[:, None]
    return offsets, np.outer(up_share, left_share).ravel()


def quadrature(count: int) -> tuple[Floats, Floats]:
    """Return Gauss-Hermite nodes, in standard deviations, and weights that sum to 1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def _random_deviations(settings: SensorSettings) -> Floats | None:
    """Return the standard deviations of random rays, (2,) rad across and up."""
    cone = settings.has_side_rays and settings.side_mode == "cone"
    if not cone or settings.cone_sampling != "random":
        return None
    widths = settings.beamwidth_az_deg, settings.beamwidth_el_deg
    return np.array([two_way_deviation(math.radians(width)) for width in widths])


def _starts(settings: SensorSettings, angles: Floats) -> Floats:
    """Return the starts of the rays, (3, N, 3) m, or (1, N, 3) if all are the same."""
    offset = settings.side_offset_uu * METRES_PER_UNIT
    to_left = np.zeros((len(angles), 3))
    if settings.has_side_rays and settings.side_mode == "perpendicular":
        to_left[:] = (
            offset * node_directions(angles + math.pi / 2, np.zeros((1, 1, 2)))[0]
        )
    elif settings.has_side_rays and settings.side_mode == "lateral":
        to_left[:, 1] = offset
    if not to_left.any():
        return to_left[None]
    return np.array([RIGHT * to_left, CENTRE * to_left, LEFT * to_left])


def _sides(offsets: Floats) -> Sides:
    """Return the side of each ray: (K,) or (K, N) for offsets (K, 1 or N, 2)."""
    across = offsets[..., 0]
    sides = np.where(np.abs(across) < CENTRE_TOLERANCE, 0.0, np.sign(across)).astype(
        np.int8
    )
    return sides[:, 0] if offsets.shape[1] == 1 else sides
