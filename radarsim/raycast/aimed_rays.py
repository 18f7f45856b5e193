"""Aim the rays of sensors: from nodes in the sensor's frame to rays in the map frame.

A beam has one or several nodes, from each of which a ray can be cast: one is drawn at
random for each beam, or all are cast. Scans are aimed before they are traced, by
``aim_scans``, or ray by ray while they are traced, see ``trace_kernel``; the numbers
are the same.
"""

from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.raycast.intersect import pointer
from radarsim.raycast.rays import RayClass, RayColumns, Rays
from radarsim.raycast.traced_scene import PackedArrays, Words, pack

Sides: TypeAlias = NDArray[np.int8]
Nodes: TypeAlias = NDArray[np.int16]

# Which nodes are aimed: those that random numbers select, all of each beam, or those
# that are given.
DRAWN, ALL, GIVEN = range(3)
NO_CHANCES: Final = np.zeros((1, 0))


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


class Frame(NamedTuple):
    """The frame of a sensor in the map frame.

    Attributes:
        position: (3,) m.
        rotation: (3, 3) from the sensor frame to the map frame.
    """

    position: Floats
    rotation: Floats


@njit_inline
def node_of(edges: Floats, chance: float) -> int:
    """Return the node that a random number selects: how many edges it has reached."""
    low, high = 0, len(edges)
    while low < high:
        middle = (low + high) // 2
        # An edge itself belongs to the node after it, as in ``numpy.searchsorted`` from
        # the right.
        if edges[middle] <= chance:
            low = middle + 1
        else:
            high = middle
    return low


@njit_inline
def fill_frame(poses: Floats, scan: int, frame: Frame) -> None:
    """Set a frame to a pose; see ``geometry.rotation_matrix``, which it equals."""
    # Written out in the same order as there: scans in batches and alone agree bit by
    # bit.
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
def aim_ray(
    table: NodeTable,
    frame: Frame,
    beam: Int,
    node: Int,
    origin: Floats,
    direction: Floats,
) -> None:
    """Transform the ray of a node of a beam to the map frame.

    Args:
        table: The ``NodeTable``.
        frame: The ``Frame`` of the sensor.
        beam: Number of the beam.
        node: Number of its node.
        origin: (3,) m, to be filled.
        direction: (3,) unit vector, to be filled.
    """
    starts, directions = table.starts, table.directions
    first = node if starts.shape[0] > 1 else 0
    sx, sy, sz = starts[first, beam, 0], starts[first, beam, 1], starts[first, beam, 2]
    dx, dy = directions[node, beam, 0], directions[node, beam, 1]
    dz = directions[node, beam, 2]
    for row in range(3):
        x, y, z = frame.rotation[row, 0], frame.rotation[row, 1], frame.rotation[row, 2]
        # The sums begin with 0.0, so that none of them is -0.0.
        origin[row] = frame.position[row] + (0.0 + x * sx + y * sy + z * sz)
        direction[row] = 0.0 + x * dx + y * dy + z * dz


@njit_inline
def _aim_scan(
    table: NodeTable, frame: Frame, choice: int, chances: Floats, rays: AimedRays
) -> None:
    """Aim the rays of one scan; arguments as in ``aim_scans``.

    The loop is here and not there, where it would count references to the arrays (row a
    of the benchmarks).
    """
    beams, i = table.directions.shape[1], 0
    rays_per_beam = len(rays.nodes) // max(beams, 1)
    for beam in range(beams):
        for ray in range(rays_per_beam):
            if choice == DRAWN:
                rays.nodes[i] = node_of(table.edges, chances[i])
            elif choice == ALL:
                rays.nodes[i] = ray
            node = np.int64(rays.nodes[i])
            rays.sides[i] = table.sides[node]
            aim_ray(table, frame, beam, node, rays.origins[i], rays.directions[i])
            i += 1


@njit_cached
def aim_scans(
    poses: Floats, choice: int, chances: Floats, *columns: NDArray[Any]
) -> None:
    """Select the rays of scans, and transform them to the map frame.

    Columns come one by one: numba takes twice as long to unpack tuples of arrays.

    Args:
        poses: (J, 6 or more) x, y, z, roll, pitch, yaw of the sensor in each scan, map
            frame.
        choice: ``DRAWN``, ``ALL`` or ``GIVEN``.
        chances: (J, N) random numbers from 0 to 1; not read unless ``DRAWN``.
        columns: The NodeTable, and then the AimedRays to be filled, as many for each
            beam; its nodes are read if they are ``GIVEN``.
    """
    table, rays = NodeTable(*columns[:4]), AimedRays(*columns[4:])
    frame, each = Frame(np.zeros(3), np.zeros((3, 3))), len(rays.nodes) // len(poses)
    for scan in range(len(poses)):
        some = slice(scan * each, (scan + 1) * each)
        fill_frame(poses, scan, frame)
        own = AimedRays(
            rays.nodes[some],
            rays.sides[some],
            rays.origins[some],
            rays.directions[some],
        )
        _aim_scan(table, frame, choice, chances[scan if choice == DRAWN else 0], own)


