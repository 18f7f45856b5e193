"""What a radar reads of a plant with a wall behind it, and how that spreads."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plants.calibration import POWER
from radarsim.plants.forms import PlantForm
from radarsim.raycast.penetration import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracers import tracer_of
from radarsim.scene.scene import Part, Scene

HEIGHT: Final = 0.346  # m above the ground, of a P3AT's scanner
BEFORE: Final = 4.0  # m from where rays start to the middle of the plant
BEHIND: Final = 3.0  # m from there to the wall, which is across the rays
WALL: Final = BEFORE + BEHIND


@dataclass(frozen=True, slots=True)
class Spread:
    """How ranges are spread, in m.

    Attributes:
        mean: Of all.
        deviation: Standard deviation of all.
        percentiles: The 5th, the 50th and the 95th.
        at_one_offset: Standard deviation of those that pass the plant's middle at the
            same distance but come from different sides; the root of the mean square
            over all distances. 0 for what looks the same from all sides.
        spent: Standard deviation of those that end where foliage took the last of a
            ray's power; 0 if there are none.
        through: Share of the rays that read the wall.
    """

    mean: float
    deviation: float
    percentiles: tuple[float, float, float]
    at_one_offset: float
    spent: float
    through: float


@dataclass(frozen=True, eq=False)
class Reading:
    """The ranges of level rays through a plant at the height of a scanner.

    Attributes:
        offsets: (K,) m, how far to the left of the middle they pass.
        azimuths: (A,) rad, where they go.
        ranges: (A, K) m.
        spent: (A, K) whether foliage took the last of the ray's power.
    """

    offsets: Floats
    azimuths: Floats
    ranges: Floats
    spent: NDArray[np.bool_]

    def spread(self) -> Spread:
        """Give the numbers of the spread."""
        spent = self.ranges[self.spent]
        low, middle, high = np.percentile(self.ranges, [5, 50, 95]).tolist()
        return Spread(
            float(self.ranges.mean()),
            float(self.ranges.std()),
            (low, middle, high),
            float(np.sqrt(self.ranges.var(axis=0).mean())),
            float(spent.std()) if spent.size else 0.0,
            float(np.mean(self.ranges >= WALL)),
        )


def read_plant(
    form: PlantForm, parts: Sequence[Part], *, offsets: int = 101, azimuths: int = 120
) -> Reading:
    """Send parallel rays from all sides over the width of a crown on the origin.

    Args:
        form: Its crown says how wide the plant is at the scanner's height.
        parts: Of the plant.
        offsets: How many rays from each side.
        azimuths: From how many sides.
    """
    height = (HEIGHT - form.crown_centre) / form.crown_half_height
    width = form.crown_radius * math.sqrt(max(1 - height**2, 0.0))
    across = np.linspace(-width, width, offsets + 2)[1:-1]
    around = 2 * math.pi * np.arange(azimuths) / azimuths
    rays = _fan(across, around)
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    shape = (azimuths, offsets)
    ranges = np.minimum(traces.ranges, WALL).reshape(shape)
    spent = (traces.outcomes == Outcome.SPENT).reshape(shape)
    return Reading(across, around, ranges, spent)


def _fan(offsets: Floats, azimuths: Floats) -> Rays:
    """Give rays, side by side, in order of azimuths and then of offsets."""
    turn = np.repeat(azimuths, len(offsets))
    beside = np.tile(offsets, len(azimuths))[:, None]
    level = np.zeros(len(turn))
    ways = np.column_stack([np.cos(turn), np.sin(turn), level])
    left = np.column_stack([-np.sin(turn), np.cos(turn), level])
    starts = beside * left - BEFORE * ways + np.array([0.0, 0.0, HEIGHT])
    return Rays.alike(starts, ways, reach=WALL, power=POWER)
