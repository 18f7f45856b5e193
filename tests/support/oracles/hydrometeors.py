"""What rain and fog absorb from radar waves and from light.

Theory of operation
===================
Rain attenuates a radar wave by k R^alpha dB/km, with R in mm/h; ITU-R P.838-3 has k and
alpha for horizontal and for vertical polarisation, and a rule for those between. For
light, drops are discs: the loss is Q times the sum of their areas. By Marshall and
Palmer, there are 8000 exp(-4.1 R^-0.21 D) drops in a cubic metre for each millimetre of
diameter D, so the sum of areas grows as R^0.63. Q is 2 for all that a drop removes from
a plane wave. Half of that is diffracted by an angle of wavelength over diameter, a
thousandth of a radian, and stays in a laser's beam: 1 is left.

Droplets of fog are far smaller than a radar's wave, and absorb in proportion to their
mass of water. ITU-R P.840 computes the loss for one gramme in a cubic metre from the
permittivity of water. The drops scatter light at angles too large for it to come back:
Q is 2.

Sources: ITU-R P.838-3 and P.840; J. Marshall and W. Palmer, the distribution of
raindrops with size, J. Meteor. 5, 1948.
"""

import math
from typing import Final, NamedTuple

DECIBEL: Final = 10 / math.log(10)  # dB of power for a factor of e
RAIN_EXPONENT: Final = 0.63  # of the areas of drops


class PowerLaw(NamedTuple):
    """Attenuation by rain: ``k`` R^``alpha`` dB/km, R in mm/h."""

    k: float
    alpha: float


def polarised(
    horizontal: PowerLaw, vertical: PowerLaw, tilt: float, elevation: float = 0.0
) -> PowerLaw:
    """Return the law for a polarisation between horizontal and vertical.

    Args:
        horizontal: The law for horizontal polarisation.
        vertical: The law for vertical polarisation.
        tilt: Of the polarisation, rad from the horizontal; pi/4 stands for circular
            polarisation, and for sensors whose polarisation is not known.
        elevation: Of the path, rad.

    >>> polarised(PowerLaw(1, 0.7), PowerLaw(3, 0.5), math.pi / 4)
    PowerLaw(k=2.0, alpha=0.55)
    """
    turn = math.cos(elevation) ** 2 * math.cos(2 * tilt)
    products = [law.k * law.alpha for law in (horizontal, vertical)]
    k = _between(horizontal.k, vertical.k, turn)
    return PowerLaw(k, _between(products[0], products[1], turn) / k)


def _between(horizontal: float, vertical: float, turn: float) -> float:
    return (horizontal + vertical + (horizontal - vertical) * turn) / 2


def rain_law_of_light(efficiency: float = 1.0) -> PowerLaw:
    """Return the law for light in rain with Marshall and Palmer's drops.

    Args:
        efficiency: Q, the extinction efficiency.

    >>> law = rain_law_of_light()
    >>> round(law.k, 3), law.alpha
    (0.792, 0.63)
    """
    drops, slope = 8000.0, 4.1  # 1/m^3/mm; 1/mm at 1 mm/h
    area = math.pi / 4 * drops * 2 / slope**3 * 1e-6  # m^2 in a cubic metre
    return PowerLaw(1000 * DECIBEL * efficiency * area, RAIN_EXPONENT)


def fog_attenuation(f_ghz: float, celsius: float) -> float:
    """Return the one-way loss in fog with one gramme of water in a cubic metre, dB/m.

    >>> round(1000 * fog_attenuation(77, 10), 4)
    3.1473
    """
    real, imaginary = _water_permittivity(f_ghz, 300 / (celsius + 273.15))
    eta = (2 + real) / imaginary
    return 0.819e-3 * f_ghz / (imaginary * (1 + eta**2))


def _water_permittivity(f_ghz: float, theta: float) -> tuple[float, float]:
    """Return both parts of the permittivity of water, which relaxes at two frequencies.

    Args:
        f_ghz: Frequency.
        theta: 300 K over the temperature.
    """
    static = 77.66 + 103.3 * (theta - 1)
    middle, fast = 0.0671 * static, 3.52
    first = 20.2 - 146 * (theta - 1) + 316 * (theta - 1) ** 2  # GHz
    steps = ((static - middle, first), (middle - fast, 39.8 * first))
    real = fast + sum(step / (1 + (f_ghz / at) ** 2) for step, at in steps)
    imaginary = sum(step * (f_ghz / at) / (1 + (f_ghz / at) ** 2) for step, at in steps)
    return real, imaginary
