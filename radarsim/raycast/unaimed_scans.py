"""Scans whose rays are aimed while they are traced."""

from typing import Any, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.raycast.aimed_rays import ALL, DRAWN, AimedRays, NodeTable, aim_scans
from radarsim.raycast.ray_source import pack_source
from radarsim.raycast.rays import RayClass, RayColumns, Rays


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
        columns: list[Any] = [column[rows] for column in sensor.limits[2:]]
        return Rays(*[aimed.origins, aimed.directions, *columns, sensor.ray_classes])
