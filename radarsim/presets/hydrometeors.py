"""What rain and fog take from radar waves and from light.

Theory of operation
===================
Rain takes k R^alpha dB from a radar wave in a kilometre, with R in mm/h; ITU-R P.838-3
has k and alpha for horizontal and for vertical waves, and a rule for those between. To
light, drops are discs: it loses Q times the sum of their areas. By Marshall and Palmer,
there are 8000 exp(-4.1 R^-0.21 D) drops in a cubic metre for each millimetre of
diameter D, so the sum of areas grows as R^0.63. Q is 2 for all that a drop takes from a
plane wave. Half of that is bent round it by an angle of wavelength over diameter, a
thousandth of a radian, and stays in a laser's beam: 1 is left.

Droplets of fog are far smaller than a radar's wave, and take in proportion to the water
that they hold. ITU-R P.840 computes from the permittivity of water what a gramme of it
in a cubic metre takes. The drops bend light by too much for it to come back: Q is 2.

Sources: ITU-R P.838-3 and P.840; J. Marshall and W. Palmer, the distribution of
raindrops with size, J. Meteor. 5, 1948.
"""

import math
from typing import Final, NamedTuple

DECIBEL: Final = 10 / math.log(10)  # of power, to a factor of e
RAIN_EXPONENT: Final = 0.63  # of the areas of drops


class PowerLaw(NamedTuple):
    """Loss in rain: ``k`` R^``alpha`` dB/km, R in mm/h."""

    k: float
    alpha: float


def rain_attenuation(law: PowerLaw, mm_per_h: float) -> float:
    """Give the loss in rain, one way, dB/m.

    >>> law = PowerLaw(0.22106804, 0.95320005)  # 29 GHz
    >>> round(1000 * rain_attenuation(law, 26.48052), 6)
    5.021802
    """
    return float(law.k * mm_per_h**law.alpha / 1000)


def polarised(
    horizontal: PowerLaw, vertical: PowerLaw, tilt: float, elevation: float = 0.0
) -> PowerLaw:
    """Give the law for a wave between horizontal and vertical.

    Args:
        horizontal: The law for horizontal waves.
        vertical: That for vertical ones.
        tilt: Of the polarisation, rad from the horizontal; pi/4 stands for circular
            ones, and for sensors of which it is not known.
        elevation: Of the path, rad.

    >>> polarised(PowerLaw(1, 0.7), PowerLaw(3, 0.5), math.pi / 4)
    PowerLaw(k=2.0, alpha=0.55)
    """
    turn = math.cos(elevation) ** 2 * math.cos(2 * tilt)
    over = [law.k * law.alpha for law in (horizontal, vertical)]
    k = _between(horizontal.k, vertical.k, turn)
    return PowerLaw(k, _between(over[0], over[1], turn) / k)


def _between(horizontal: float, vertical: float, turn: float) -> float:
    return (horizontal + vertical + (horizontal - vertical) * turn) / 2


def rain_law_of_light(efficiency: float = 1.0) -> PowerLaw:
    """Give the law for light in rain of Marshall and Palmer's drops.

    Args:
        efficiency: Q.

    >>> law = rain_law_of_light()
    >>> round(law.k, 3), law.alpha
    (0.792, 0.63)
    """
    drops, slope = 8000.0, 4.1  # 1/m^3/mm; 1/mm at 1 mm/h
    area = math.pi / 4 * drops * 2 / slope**3 * 1e-6  # m^2 in a cubic metre
    return PowerLaw(1000 * DECIBEL * efficiency * area, RAIN_EXPONENT)


def fog_attenuation(f_ghz: float, celsius: float) -> float:
    """Give the loss in fog with a gramme of water in a cubic metre, one way, dB/m.

    >>> round(1000 * fog_attenuation(77, 10), 4)
    3.1473
    """
    real, imaginary = _water(f_ghz, 300 / (celsius + 273.15))
    eta = (2 + real) / imaginary
    return 0.819e-3 * f_ghz / (imaginary * (1 + eta**2))


def _water(f_ghz: float, theta: float) -> tuple[float, float]:
    """Give the permittivity of water; it relaxes at two frequencies."""
    still = 77.66 + 103.3 * (theta - 1)
    between, fast = 0.0671 * still, 3.52
    first = 20.2 - 146 * (theta - 1) + 316 * (theta - 1) ** 2  # GHz
    steps = ((still - between, first), (between - fast, 39.8 * first))
    real = fast + sum(step / (1 + (f_ghz / at) ** 2) for step, at in steps)
    imaginary = sum(step * (f_ghz / at) / (1 + (f_ghz / at) ** 2) for step, at in steps)
    return real, imaginary
