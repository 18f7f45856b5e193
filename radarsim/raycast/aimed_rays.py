"""Aim the rays of sensors: from nodes in the sensor's frame to rays in the map frame.

A beam has one or several nodes, from each of which a ray can be cast: one is drawn at
random for each beam, or all are cast. Scans are aimed before they are traced, by
``aim_scans``, or ray by ray while they are traced; the numbers are the same.
"""

from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats
from radarsim.raycast.rays import RayClass, RayColumns, Rays

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

    def pack(self) -> Packed:
        """Pack the table for the engine."""
        return engine.structures["NodeTable"].pack(
            directions=np.ascontiguousarray(self.directions),
            starts=np.ascontiguousarray(self.starts),
            edges=np.ascontiguousarray(self.edges),
            sides=self.sides,
        )


NO_TABLE: Final = NodeTable(
    np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), np.zeros(0), np.zeros(0, np.int8)
)


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


def aim_scans(
    poses: Floats, choice: int, chances: Floats, *columns: NDArray[Any]
) -> None:
    """Select the rays of scans, and transform them to the map frame.

    Args:
        poses: (J, 6) x, y, z, roll, pitch, yaw of the sensor in each scan, map frame.
        choice: ``DRAWN``, ``ALL`` or ``GIVEN``.
        chances: (J, N) random numbers from 0 to 1; not read unless ``DRAWN``.
        columns: The NodeTable, and then the AimedRays to be filled, as many for each
            beam; its nodes are read if they are ``GIVEN``.

    Raises:
        EngineError: If the lengths of the arrays do not belong together.
    """
    table = NodeTable(*columns[:4]).pack()
    poses = np.ascontiguousarray(poses)
    engine.aim_scans(table, poses, choice, chances, *columns[4:])


def pack_source(rays: RayColumns, table: NodeTable, radius: float = 0.0) -> Packed:
    """Pack rays for the engine.

    Args:
        rays: The rays; for scans one row with what their rays have in common.
        table: The nodes of all beams of the sensor; empty for given rays.
        radius: m, the largest distance from the sensor at which a ray starts.
    """
    structure = engine.structures["RaySource"]
    return structure.pack(
        origins=np.ascontiguousarray(rays.origins),
        directions=np.ascontiguousarray(rays.directions),
        max_range=np.ascontiguousarray(rays.max_range),
        power=np.ascontiguousarray(rays.power),
        class_index=np.ascontiguousarray(rays.class_index),
        carrier=np.ascontiguousarray(rays.carrier_id),
        table=table.pack(),
        radius=radius,
    )


class SensorRays:
    """The rays of a sensor before they are aimed.

    Attributes:
        table: The nodes of all N beams.
        limits: Range, power and class of all rays in one row; origins and directions
            are empty.
        ray_classes: The class of the rays, and that of which something has to be near a
            sensor for its scan to be left out: the medium's, as in ``DEFAULT_CLASSES``.
        rays_per_scan: M.
        source: The rays, packed for the engine.
    """

    def __init__(
        self,
        table: NodeTable,
        radius: float,
        limits: RayColumns,
        ray_classes: tuple[RayClass, RayClass],
        rays_per_scan: int,
    ) -> None:
        """Pack the rays; ``radius`` is as of ``pack_source``, the others are above."""
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
        aim_scans(self.places[:, :6], choice, self.chances, *sensor.table, *aimed)
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
