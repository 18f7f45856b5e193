"""GPS receivers, whose accuracy depends on the number of satellites in sight.

Theory of operation
===================
The satellites do not move. Satellites more than 5 degrees above the horizon of the
map's origin are candidates; one ray to each candidate tests whether it is hidden. With
at least four satellites in sight there is a fix: the true position plus a normally
distributed error north and east, which shrinks with the number of satellites.

North is x, east is -y. The earth is modelled as flat, with fixed lengths of a degree of
latitude and of longitude. The directions to the satellites use the flat model too, so
all computed elevations are too high.

Source: the GPS receiver of the original server, with its scales and errors, and its
satellite positions, rounded.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Final

import numpy as np
from pydantic import BaseModel

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import NotNegative
from radarsim.protocol.reports import Gps
from radarsim.raycast.rays import Outcome, Rays, Traces
from radarsim.sensors.sensor import Mounting, Sensor, sight_rays

METRES_PER_DEGREE: Final = (111_200.0, 71_670.0)  # latitude, longitude
LEAST_SATELLITES: Final = 4  # satellites required for a fix
LEAST_ELEVATION: Final = math.radians(5)
EARTH_RADIUS: Final = 6378.137  # km
REACH: Final = 2000.0  # m; length of rays to satellites, larger than every scene

# Latitude and longitude, degrees, and altitude, km, of each satellite.
# fmt: off
SATELLITES: Final = np.array(
    [
        (12.7, -18.2, 20287), (33.6, -95.9, 20050), (38.8, -155.2, 20198),
        (35.9, -162.8, 20632), (13.5, -176.9, 20414), (-9.0, 103.9, 20175),
        (-39.2, -162.0, 20058), (-48.6, -19.3, 20096), (-47.0, 160.3, 20123),
        (-21.1, 66.6, 20199), (-18.0, -107.6, 20238), (-13.6, 55.8, 20320),
        (3.6, 46.1, 20213), (8.9, 164.9, 20364), (30.8, 144.8, 19956),
        (53.7, -128.3, 20102), (55.2, -44.7, 20246), (51.5, 113.2, 20031),
        (50.4, 52.8, 20270), (27.5, 14.9, 20553), (22.4, -53.7, 20272),
        (13.2, -65.0, 19938), (-2.1, 112.2, 19893), (-11.5, -73.3, 20066),
        (-16.5, 40.7, 20318), (-42.0, 12.8, 20107), (-55.7, 78.2, 20720),
        (-51.0, -115.0, 20324), (50.7, -137.0, 20435), (47.9, 61.3, 20290),
        (-36.6, -93.7, 20010),
    ]
)
# fmt: on


class GpsSettings(BaseModel, extra="forbid", frozen=True):
    """All settings of a GPS receiver.

    Attributes:
        max_noise: Three standard deviations of the error with 4 satellites, m.
        min_noise: Three standard deviations of the error with 12 satellites, m.
    """

    max_noise: NotNegative
    min_noise: NotNegative


class GpsReceiver(Sensor, types=["GPS"]):
    """A GPS receiver, which reads latitude and longitude."""

    settings: ClassVar[type[BaseModel]] = GpsSettings

    def __init__(self, mounting: Mounting) -> None:
        """Find the satellites above the horizon of the map."""
        super().__init__(mounting)
        self._origin = mounting.scene.gps_origin
        self._noise: GpsSettings = mounting.settings
        self._offset = self.item.mount.position()
        directions = _directions(self._origin)
        starts = np.zeros_like(directions)
        self._aimed = sight_rays(starts, directions, REACH, self.robot.number)

    def rays(self) -> Rays:
        """Return a ray to each satellite above the horizon."""
        count = len(self._aimed.origins)
        return replace(self._aimed, origins=np.tile(self._place(), (count, 1)))

    def read(self, time: float, traces: Traces) -> Sequence[Gps]:
        """Return the measured position, or a report without a fix.

        A reading always draws two random numbers, with or without a fix, so a hidden
        satellite does not change later errors.
        """
        place, position = self._place(), None
        seen = int((traces.outcomes == Outcome.NOTHING).sum())
        north, east = self._rng.standard_normal(2) * self._sigma(seen)
        if seen >= LEAST_SATELLITES:
            latitude = self._origin[0] + (place[0] + north) / METRES_PER_DEGREE[0]
            longitude = self._origin[1] + (east - place[1]) / METRES_PER_DEGREE[1]
            position = float(latitude), math.remainder(longitude, 360.0)
        return [Gps(time, self.item.name, position, seen)]

    def _place(self) -> Floats:
        body = self.robot.body
        return body.position() + body.rotation() @ self._offset

    def _sigma(self, satellites: int) -> float:
        """Return the standard deviation of the error, m, for a number of satellites."""
        most, least = self._noise.max_noise, self._noise.min_noise
        size = most + (least - most) * (satellites - 4) / 8
        return max(0.0, size) / 3


def _directions(origin: tuple[float, float]) -> Floats:
    """Return unit vectors to the satellites above the horizon, (N, 3), map frame."""
    latitude, longitude, altitude = SATELLITES.T
    north = latitude - origin[0]
    east = np.remainder(longitude - origin[1] + 180.0, 360.0) - 180.0
    ahead = METRES_PER_DEGREE[0] * north
    left = -METRES_PER_DEGREE[1] * east
    vectors = np.column_stack([ahead, left, altitude * 1000.0])
    visible = vectors[_elevations(origin[0], east) > LEAST_ELEVATION]
    return np.asarray(visible / np.linalg.norm(visible, axis=1, keepdims=True))


def _elevations(latitude: float, east: Floats) -> Floats:
    """Return the elevation angles of all satellites, (N,) rad, on a round earth.

    Args:
        latitude: Latitude of the receiver, degrees.
        east: (N,) longitudes of the satellites relative to the receiver, degrees.
    """
    here, there = math.radians(latitude), np.radians(SATELLITES[:, 0])
    turn = np.cos(np.radians(east))
    apart = math.sin(here) * np.sin(there) + math.cos(here) * np.cos(there) * turn
    height = EARTH_RADIUS / (EARTH_RADIUS + SATELLITES[:, 2])
    return np.asarray(np.arctan2(apart - height, np.sqrt(1 - apart**2)))
