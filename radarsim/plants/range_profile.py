"""Ranges that a radar measures of a plant with a wall behind it, and statistics."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plants.parameters import PlantParameters
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import Part, Scene

POWER: Final = 1.0  # initial power of rays
HEIGHT: Final = 0.346  # m above the ground, of a P3AT's scanner
BEFORE: Final = 4.0  # m from the rays' starts to the centre of the plant
BEHIND: Final = 3.0  # m from there to the wall, which is normal to the rays
WALL: Final = BEFORE + BEHIND


@dataclass(frozen=True, slots=True)
class RangeStatistics:
    """Statistics of ranges, in m.

    Attributes:
        mean: Mean of all ranges.
        deviation: Standard deviation of all ranges.
        percentiles: The 5th, the 50th and the 95th percentile.
        at_one_offset: Standard deviation of ranges at the same distance from the
            plant's centre but from different directions; the root of the mean square
            over all distances. 0 for a plant that looks the same from all sides.
        spent: Standard deviation of the ranges of rays that lost all their power in
            foliage; 0 if there are none.
        through: Share of the rays that measure the wall.
    """

    mean: float
    deviation: float
    percentiles: tuple[float, float, float]
    at_one_offset: float
    spent: float
    through: float


@dataclass(frozen=True, eq=False)
class PlantRanges:
    """Ranges of horizontal rays through a plant at the height of a scanner.

    Attributes:
        offsets: (K,) m, of the rays to the left of the plant's centre.
        azimuths: (A,) rad, directions of the rays.
        ranges: (A, K) m.
        spent: (A, K) whether the ray lost all its power in foliage.
    """

    offsets: Floats
    azimuths: Floats
    ranges: Floats
    spent: NDArray[np.bool_]

    def statistics(self) -> RangeStatistics:
        """Return the statistics of the ranges."""
        spent = self.ranges[self.spent]
        low, median, high = np.percentile(self.ranges, [5, 50, 95]).tolist()
        return RangeStatistics(
            float(self.ranges.mean()),
            float(self.ranges.std()),
            (low, median, high),
            float(np.sqrt(self.ranges.var(axis=0).mean())),
            float(spent.std()) if spent.size else 0.0,
            float(np.mean(self.ranges >= WALL)),
        )


def measure_plant(
    parameters: PlantParameters,
    parts: Sequence[Part],
    *,
    offsets: int = 101,
    azimuths: int = 120,
) -> PlantRanges:
    """Measure ranges of parallel rays from all sides over the width of a crown.

    Args:
        parameters: The plant's parameters; the crown defines its width at the scanner's
            height.
        parts: The plant, at the origin.
        offsets: Number of rays in each direction.
        azimuths: Number of directions.
    """
    height = (HEIGHT - parameters.crown_centre) / parameters.crown_half_height
    width = parameters.crown_radius * math.sqrt(max(1 - height**2, 0.0))
    across = np.linspace(-width, width, offsets + 2)[1:-1]
    directions = 2 * math.pi * np.arange(azimuths) / azimuths
    rays = _parallel_rays(across, directions)
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    shape = (azimuths, offsets)
    ranges = np.minimum(traces.ranges, WALL).reshape(shape)
    spent = (traces.outcomes == Outcome.SPENT).reshape(shape)
    return PlantRanges(across, directions, ranges, spent)


def _parallel_rays(offsets: Floats, azimuths: Floats) -> Rays:
    """Return parallel rays, in order of azimuths and then of offsets."""
    azimuth = np.repeat(azimuths, len(offsets))
    offset = np.tile(offsets, len(azimuths))[:, None]
    level = np.zeros(len(azimuth))
    forward = np.column_stack([np.cos(azimuth), np.sin(azimuth), level])
    left = np.column_stack([-np.sin(azimuth), np.cos(azimuth), level])
    starts = offset * left - BEFORE * forward + np.array([0.0, 0.0, HEIGHT])
    return Rays.uniform(starts, forward, max_range=WALL, power=POWER)
