"""The rays of a scan: origins, directions, and the choice of rays that are traced.

Theory of operation
===================
A beam has one or several rays, its nodes. Three nodes, right, centre and left, sample
the edges and the middle of a diverging beam, N Unreal units apart. A cone has any
number of nodes, over the horizontal and vertical width of a beam.

The power of a beam falls off with the angle like a Gaussian, once on transmission and
once on reception: if ``w`` is the angle between the one-way half-power points, the
two-way pattern has the standard deviation w / (4 sqrt(ln 2)) = 0.3003 w. Quadrature
uses Gauss-Hermite nodes, in a grid if the beam is wide in both directions. Three nodes
in a row are at 0 and +-0.5201 w with weights 2/3 and 1/6: the main ray and two side
rays. For a smooth target, n nodes in a row are exact to the order 2n - 1. At an edge,
the error of three nodes is at most 1/3 of the beam, if the edge is at the main ray; it
falls with more nodes. Even nodes are equally spaced over 0.6 widths to either side,
where the Gaussian has 95 % of its power, and weighted by its density, so no object
wider than one step is missed. Random rays are drawn from that Gaussian and have equal
weights.

Either one ray of each beam is drawn, with the weights as probabilities, or all rays are
traced.

Source: the noise model of a thesis on navigation with a radar in USARSim, section 4.3;
the cone follows the proposal in its section 7.
"""

import math
from functools import lru_cache
from typing import Any, Final

import numpy as np

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensor_settings import (
    BANDS_GHZ,
    METRES_PER_UNIT,
    SensorSettings,
    offset_angle,
    two_way_deviation,
)
from radarsim.raycast.rays import LASER, RADAR, Nodes, RayClass, Rays, Sides

RIGHT, CENTRE, LEFT = -1, 0, 1
# Methods of numpy's ``Generator`` that draw random numbers.
UNIFORM: Final = np.random.Generator.random
NORMAL: Final = np.random.Generator.standard_normal
EXPONENTIAL: Final = np.random.Generator.standard_exponential
CENTRE_TOLERANCE: Final = 1e-9  # rad; rays at smaller angles are centre rays
EVEN_EDGE: Final = 0.6 * 4 * math.sqrt(math.log(2))  # 0.6 w in standard deviations


