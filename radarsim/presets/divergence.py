"""How far beside a beam its side rays are, as an offset and as an angle.

Theory of operation
===================
N is an offset in Unreal units, 250 to the metre, and no angle: what it is as one
depends on the distance at which it holds. At D metres, rays N units to both sides are
``atan(N / (250 D))`` off the beam. So 50 units are 0.573 degrees at 20 m and 0.115
degrees at 100 m. Divergent rays hold that angle, and are N units off at D alone;
perpendicular and lateral ones hold N, and are at a smaller angle the farther they are.

An antenna is told by its beamwidth: the angle between the two directions in which it
sends half of its greatest power. Side rays in these directions are half a beamwidth
off. An antenna that sends and receives weighs each direction twice, so the beam that
counts is narrower. Three rays stand for it best where a Gauss-Hermite quadrature of
three nodes has them: the outer two at ``side_ray_at``, 0.52 beamwidths off, a sixth of
the weight each, and the centre with two thirds.

Sources: the noise model of a thesis on a radar for USARSim, section 4.3; USARSim's
scale of units; Gauss-Hermite quadrature, as in any book on numerical integration.
"""

import math
from typing import Final

METRES_PER_UNIT: Final = 1 / 250  # USARSim's scale of Unreal units


def offset_angle(side_offset_uu: float, distance: float) -> float:
    """Give the angle at which an offset is seen, rad.

    Args:
        side_offset_uu: N, Unreal units.
        distance: D, m, above 0.

    >>> round(math.degrees(offset_angle(50, 20)), 3)
    0.573
    """
    return math.atan(side_offset_uu * METRES_PER_UNIT / distance)


def offset_units(angle: float, distance: float) -> float:
    """Give the offset that is seen at an angle: N, Unreal units.

    Args:
        angle: rad, from the beam to a side ray.
        distance: D, m.

    >>> round(offset_units(math.radians(1.8) / 2, 100))
    393
    """
    return math.tan(angle) * distance / METRES_PER_UNIT


def two_way_deviation(beamwidth: float) -> float:
    """Give the standard deviation of a Gaussian beam, out and back together.

    Args:
        beamwidth: Between the half-power points on one way, in any unit, which is that
            of the result.

    >>> round(two_way_deviation(1.0), 4)
    0.3003
    """
    return beamwidth / (4 * math.sqrt(math.log(2)))


def side_ray_at(beamwidth: float) -> float:
    """Give the angle of the outer two of three rays that stand for a beam.

    Args:
        beamwidth: Between the half-power points on one way, in any unit, which is that
            of the result. Both ways together, the beam is a Gaussian.

    >>> round(side_ray_at(1.0), 4)
    0.5201
    """
    return math.sqrt(3) * two_way_deviation(beamwidth)
