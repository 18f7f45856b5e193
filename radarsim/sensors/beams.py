"""What the rays of a sensor are to a scene."""

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


def ray_class_of(settings: SensorSettings) -> RayClass:
    """Tell what the rays of a sensor have in common."""
    radar = settings.medium == "radar"
    return RayClass(
        RADAR if radar else LASER,
        BANDS_GHZ.index(settings.band_ghz) if radar else 0,
        settings.power_per_db,
        settings.max_bounces,
    )


# Section from sensors.beams.
# Where the rays of a scan point, and which of a beam's rays are cast.
#
# Theory of operation
# ===================
# A beam has several rays, its nodes. Three of them, right, centre and left, stand for
# the
# edges and the middle of a beam that diverges, N Unreal units apart. A cone has as
# many
# as one likes, over a beam that is wide across and up and down.
#
# The power of a beam falls off with the angle like a Gaussian, on the way out and
# once
# more on the way back: if ``w`` is the angle between the half-power points on one
# way,
# both ways together have the standard deviation w / (4 sqrt(ln 2)) = 0.3003 w. The
# nodes
# of a quadrature are those of Gauss and Hermite, a grid of them where the beam is
# wide in
# both directions. Three across stand at 0 and 0.5201 w with weights 2/3 and 1/6: the
# main
# ray and two side rays. Over what is smooth, n nodes in a row are exact to the order
# 2n - 1; over an edge three are off by at most 1/3 of the beam, where the edge runs
# through the main ray, and more by less. Random rays are spread by that Gaussian and
# weigh the same.
#
# Either one ray of each beam is drawn, by the nodes' weights, or all are cast.
#
# Source: the noise model of a thesis on navigation with a radar in USARSim, section
# 4.3;
# and, for the cone, what it proposes in section 7.

Sides: TypeAlias = NDArray[np.int8]
Nodes: TypeAlias = NDArray[np.int16]

RIGHT, CENTRE, LEFT = -1, 0, 1
AXIS: Final = 1e-9  # rad; a ray this near to its beam's middle is on no side


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
    """The rays of one scan, seen from the sensor.

    Attributes:
        nodes: (M,) which node of its beam each ray is.
        sides: (M,) -1 right of its beam's middle, 0 on it, 1 left.
        ways: (K, N, 3) unit vectors of all nodes of all beams.
    """

    nodes: Nodes
    sides: Sides
    ways: Floats


