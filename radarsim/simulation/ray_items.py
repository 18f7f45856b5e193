"""The items of a robot that cast rays and are no scanners: sonars and GPS.

The rays of all robots' items that are due in a tick are traced together.
"""

from collections.abc import Sequence
from typing import Protocol

from radarsim.geometry import Floats
from radarsim.presets.robots import Item
from radarsim.protocol import reports
from radarsim.protocol.fields import SensorReport
from radarsim.raycast.rays import Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.robots.robot import Robot
from radarsim.sensors.gps import Gps
from radarsim.sensors.sonar import SonarArray
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.items import Mounting


class RayItem(Protocol):
    """An item, or several that are due together, that reads by casting rays.

    Attributes:
        item: The item, or the first of them.
    """

    item: Item

    def rays(self) -> Rays:
        """Return its rays."""
        ...

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return the readings at a simulated time in s."""
        ...


class SonarItems:
    """All sonars of a robot."""

    def __init__(
        self,
        items: Sequence[Item],
        robot: Robot,
        config: SimulationConfig,
        *,
        carrier_id: int,
    ) -> None:
        """Create the sonars; ``carrier_id`` is the id of the robot's box."""
        self.item = items[0]
        self._robot = robot
        self._joined = config.dialect.joins_sonars
        self._names = [item.name for item in items]
        self._array = SonarArray(
            [item.mount for item in items],
            [config.sonar_settings(item) for item in items],
            carrier_id,
        )

    def rays(self) -> Rays:
        """Return the rays of all cones."""
        return self._array.rays(self._robot.body)

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return all ranges in one report, or one report for each sonar."""
        ranges = self._array.ranges(traces).tolist()
        named = tuple(zip(self._names, ranges, strict=True))
        if self._joined:
            return (reports.Sonar(time, named),)
        return tuple(reports.Sonar(time, (each,)) for each in named)


class GpsItem:
    """A GPS receiver."""

    def __init__(
        self, mounting: Mounting, origin: tuple[float, float], *, carrier_id: int
    ) -> None:
        """Create the receiver.

        Args:
            mounting: What items are created from.
            origin: Latitude and longitude of the map's origin, degrees.
            carrier_id: Id of the robot's box.
        """
        self.item = mounting.item
        self._robot = mounting.robot
        self._offset = mounting.item.mount.position()
        settings = mounting.config.gps_settings(mounting.item)
        self._gps = Gps(origin, settings, mounting.rng, carrier_id)

    def rays(self) -> Rays:
        """Return a ray to each satellite."""
        return self._gps.rays(self._place())

    def read(self, time: float, traces: Traces) -> tuple[SensorReport, ...]:
        """Return a reading."""
        fix = self._gps.fix(self._place(), traces)
        return (reports.Gps(time, self.item.name, fix.position, fix.satellites),)

    def _place(self) -> Floats:
        body = self._robot.body
        return body.position() + body.rotation() @ self._offset


def read_together(
    items: Sequence[RayItem], time: float, tracer: Tracer, boxes: Boxes
) -> list[tuple[SensorReport, ...]]:
    """Trace the rays of all items at once, and return the readings of each.

    Args:
        items: Items that are due.
        time: Simulated time, s.
        tracer: Tracer of the scene.
        boxes: Boxes of the robots.
    """
    if not items:
        return []
    batches = [item.rays() for item in items]
    traces = tracer.trace(Rays.concatenate(batches), boxes, incidence=True)
    pieces = traces.split([len(rays.max_range) for rays in batches])
    return [item.read(time, piece) for item, piece in zip(items, pieces, strict=True)]
