"""One scan, as users get it."""

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
    """One scan.

    Attributes:
        sensor: Name of the preset.
        pose: Of the sensor, map frame.
        angles: (N,) rad from the sensor's forward axis, counter-clockwise.
        ranges: (N,) m; inf where nothing came back, 0 where a laser is blinded.
        rays: (N,) on which ray the range came: -1 right, 0 centre, 1 left; None for a
            sensor without side rays.
        range_min: m; shorter ranges are given all the same.
        range_max: m.
        resolution: Angle between neighbouring beams, rad.
        cast: The rays that gave the ranges, (N,); of a beam without range one of its
            rays.
        find_echoes: Gives what ``echoes`` is.
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
        """The echoes that the sensor's ``return_mode`` keeps, one of a beam or all."""
        return self.find_echoes()

    def to_dict(self) -> dict[str, Any]:
        """Give numbers and lists that JSON can hold; None where nothing came back."""
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
