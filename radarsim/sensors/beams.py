"""Where the rays of a scan point, and which of a beam's three is cast.

Theory of operation
===================
A beam has three rays: right, centre and left. The side rays stand for the edges of a
beam that diverges, N Unreal units from its middle. Each scan draws one ray for each
beam, and only that one is cast.

Source: the noise model of a thesis on navigation with a radar in USARSim, section 4.3.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.presets.settings import SensorSettings
from radarsim.raycast.compiled import compiled

Draw: TypeAlias = NDArray[np.int8]

METRES_PER_UNIT: Final = 1 / 250  # USARSim's scale of Unreal units
RIGHT, CENTRE, LEFT = -1, 0, 1


@dataclass(frozen=True, slots=True)
class Fan:
    """The rays of one scan.

    Attributes:
        origins: (N, 3) m, map frame.
        directions: (N, 3) unit vectors, map frame.
    """

    origins: Floats
    directions: Floats


class BeamPattern:
    """Where the beams of a sensor are, seen from the sensor; worked out once.

    Attributes:
        angles: (N,) rad, counter-clockwise from the right.
        width: How far from the sensor a ray can start, m.
    """

    def __init__(self, settings: SensorSettings) -> None:
        self.angles = beam_angles(settings)
        offset = settings.side_offset_uu * METRES_PER_UNIT
        turn = math.atan(offset / settings.divergence_distance)
        divergent = settings.side_mode == "divergent"
        turns = (-turn, 0.0, turn) if divergent else (0.0, 0.0, 0.0)
        # (3, N, 3): the directions of all right, all centre and all left rays.
        self._directions = np.array([_level(self.angles + side) for side in turns])
        # (N, 3) m: from the sensor to the start of each left ray.
        self._to_left = np.zeros((len(self.angles), 3))
        if settings.side_mode == "perpendicular":
            self._to_left[:] = offset * _level(self.angles + math.pi / 2)
        elif settings.side_mode == "lateral":
            self._to_left[:, 1] = offset
        self.width = float(np.linalg.norm(self._to_left, axis=1).max())
        weights = np.array(settings.ray_weights) / sum(settings.ray_weights)
        self._edges = np.cumsum(weights)[:2]

    def draw(self, rng: np.random.Generator) -> Draw:
        """Draw a ray for each beam: (N,) of ``RIGHT``, ``CENTRE``, ``LEFT``."""
        chance = rng.random(len(self.angles))
        drawn: Draw = (chance >= self._edges[0]).astype(np.int8)
        drawn += chance >= self._edges[1]
        drawn -= 1
        return drawn

    def aim(self, pose: Pose3, sides: Draw) -> Fan:
        """Point one ray of each beam.

        Args:
            pose: Of the sensor, map frame.
            sides: (N,), which ray of each beam.
        """
        origins, directions = np.zeros((2, *self._to_left.shape))
        place, turn = pose.position(), pose.rotation()
        tables = (self._directions, self._to_left)
        _aim(tables, sides, place, turn, origins, directions)
        return Fan(origins, directions)


@compiled
def _aim(
    tables: Any, sides: Any, place: Any, turn: Any, origins: Any, directions: Any
) -> None:
    """Turn what the sensor sees into the map frame.

    Args:
        tables: (3, N, 3) directions of right, centre and left rays, and (N, 3) m the
            way to each left ray's start.
        sides: (N,), which ray of each beam.
        place: (3,) m, of the sensor.
        turn: (3, 3) from the sensor's frame to the map's.
        origins: (N, 3) to be filled.
        directions: (N, 3) to be filled.
    """
    ways, to_left = tables
    for i in range(len(sides)):
        side = sides[i]
        for row in range(3):
            start, way = 0.0, 0.0
            for column in range(3):
                start += turn[row, column] * to_left[i, column]
                way += turn[row, column] * ways[side + 1, i, column]
            origins[i, row] = place[row] + side * start
            directions[i, row] = way


def beam_angles(settings: SensorSettings) -> Floats:
    """Give the angles of the beams, (N,) rad, counter-clockwise from the right."""
    step = math.radians(settings.resolution_deg)
    first = -math.radians(settings.fov_deg) / 2
    angles: Floats = first + step * np.arange(settings.beams, dtype=np.float64)
    return angles


def _level(angles: Floats) -> Floats:
    """Give unit vectors in the plane of the scan, (N, 3)."""
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
