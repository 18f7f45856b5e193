"""The scan of a radar or a laser."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from radarsim.geometry import Floats, Pose3
from radarsim.raycast.rays import Rays
from radarsim.sensors.beams import Sides
from radarsim.sensors.echoes import Echoes


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One scan of a radar or a laser.

    Attributes:
        sensor: Name of the preset.
        pose: Pose of the sensor, map frame.
        angles: (N,) directions of the beams from the sensor's forward axis, rad,
            counter-clockwise.
        ranges: (N,) m; inf where nothing was detected, 0 where a laser is blinded.
        rays: (N,) ray of its beam that gave each range: -1 right, 0 centre, 1 left;
            None for a sensor without side rays.
        range_min: Minimum range of the sensor, m; shorter ranges are not removed.
        range_max: Maximum range of the sensor, m.
        resolution: Angle between neighbouring beams, rad.
        cast: The N rays that gave the ranges; for a beam without range one of its rays.
        find_echoes: Computes ``echoes`` on demand.
    """

    sensor: str
    pose: Pose3
    angles: Floats
    ranges: Floats
    rays: Sides | None
    range_min: float
    range_max: float
    resolution: float
    cast: Rays = field(repr=False)
    find_echoes: Callable[[], Echoes] = field(repr=False)

    @property
    def echoes(self) -> Echoes:
        """The echoes that the sensor's ``return_mode`` keeps: one per beam, or all."""
        return self.find_echoes()

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as JSON types; None stands for a range without echo."""
        ranges = [r if math.isfinite(r) else None for r in self.ranges.tolist()]
        return {
            "sensor": self.sensor,
            "pose": list(self.pose.numbers()),
            "angle_min": float(self.angles[0]),
            "angle_increment": self.resolution,
            "range_min": self.range_min,
            "range_max": self.range_max,
            "ranges": ranges,
            "rays": None if self.rays is None else self.rays.tolist(),
            "echoes": self.echoes.to_lists(),
        }