class BeamPattern:
    """Where the beams of a sensor are, seen from the sensor; worked out once.

    Attributes:
        angles: (N,) rad, counter-clockwise from the right.
        width: How far from the sensor a ray can start, m.
        draws: Whether there is anything to draw.
        weights: (K,) the share of each node in its beam; of random rays all the same.
        rays: How many rays of each beam are cast.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.angles = beam_angles(settings)
        self._offsets, self.weights = _nodes(settings)
        self._spread = _spread(settings)
        self._starts = _starts(settings, self.angles)
        self._ways = ways_of(self.angles, self._offsets)
        self._node_sides = _sides(self._offsets)
        if settings.side_mode != "cone" and len(self.weights) == 3:
            self._node_sides = np.array([RIGHT, CENTRE, LEFT], np.int8)
        self.width = float(np.linalg.norm(self._starts, axis=2).max())
        self._edges = np.cumsum(self.weights)[:-1]
        all_of_them = settings.combines_rays or settings.incidence_weights
        self.rays = len(self.weights) if all_of_them else 1
        self.draws = self._spread is not None or self.rays < len(self.weights)
        beams = len(self.angles)
        self._every = np.tile(np.arange(self.rays, dtype=np.int16), beams)

    def draw(self, rng: np.random.Generator | None) -> SampledRays:
        """Draw the rays of one scan; nothing is drawn where all of them are cast."""
        if self._spread is not None and rng is not None:
            return self._draw_spread(rng, self._spread)
        if self.rays == len(self.weights) or rng is None:
            nodes = self._every
        else:
            nodes = self._draw_nodes(rng)
        return SampledRays(nodes, self._node_sides.take(nodes), self._ways)

    def _draw_nodes(self, rng: np.random.Generator) -> Nodes:
        chance = rng.random(len(self.angles))
        if len(self._edges) > 2:
            return np.searchsorted(self._edges, chance, side="right").astype(np.int16)
        nodes: Nodes = (chance >= self._edges[0]).astype(np.int16)
        for edge in self._edges[1:]:
            nodes += chance >= edge
        return nodes

    def _draw_spread(self, rng: np.random.Generator, spread: Floats) -> SampledRays:
        """Draw the angles of random rays, so many for each beam as are cast."""
        offsets = rng.standard_normal((self.rays, len(self.angles), 2)) * spread
        sides = _sides(offsets).T.ravel()
        return SampledRays(self._every, sides, ways_of(self.angles, offsets))

    def centred(self, drawn: SampledRays, rows: NDArray[np.int64]) -> SampledRays:
        """Let the centre ray take the place of some of three."""
        nodes, sides = drawn.nodes.copy(), drawn.sides.copy()
        nodes[rows] = 1
        sides[rows] = CENTRE
        return SampledRays(nodes, sides, drawn.ways)

    def only(self, side: int) -> SampledRays:
        """Give one ray of each beam, on one side of three.

        Raises:
            ValueError: If the beams do not have three rays.
        """
        found = np.flatnonzero(self._node_sides == side)
        if self._spread is not None or len(found) != 1 or len(self.weights) > 3:
            raise ValueError(f"ray {side}, expected a beam of three rays")
        nodes = np.full(len(self.angles), found[0], np.int16)
        return SampledRays(nodes, self._node_sides[nodes], self._ways)

    def aim(self, pose: Pose3, drawn: SampledRays) -> BeamRays:
        """Point the rays of a scan.

        Args:
            pose: Of the sensor, map frame.
            drawn: By this pattern.
        """
        origins, directions = np.zeros((2, len(drawn.nodes), 3))
        place, turn = pose.position(), pose.rotation()
        _aim((drawn.ways, self._starts), drawn.nodes, place, turn, origins, directions)
        return BeamRays(origins, directions)


@njit_cached
def _aim(
    tables: Any, nodes: Any, place: Any, turn: Any, origins: Any, directions: Any
) -> None:
    """Turn what the sensor sees into the map frame.

    Args:
        tables: (K, N, 3) the directions of all nodes, and (K, N, 3) m the way to their
            starts, or (1, N, 3) where all start in one place.
        nodes: (M,), the node of each ray; of each beam there are as many.
        place: (3,) m, of the sensor.
        turn: (3, 3) from the sensor's frame to the map's.
        origins: (M, 3) to be filled.
        directions: (M, 3) to be filled.
    """
    ways, starts = tables
    of_a_beam = len(nodes) // ways.shape[1]
    apart = starts.shape[0] > 1
    for i in range(len(nodes)):
        beam, node = i // of_a_beam, nodes[i]
        first = node if apart else 0
        for row in range(3):
            start, way = 0.0, 0.0
            for column in range(3):
                start += turn[row, column] * starts[first, beam, column]
                way += turn[row, column] * ways[node, beam, column]
            origins[i, row] = place[row] + start
            directions[i, row] = way


def beam_angles(settings: SensorSettings) -> Floats:
    """Give the angles of the beams, (N,) rad, counter-clockwise from the right."""
    step = math.radians(settings.resolution_deg)
    first = -math.radians(settings.fov_deg) / 2
    angles: Floats = first + step * np.arange(settings.beams, dtype=np.float64)
    return angles


def ways_of(angles: Floats, offsets: Floats) -> Floats:
    """Give the directions of the nodes, seen from the sensor.

    Args:
        angles: (N,) rad, of the beams.
        offsets: (K, N, 2) or (K, 1, 2) rad: how far to the left and up each node is.

    Returns:
        (K, N, 3) unit vectors.
    """
    ways = np.zeros((len(offsets), len(angles), 3))
    _fill_ways(angles, offsets, ways)
    return ways


@njit_cached
def _fill_ways(angles: Any, offsets: Any, ways: Any) -> None:
    of_each = offsets.shape[1] > 1
    for k in range(len(offsets)):
        for i in range(len(angles)):
            offset = offsets[k, i if of_each else 0]
            across, level = angles[i] + offset[0], np.cos(offset[1])
            ways[k, i, 0] = level * np.cos(across)
            ways[k, i, 1] = level * np.sin(across)
            ways[k, i, 2] = np.sin(offset[1])


def _nodes(settings: SensorSettings) -> tuple[Floats, Floats]:
    """Give how far to the left and up the nodes are, (K, 1, 2) rad, and their shares.

    Of random rays only their number is known before they are drawn.
    """
    if settings.rays_per_beam == 1:
        return np.zeros((1, 1, 2)), np.ones(1)
    if settings.side_mode == "cone":
        return _cone_nodes(settings)
    weights = np.array(settings.ray_weights) / sum(settings.ray_weights)
    offsets = np.zeros((3, 1, 2))
    if settings.side_mode == "divergent":
        turn = offset_angle(settings.side_offset_uu, settings.divergence_distance)
        offsets[:, 0, 0] = -turn, 0.0, turn
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
    """Give nodes, in standard deviations, and weights of a Gaussian; these sum to 1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def _spread(settings: SensorSettings) -> Floats | None:
    """Give the standard deviations of random rays, (2,) rad across and up."""
    cone = settings.has_side_rays and settings.side_mode == "cone"
    if not cone or settings.cone_sampling != "random":
        return None
    widths = settings.beamwidth_az_deg, settings.beamwidth_el_deg
    return np.array([two_way_deviation(math.radians(width)) for width in widths])


def _starts(settings: SensorSettings, angles: Floats) -> Floats:
    """Give where the rays start, (3, N, 3) m, or (1, N, 3) if all in one place."""
    offset = settings.side_offset_uu * METRES_PER_UNIT
    to_left = np.zeros((len(angles), 3))
    if settings.has_side_rays and settings.side_mode == "perpendicular":
        to_left[:] = offset * ways_of(angles + math.pi / 2, np.zeros((1, 1, 2)))[0]
    elif settings.has_side_rays and settings.side_mode == "lateral":
        to_left[:, 1] = offset
    if not to_left.any():
        return to_left[None]
    return np.array([RIGHT * to_left, CENTRE * to_left, LEFT * to_left])


def _sides(offsets: Floats) -> Sides:
    """Say on which side of their beams rays are: (K,) or (K, N) of (K, 1 or N, 2)."""
    across = offsets[..., 0]
    sides = np.where(np.abs(across) < AXIS, 0.0, np.sign(across)).astype(np.int8)
    return sides[:, 0] if offsets.shape[1] == 1 else sides
