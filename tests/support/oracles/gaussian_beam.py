"""Where three rays stand best for a Gaussian beam: Gauss-Hermite quadrature."""

import math

from radarsim.presets.sensor_settings import two_way_deviation


def side_ray_angle(beamwidth: float) -> float:
    """Return the angle of the outer two of three quadrature nodes.

    They carry a sixth of the weight each, the centre ray two thirds.

    Args:
        beamwidth: Between the one-way half-power points, in any unit, which is the
            unit of the result.

    >>> round(side_ray_angle(1.0), 4)
    0.5201
    """
    return math.sqrt(3) * two_way_deviation(beamwidth)
