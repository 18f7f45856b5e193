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
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensors import SensorSettings

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


def beam_angles(settings: SensorSettings) -> Floats:
    """Give the angles of the beams, (N,) rad, counter-clockwise from the right."""
    step = math.radians(settings.resolution_deg)
    first = -math.radians(settings.fov_deg) / 2
    angles: Floats = first + step * np.arange(settings.beams, dtype=np.float64)
    return angles


def draw_rays(settings: SensorSettings, rng: np.random.Generator) -> Draw:
    """Draw a ray for each beam: (N,) of ``RIGHT``, ``CENTRE``, ``LEFT``."""
    weights = np.array(settings.ray_weights)
    edges = np.cumsum(weights / weights.sum())
    drawn = np.searchsorted(edges, rng.random(settings.beams), side="right")
    return (np.minimum(drawn, 2) - 1).astype(np.int8)


def aim(settings: SensorSettings, pose: Pose3, sides: Draw) -> Fan:
    """Point one ray of each beam.

    Args:
        settings: Of the sensor.
        pose: Of the sensor, map frame.
        sides: (N,), which ray of each beam.
    """
    angles = beam_angles(settings)
    offset = settings.side_offset_uu * METRES_PER_UNIT * sides
    if settings.side_mode == "divergent":
        angles = angles + np.arctan(offset / settings.divergence_distance)
    directions = np.column_stack(
        [np.cos(angles), np.sin(angles), np.zeros(len(angles))]
    )
    starts = np.zeros_like(directions)
    if settings.side_mode == "perpendicular":
        starts[:, 0] = -directions[:, 1] * offset
        starts[:, 1] = directions[:, 0] * offset
    elif settings.side_mode == "lateral":
        starts[:, 1] = offset
    turn = pose.rotation().T
    return Fan(pose.position() + starts @ turn, _unit(directions @ turn))


def _unit(vectors: Floats) -> Floats:
    units: Floats = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return units
