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
main ray, and more nodes by less. Even nodes are all as far apart, over 0.6 widths to
either side, where the Gaussian has 95 % of its power; their weights are its density. So
nothing that is wider than a step is missed. Random rays are drawn from that Gaussian
and have equal weights.

Either one ray of each beam is drawn, by the nodes' weights, or all are traced.

Source: the noise model of a thesis on navigation with a radar in USARSim, section 4.3;
for the cone, what it proposes in section 7.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import (
    BANDS_GHZ,
    METRES_PER_UNIT,
    SensorSettings,
    offset_angle,
    two_way_deviation,
)
from radarsim.raycast.aimed_rays import (
    ALL,
    DRAWN,
    GIVEN,
    NO_CHANCES,
    AimedRays,
    Nodes,
    NodeTable,
    SensorRays,
    Sides,
    UnaimedScans,
    aim_scans,
)
from radarsim.raycast.rays import LASER, RADAR, RayClass, Rays, columns_of

EMPTY: Final = np.zeros(0)
NO_VECTORS: Final = np.zeros((0, 3))
RIGHT, CENTRE, LEFT = -1, 0, 1
CENTRE_TOLERANCE: Final = 1e-9  # rad off the middle of a beam
EVEN_EDGE: Final = 0.6 * 4 * math.sqrt(math.log(2))  # 0.6 widths, standard deviations