class BeamPattern:
    """The beams and rays that all sensors with the same settings share.

    Attributes:
        settings: The settings.
        angles: (N,) azimuths of the beams, rad, counter-clockwise from the right.
        radius: Largest distance from the sensor at which a ray starts, m.
        has_random_rays: Whether each scan draws random rays, instead of fixed nodes.
        weights: (K,) share of each node in its beam; equal for random rays.
        rays: Number of rays of each beam that are traced.
        shares: (M,) share of each ray of a scan in its beam.
        ray_classes: The class of the rays, and the default class of the sensor type,
            which decides whether a surface hides a ray's start.
        selects_ray: Whether one ray of each beam is selected after all are traced.
        needs_events: Whether the events along the rays are needed.
        kinds: Name, generator method and shape of each kind of random numbers of a
            scan, in the order in which they are drawn.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.settings = settings
        self.angles = beam_angles(settings)
        self._offsets, self.weights = _nodes(settings)
        starts = _starts(settings, self.angles)
        self.radius = float(np.linalg.norm(starts, axis=2).max())
        is_cone = settings.has_side_rays and settings.side_mode == "cone"
        self.has_random_rays = is_cone and settings.cone_sampling == "random"
        sides = _sides(self._offsets)
        # The three rays may be parallel, so their angles do not show which ray is on
        # which side.
        if settings.side_mode != "cone" and len(self.weights) == 3:
            sides = np.array([RIGHT, CENTRE, LEFT], np.int8)
        self._table = engine.structures["NodeTable"].pack(
            directions=node_directions(self.angles, self._offsets),
            starts=starts,
            # The last edge, which is 1 up to rounding, is left out: a random number
            # above it would select a node that does not exist.
            edges=np.cumsum(self.weights)[:-1],
            sides=sides,
        )
        ray_class = ray_class_of(settings)
        self.ray_classes = ray_class, RayClass(ray_class.medium)
        self._source = self._pack_source(self._table)
        self._set_what_is_read()

    def _set_what_is_read(self) -> None:
        settings, beams = self.settings, len(self.angles)
        is_whole = settings.combines_rays
        self.rays = len(self.weights) if is_whole or settings.incidence_weights else 1
        self.shares = np.tile(self.weights, beams) if self.rays > 1 else np.ones(beams)
        self.selects_ray = self.rays > 1 and not is_whole
        self.needs_events = (
            settings.return_mode != "last"
            or settings.range_resolution > 0
            or (self.rays > 1 and is_whole)
        )
        self.kinds: list[tuple[str, Any, tuple[int, ...]]] = []
        if self.has_random_rays:
            self.kinds.append(("rays", NORMAL, (self.rays, beams, 2)))
        elif self.rays < len(self.weights):
            self.kinds.append(("nodes", UNIFORM, (beams,)))
        if self.selects_ray:
            self.kinds.append(("selected", UNIFORM, (beams,)))
        if settings.range_noise > 0 or settings.range_noise_share > 0:
            self.kinds.append(("errors", NORMAL, (beams,)))

    def source(self, drawn: Floats | None) -> Packed:
        """Return the packed ``RaySource`` of a scan.

        Args:
            drawn: (K, N, 2) angles of random rays to the left and up, in standard
                deviations; None for a sensor with nodes, whose scans share one source.
        """
        if drawn is None:
            return self._source
        return self._pack_source(self._drawn_nodes(drawn))

    def aim(
        self, pose: Pose3, carrier_id: int, nodes: Nodes, drawn: Floats | None = None
    ) -> Rays:
        """Return the rays of a scan, exactly equal to the rays that the engine traces.

        Args:
            pose: Pose of the sensor, map frame.
            carrier_id: Id of the box that carries the sensor; -1 for none.
            nodes: (M,) index of each ray's node in its beam.
            drawn: As in ``source``.
        """
        table = self._table if drawn is None else self._drawn_nodes(drawn)
        count = len(self.angles)
        beams = np.repeat(np.arange(count), len(nodes) // count)
        starts = table.starts[nodes if len(table.starts) > 1 else 0, beams]
        rotation = pose.rotation()
        return Rays.uniform(
            pose.position() + _turned(starts, rotation),
            _turned(table.directions[nodes, beams], rotation),
            max_range=self.settings.max_range,
            power=self.settings.penetration_power,
            carrier_id=carrier_id,
            ray_classes=self.ray_classes[:1],
        )

    def aim_side(self, pose: Pose3, side: int) -> Rays:
        """Return one ray of each beam, even if it starts behind a surface.

        Args:
            pose: Pose of the sensor, map frame.
            side: -1 for the right ray, 0 for the centre ray, 1 for the left ray.

        Raises:
            ValueError: If the beams do not have three rays.
        """
        (matching,) = np.nonzero(self._table.sides == side)
        if self.has_random_rays or len(matching) != 1 or len(self.weights) > 3:
            raise ValueError(f"no ray {side}, expected beams of three rays")
        nodes = np.full(len(self.angles), matching[0], np.int16)
        return self.aim(pose, -1, nodes)

    def sides_of(self, drawn: Floats) -> Sides:
        """Return -1 for random rays on the right of a beam, 1 left, 0 centre, (M,)."""
        return _sides(self._angles_of(drawn)).T.ravel()

    def _angles_of(self, drawn: Floats) -> Floats:
        """Return the angles of random rays to the left and up, (K, N, 2) rad."""
        return drawn * _deviations(self.settings)

    def _drawn_nodes(self, drawn: Floats) -> Packed:
        """Return the table of ray directions for a scan with random directions."""
        directions = node_directions(self.angles, self._angles_of(drawn))
        return self._table.structure.pack(
            **self._table.fields | {"directions": directions}
        )

    def _pack_source(self, table: Packed) -> Packed:
        """Pack the table of ray directions, and the settings that all rays share."""
        settings = self.settings
        return engine.structures["RaySource"].pack(
            origins=np.zeros((0, 3)),
            directions=np.zeros((0, 3)),
            max_range=np.array([settings.max_range], np.float64),
            power=np.array([settings.penetration_power], np.float64),
            class_index=np.zeros(1, np.uint8),
            carrier=np.full(1, -1),
            table=table,
            radius=self.radius,
        )


@lru_cache(maxsize=64)
def pattern_of(settings: SensorSettings) -> BeamPattern:
    """Return the beam pattern of a sensor; sensors with equal settings share it."""
    return BeamPattern(settings)


def ray_class_of(settings: SensorSettings) -> RayClass:
    """Return the ray class of a sensor, which determines how materials affect rays."""
    radar = settings.medium == "radar"
    return RayClass(
        RADAR if radar else LASER,
        BANDS_GHZ.index(settings.band_ghz) if radar else 0,
        settings.power_per_db,
        settings.max_bounces,
        glint=settings.glint,
    )


def beam_angles(settings: SensorSettings) -> Floats:
    """Return the azimuths of the beams, (N,) rad, counter-clockwise from the right."""
    step = math.radians(settings.resolution_deg)
    first = -math.radians(settings.fov_deg) / 2
    angles: Floats = first + step * np.arange(settings.beams, dtype=np.float64)
    return angles


def node_directions(angles: Floats, offsets: Floats) -> Floats:
    """Return the directions of the rays of each beam, sensor frame.

    Args:
        angles: (N,) azimuths of the beams, rad.
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
    """Return the azimuths and elevations, rad, and the weights of a beam's K rays.

    The offsets of random rays are 0 here, since they are drawn for each scan.
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
    """Return Gauss-Hermite nodes, in standard deviations, and their weights (sum 1)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def even_nodes(count: int) -> tuple[Floats, Floats]:
    """Return evenly spaced nodes, in standard deviations, and Gaussian weights."""
    if count == 1:
        return np.zeros(1), np.ones(1)
    nodes: Floats = np.linspace(-EVEN_EDGE, EVEN_EDGE, count)
    weights = np.exp(-(nodes**2) / 2)
    return nodes, weights / weights.sum()


def _turned(vectors: Floats, rotation: Floats) -> Floats:
    """Return (N, 3) vectors rotated by a (3, 3) matrix, with 0.0 instead of -0.0."""
    x, y, z = vectors.T
    rows = [x * row[0] + y * row[1] + z * row[2] + 0.0 for row in rotation]
    return np.column_stack(rows)


def _deviations(settings: SensorSettings) -> tuple[float, float]:
    """Return a beam's standard deviations in azimuth and elevation, rad."""
    across, up = settings.beamwidth_az_deg, settings.beamwidth_el_deg
    return (
        two_way_deviation(math.radians(across)),
        two_way_deviation(math.radians(up)),
    )


def _starts(settings: SensorSettings, angles: Floats) -> Floats:
    """Return the ray origins, sensor frame, (3, N, 3) m, or (1, N, 3) if all are 0."""
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
    """Return -1 for rays on the right side of a beam, 1 for left, 0 for the centre."""
    across = offsets[..., 0]
    sides = np.where(np.abs(across) < CENTRE_TOLERANCE, 0.0, np.sign(across)).astype(
        np.int8
    )
    return sides[:, 0] if offsets.shape[1] == 1 else sides
