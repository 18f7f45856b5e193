"""Convert between the offset of a beam's side rays, an angle, and a beamwidth.

Theory of operation
===================
The setting ``side_offset_uu``, N, is an offset in Unreal units, 250 to the metre, not
an angle: the angle depends on the distance at which the offset holds. At D metres, rays
N units to either side are ``atan(N / (250 D))`` off the beam. So 50 units are 0.573
degrees at 20 m and 0.115 degrees at 100 m. Divergent rays keep that angle, and are N
units off at D only; perpendicular and lateral rays keep the offset N, and the angle at
which it appears shrinks with distance.

An antenna is specified by its beamwidth: the angle between the two directions in which
it radiates half of its peak power. Side rays in these directions are half a beamwidth
off. An antenna that sends and receives weighs each direction twice, so the effective
beam is narrower: a Gaussian with the standard deviation ``two_way_deviation``.

Sources: the noise model of a thesis on a radar for USARSim, section 4.3; USARSim's
scale of units.
"""

import math
from typing import Final

METRES_PER_UNIT: Final = 1 / 250  # USARSim's scale of Unreal units


def offset_angle(side_offset_uu: float, distance: float) -> float:
    """Return the angle at which an offset appears, rad.

    Args:
        side_offset_uu: N, Unreal units.
        distance: D, m, above 0.

    >>> round(math.degrees(offset_angle(50, 20)), 3)
    0.573
    """
    return math.atan(side_offset_uu * METRES_PER_UNIT / distance)


def offset_units(angle: float, distance: float) -> float:
    """Return the offset that appears at an angle: N, Unreal units.

    Args:
        angle: Angle between the beam and a side ray, rad.
        distance: D, m.

    >>> round(offset_units(math.radians(1.8) / 2, 100))
    393
    """
    return math.tan(angle) * distance / METRES_PER_UNIT


def two_way_deviation(beamwidth: float) -> float:
    """Return the standard deviation of a Gaussian beam, transmit and receive combined.

    Args:
        beamwidth: Between the one-way half-power points, in any unit, which is the
            unit of the result.

    >>> round(two_way_deviation(1.0), 4)
    0.3003
    """
    return beamwidth / (4 * math.sqrt(math.log(2)))
