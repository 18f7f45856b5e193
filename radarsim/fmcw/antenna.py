"""The antenna: how its power is spread over azimuth and elevation.

One-way patterns are relative to the middle of the beam. Across it is a Gaussian, up
and down too; below the horizon, where the Gaussian falls off, a fan may fill it in as a
squared cosecant. With it a point at a given depth below the antenna returns the same
power at all ranges.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

REACH = (
    1.25  # beamwidths from the middle to where the pattern is cut off; two-way, -38 dB
)
_STEPS = 20_001  # of the integral over elevation


def gaussian(angles: ArrayLike, beamwidth: float) -> Floats:
    """Return the one-way power of a Gaussian beam.

    Args:
        angles: Angles from the middle of the beam.
        beamwidth: Width between the half-power points, in the same unit.
    """
    return np.asarray(np.exp(-4 * math.log(2) * (np.asarray(angles) / beamwidth) ** 2))


def elevation_pattern(settings: FmcwSettings, elevations: ArrayLike) -> Floats:
    """Return the one-way power at elevations, rad, up from the horizon."""
    angles = np.asarray(elevations, np.float64)
    width = math.radians(settings.beamwidth_el_deg)
    power = gaussian(angles, width)
    if settings.fan_deg:
        edge = width / 2
        below = np.clip(-angles, edge, math.pi / 2)
        filled = 0.5 * (math.sin(edge) / np.sin(below)) ** 2
        is_fan = (angles < -edge) & (angles >= -math.radians(settings.fan_deg))
        power = np.where(is_fan, np.maximum(power, filled), power)
    return power


def elevation_limits(settings: FmcwSettings) -> tuple[float, float]:
    """Return the lower and the upper edge of the beam, rad."""
    upper = REACH * math.radians(settings.beamwidth_el_deg)
    return -max(upper, math.radians(settings.fan_deg)), upper


@lru_cache(maxsize=16)
def directivity(settings: FmcwSettings) -> float:
    """Return the gain in the middle of the beam; 16 ln 2 / (az el) without a fan."""
    low, high = -math.pi / 2, math.pi / 2
    elevations = np.linspace(low, high, _STEPS)
    height = float(elevation_pattern(settings, elevations).mean() * (high - low))
    # The integral of a Gaussian over all angles.
    across = math.radians(settings.beamwidth_az_deg) * math.sqrt(
        math.pi / (4 * math.log(2))
    )
    return 4 * math.pi / (across * height)


def rows_in_beam(settings: FmcwSettings) -> int:
    """Return how many directions to each side of a point see it in their main lobe."""
    width = math.radians(settings.beamwidth_az_deg)
    return max(math.ceil(1.5 * width / settings.step), 1)
