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
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.jit import njit_cached
from radarsim.presets.divergence import (
    METRES_PER_UNIT,
    offset_angle,
    two_way_deviation,
)
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import LASER, RADAR, RayClass

Sides: TypeAlias = NDArray[np.int8]
Nodes: TypeAlias = NDArray[np.int16]

RIGHT, CENTRE, LEFT = -1, 0, 1
CENTRE_TOLERANCE: Final = 1e-9  # rad off the middle of a beam


@dataclass(frozen=True, slots=True)
class BeamRays:
    """The rays of one scan, beam by beam.

    Attributes:
        origins: (M, 3) m, map frame.
        directions: (M, 3) unit vectors, map frame.
    """

    origins: Floats
    directions: Floats


class SampledRays(NamedTuple):
    """The rays of one scan, sensor frame.

    Attributes:
        nodes: (M,) node of its beam that each ray is.
        sides: (M,) side of its beam: -1 right, 0 centre, 1 left.
        directions: (K, N, 3) unit vectors of all nodes of all beams.
    """

    nodes: Nodes
    sides: Sides
    directions: Floats


class NodeTable(NamedTuple):
    """Starts and directions of all nodes of all beams, sensor frame.

    Attributes:
        directions: (K, N, 3) unit vectors.
        starts: (K, N, 3) m, or (1, N, 3) if all nodes of a beam start at one point.
    """

    directions: Floats
    starts: Floats


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
        self._offsets, self.weights = _nodes(settings)
        self._deviations = _random_deviations(settings)
        self._starts = _starts(settings, self.angles)
        self._directions = node_directions(self.angles, self._offsets)
        self._node_sides = _sides(self._offsets)
        # Three rays may differ in their starts only, not in their angles.
        if settings.side_mode != "cone" and len(self.weights) == 3:
            self._node_sides = np.array([RIGHT, CENTRE, LEFT], np.int8)
        self.radius = float(np.linalg.norm(self._starts, axis=2).max())
        # The last edge is 1 but for rounding; without it no draw can lie beyond it.
        self._edges = np.cumsum(self.weights)[:-1]
        traces_all = settings.combines_rays or settings.incidence_weights
        self.rays = len(self.weights) if traces_all else 1
        self.is_random = self._deviations is not None or self.rays < len(self.weights)
        beams = len(self.angles)
        self._all_nodes = np.tile(np.arange(self.rays, dtype=np.int16), beams)

    def sample(self, rng: np.random.Generator | None) -> SampledRays:
        """Sample the rays of one scan; ``rng`` is unused if ``is_random`` is False."""
        if self._deviations is not None and rng is not None:
            return self._sample_random(rng, self._deviations)
        if self.rays == len(self.weights) or rng is None:
            nodes = self._all_nodes
        else:
            nodes = self._draw_nodes(rng)
        return SampledRays(nodes, self._node_sides.take(nodes), self._directions)

    def _draw_nodes(self, rng: np.random.Generator) -> Nodes:
        chance = rng.random(len(self.angles))
        if len(self._edges) > 2:
            return np.searchsorted(self._edges, chance, side="right").astype(np.int16)
        # The same as the search, for beams of three rays: two comparisons.
        nodes: Nodes = (chance >= self._edges[0]).astype(np.int16)
        for edge in self._edges[1:]:
            nodes += chance >= edge
        return nodes

    def _sample_random(
        self, rng: np.random.Generator, deviations: Floats
    ) -> SampledRays:
        """Draw the angles of random rays, as many for each beam as are traced."""
        offsets = rng.standard_normal((self.rays, len(self.angles), 2)) * deviations
        sides = _sides(offsets).T.ravel()
        return SampledRays(
            self._all_nodes, sides, node_directions(self.angles, offsets)
        )

    def replace_by_centre(
        self, sampled: SampledRays, rows: NDArray[np.int64]
    ) -> SampledRays:
        """Replace side rays of three-ray beams by the centre ray."""
        nodes, sides = sampled.nodes.copy(), sampled.sides.copy()
        nodes[rows] = 1  # the middle one of three
        sides[rows] = CENTRE
        return SampledRays(nodes, sides, sampled.directions)

    def one_side(self, side: int) -> SampledRays:
        """Return one ray of each beam, on one side of three.

        Raises:
            ValueError: If the beams do not have three rays.
        """
        matching = np.flatnonzero(self._node_sides == side)
        if self._deviations is not None or len(matching) != 1 or len(self.weights) > 3:
            raise ValueError(f"ray {side}, expected a beam of three rays")
        nodes = np.full(len(self.angles), matching[0], np.int16)
        return SampledRays(nodes, self._node_sides[nodes], self._directions)

    def aim(self, pose: Pose3, sampled: SampledRays) -> BeamRays:
        """Transform the rays of a scan to the map frame.

        Args:
            pose: Pose of the sensor, map frame.
            sampled: Rays sampled by this pattern.
        """
        origins, directions = np.zeros((2, len(sampled.nodes), 3))
        table = NodeTable(sampled.directions, self._starts)
        position, rotation = pose.position(), pose.rotation()
        _aim(table, sampled.nodes, position, rotation, origins, directions)
        return BeamRays(origins, directions)


@njit_cached
def _aim(
    table: Any,
    nodes: Any,
    position: Any,
    rotation: Any,
    origins: Any,
    directions: Any,
) -> None:
    """Transform rays from the sensor frame to the map frame.

    Args:
        table: NodeTable of the beams.
        nodes: (M,) node of each ray, as many for each beam.
        position: (3,) position of the sensor, m.
        rotation: (3, 3) from the sensor frame to the map frame.
        origins: (M, 3) to be filled.
        directions: (M, 3) to be filled.
    """
    rays_per_beam = len(nodes) // table.directions.shape[1]
    separate_starts = table.starts.shape[0] > 1
    for i in range(len(nodes)):
        beam, node = i // rays_per_beam, nodes[i]
        start_node = node if separate_starts else 0
        for row in range(3):
            start, direction = 0.0, 0.0
            for column in range(3):
                turn = rotation[row, column]
                start += turn * table.starts[start_node, beam, column]
                direction += turn * table.directions[node, beam, column]
            origins[i, row] = position[row] + start
            directions[i, row] = direction


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