NO_TABLE: Final = NodeTable(
    np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), np.zeros(0), np.zeros(0, np.int8)
)


class RaySource(NamedTuple):
    """Where the rays of a call come from.

    Attributes:
        rays: The rays; for scans one row with what their rays have in common.
        table: The nodes of all beams of the sensor; empty for given rays.
        radius: m, the largest distance from the sensor at which a ray starts.
    """

    rays: RayColumns
    table: NodeTable
    radius: float


SOURCE_DTYPES: Final = "f8 f8 f8 f8 u1 i8 f8 f8 f8 i1 f8"


def pack_source(
    rays: RayColumns, table: NodeTable = NO_TABLE, radius: float = 0.0
) -> PackedArrays:
    """Pack a source; arguments as the attributes of ``RaySource``."""
    return pack([*rays, *table, np.array([radius])], SOURCE_DTYPES)


@njit_cached
def unpack_source(words: Words) -> RaySource:
    """Return the source of the words of a packed one, in the order of its arrays."""
    rays = RayColumns(
        carray(pointer(words[0, 0]), (words[0, 1], words[0, 2]), np.float64),
        carray(pointer(words[1, 0]), (words[1, 1], words[1, 2]), np.float64),
        carray(pointer(words[2, 0]), words[2, 1], np.float64),
        carray(pointer(words[3, 0]), words[3, 1], np.float64),
        carray(pointer(words[4, 0]), words[4, 1], np.uint8),
        carray(pointer(words[5, 0]), words[5, 1], np.int64),
    )
    nodes = words[6, 1], words[6, 2], words[6, 3]
    starts = words[7, 1], words[7, 2], words[7, 3]
    table = NodeTable(
        carray(pointer(words[6, 0]), nodes, np.float64),
        carray(pointer(words[7, 0]), starts, np.float64),
        carray(pointer(words[8, 0]), words[8, 1], np.float64),
        carray(pointer(words[9, 0]), words[9, 1], np.int8),
    )
    return RaySource(rays, table, carray(pointer(words[10, 0]), 1, np.float64)[0])


class SensorRays:
    """The rays of a sensor before they are aimed.

    Attributes:
        table: The nodes of all N beams.
        limits: Range, power and class of all rays in one row; origins and directions
            are empty.
        ray_classes: The class of the rays, and that of which something has to be near a
            sensor for its scan to be left out: the medium's, as in ``DEFAULT_CLASSES``.
        rays_per_scan: M.
        source: The packed ``RaySource``.
    """

    def __init__(
        self,
        table: NodeTable,
        radius: float,
        limits: RayColumns,
        ray_classes: tuple[RayClass, RayClass],
        rays_per_scan: int,
    ) -> None:
        """Pack the rays; ``radius`` is as in ``RaySource``, the others are above."""
        self.table, self.limits = table, limits
        self.ray_classes = ray_classes
        self.rays_per_scan = rays_per_scan
        self.source = pack_source(limits, table, radius)


class UnaimedScans(NamedTuple):
    """J scans of equal sensors.

    Attributes:
        sensor: What they have in common.
        chances: (J, N) random numbers from 0 to 1, which select a node of each beam;
            (1, 0) if all are aimed.
        places: (J, 7) x, y, z, roll, pitch, yaw of the sensor in each, map frame, and
            the id of the box that carries it; -1 for none.
    """

    sensor: SensorRays
    chances: Floats
    places: Floats

    def aim(self) -> Rays:
        """Return the rays of all scans."""
        sensor = self.sensor
        aimed = AimedRays.empty(len(self.places) * sensor.rays_per_scan)
        choice = DRAWN if self.chances.size else ALL
        aim_scans(self.places, choice, self.chances, *sensor.table, *aimed)
        rows = np.zeros(len(aimed.nodes), np.int64)
        return Rays(
            aimed.origins,
            aimed.directions,
            sensor.limits.max_range[rows],
            sensor.limits.power[rows],
            sensor.limits.class_index[rows],
            sensor.limits.carrier_id[rows],
            sensor.ray_classes,
        )