class BeamPattern:
    """The beams of a sensor in its own frame, computed once.

    Attributes:
        angles: (N,) directions of the beams, rad, counter-clockwise from the right.
        radius: Largest distance from the sensor at which a ray starts, m.
        is_random: Whether sampling needs random numbers.
        has_random_rays: Whether each scan has rays of its own, instead of nodes.
        weights: (K,) share of each node in its beam; equal for random rays.
        rays: Number of rays of each beam that are traced.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.angles = beam_angles(settings)
        offsets, self.weights = _nodes(settings)
        is_cone = settings.has_side_rays and settings.side_mode == "cone"
        self.has_random_rays = is_cone and settings.cone_sampling == "random"
        self._deviations = np.ones(2)
        if self.has_random_rays:
            self._deviations = np.array(_deviations(settings))
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
        self._power = settings.max_range, settings.penetration_power
        self._ray_class = ray_class_of(settings)
        limits = columns_of(self.rays_from(AimedRays.empty(1), -1))
        # The engine aims the rays itself, and needs only what all of them have in
        # common.
        self._limits = limits._replace(origins=NO_VECTORS, directions=NO_VECTORS)
        self._sensor_rays: SensorRays | None = None
        traces_all = settings.combines_rays or settings.incidence_weights
        self.rays = len(self.weights) if traces_all else 1
        has_nodes = not self.has_random_rays
        self._draws_nodes = has_nodes and self.rays < len(self.weights)
        self.is_random = self.has_random_rays or self._draws_nodes
        self.rays_per_scan = len(self.angles) * self.rays

    def draw(self, rng: np.random.Generator | None) -> Floats:
        """Draw the random numbers of one scan; ``rng`` is unused if it needs none.

        Returns:
            (N,) 0 to 1, which select a node of each beam; or (K, N, 2), the angles of
            random rays to the left and up, in standard deviations; or nothing.
        """
        if not self.is_random or rng is None:
            return EMPTY
        if not self.has_random_rays:
            return rng.random(len(self.angles))
        return rng.standard_normal((self.rays, len(self.angles), 2))

    def aim(self, poses: Floats, draws: Sequence[Floats]) -> AimedRays:
        """Aim the rays of scans.

        Args:
            poses: (J, 6) x, y, z, roll, pitch, yaw of the sensor in each, map frame.
            draws: What ``draw`` returned for each.
        """
        rays = AimedRays.empty(len(poses) * self.rays_per_scan)
        if self.has_random_rays:
            for i, draw in enumerate(draws):
                first = i * self.rays_per_scan
                some = rays.rows(first, first + self.rays_per_scan)
                pose = poses[i : i + 1]
                aim_scans(pose, ALL, NO_CHANCES, *self._table_of(draw), *some)
                some.sides[:] = self.sides_of(draw)
        else:
            choice = DRAWN if self._draws_nodes else ALL
            aim_scans(poses, choice, self._chances(draws), *self._table, *rays)
        return rays

    def unaimed(self, draws: Sequence[Floats], places: Floats) -> UnaimedScans:
        """Return scans to be aimed while they are traced.

        Args:
            draws: What ``draw`` returned for each scan; of random rays only one.
            places: (J, 7) as in ``UnaimedScans``.
        """
        sensor = self._sensor_rays
        # Packed once for all scans of the sensor: only poses and random numbers
        # change.
        if sensor is None or self.has_random_rays:
            medium = RayClass(self._ray_class.medium)
            sensor = self._sensor_rays = SensorRays(
                self._table_of(draws[0]),
                self.radius,
                self._limits,
                (self._ray_class, medium),
                self.rays_per_scan,
            )
        return UnaimedScans(sensor, self._chances(draws), places)

    def _chances(self, draws: Sequence[Floats]) -> Floats:
        """Return random numbers that select nodes, (J, N); (1, 0) if all are aimed."""
        if not self._draws_nodes:
            return NO_CHANCES
        if len(draws) == 1:
            return draws[0][None]
        return np.concatenate(draws).reshape(len(draws), -1)

    def _table_of(self, draw: Floats) -> NodeTable:
        """Return the nodes of a scan; those of random rays are its own."""
        if not self.has_random_rays:
            return self._table
        directions = node_directions(self.angles, self._offsets(draw))
        return self._table._replace(directions=directions)

    def sides_of(self, draw: Floats) -> Sides:
        """Return the side of its beam on which each random ray of a scan is, (M,)."""
        return _sides(self._offsets(draw)).T.ravel()

    def _offsets(self, draw: Floats) -> Floats:
        """Return the angles of random rays to the left and up, (K, N, 2) rad."""
        return draw * self._deviations

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
        if self.has_random_rays or len(matching) != 1 or len(self.weights) > 3:
            raise ValueError(f"ray {side}, expected a beam of three rays")
        count = len(poses) * len(self.angles)
        return self.aim_nodes(poses, np.full(count, matching[0], np.int16))

    def rays_from(self, aimed: AimedRays, carrier: int | NDArray[np.int64]) -> Rays:
        """Return aimed rays with range, power and class of the sensor's rays.

        Args:
            aimed: M rays.
            carrier: Id of the box that carries the sensor, or (M,) of each ray; -1 for
                none.
        """
        (max_range, power), count = self._power, len(aimed.nodes)
        return Rays(
            aimed.origins,
            aimed.directions,
            np.full(count, max_range, np.float64),
            np.full(count, power, np.float64),
            np.zeros(count, np.uint8),
            np.full(count, carrier, np.int64),
            (self._ray_class,),
        )


@lru_cache(maxsize=64)
def pattern_of(settings: SensorSettings) -> BeamPattern:
    """Return the beams of a sensor; sensors of equal settings share them."""
    return BeamPattern(settings)


def ray_class_of(settings: SensorSettings) -> RayClass:
    """Return the ray class of a sensor, on which the effect of materials depends."""
    radar = settings.medium == "radar"
    return RayClass(
        RADAR if radar else LASER,
        BANDS_GHZ.index(settings.band_ghz) if radar else 0,
        settings.power_per_db,
        settings.max_bounces,
        glint=settings.glint,
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
    shape = len(offsets), len(angles)
    directions = np.zeros((*shape, 3))
    of_each = np.ascontiguousarray(np.broadcast_to(offsets, (*shape, 2)))
    engine.node_directions(angles, of_each, directions)
    return directions


def _nodes(settings: SensorSettings) -> tuple[Floats, Floats]:
    """Return the nodes' offsets to the left and up, (K, 1, 2) rad, and their weights.

    Random rays have zeros here: their offsets are drawn for each scan.
    """
    if settings.rays_per_beam == 1:
        return np.zeros((1, 1, 2)), np.ones(1)
    if settings.side_mode == "cone" and settings.cone_sampling == "random":
        count = settings.cone_rays
        return np.zeros((count, 1, 2)), np.full(count, 1 / count)
    if settings.side_mode == "cone":
        across, up = _deviations(settings)
        place = even_nodes if settings.cone_sampling == "even" else quadrature
        (left, left_share), (high, high_share) = map(place, settings.cone_grid)
        grid = np.meshgrid(left * across, high * up)
        offsets = np.stack([each.ravel() for each in grid], axis=-1)[:, None]
        return offsets, np.outer(high_share, left_share).ravel()
    weights = np.array(settings.ray_weights) / sum(settings.ray_weights)
    offsets = np.zeros((3, 1, 2))
    if settings.side_mode == "divergent":
        angle = offset_angle(settings.side_offset_uu, settings.divergence_distance)
        offsets[:, 0, 0] = -angle, 0.0, angle
    return offsets, weights


def quadrature(count: int) -> tuple[Floats, Floats]:
    """Return Gauss-Hermite nodes, in standard deviations, and weights that sum to 1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def even_nodes(count: int) -> tuple[Floats, Floats]:
    """Return evenly spaced nodes, in standard deviations, and weights that sum to 1."""
    if count == 1:
        return np.zeros(1), np.ones(1)
    nodes: Floats = np.linspace(-EVEN_EDGE, EVEN_EDGE, count)
    weights = np.exp(-(nodes**2) / 2)
    return nodes, weights / weights.sum()


def _deviations(settings: SensorSettings) -> tuple[float, float]:
    """Return the standard deviations of a cone across and up, rad."""
    across, up = settings.beamwidth_az_deg, settings.beamwidth_el_deg
    return (
        two_way_deviation(math.radians(across)),
        two_way_deviation(math.radians(up)),
    )


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
