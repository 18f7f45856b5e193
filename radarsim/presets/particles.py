"""What smoke and dust take from radar waves and from light.

Theory of operation
===================
Grains far smaller than a wave absorb in proportion to their mass and to the frequency,
whatever their size (Rayleigh's law). So a radar, whose waves are millimetres long,
hardly sees dust of tens of micrometres, and smoke less.

Of light they cover what a disc of their size does, twice over, since what is bent round
them is lost too; the smaller they are, the more a gramme covers. Soot is smaller than
the wavelength of light, and covers less the longer that is: in inverse proportion.
What a gramme in a cubic metre takes is its mass extinction coefficient, m^2/g.

Source: any book on scattering by small particles.
"""

import math

from radarsim.presets.hydrometeors import DECIBEL
from radarsim.presets.permittivity import SPEED_OF_LIGHT


def cover(m2_per_g: float) -> float:
    """Give the loss that a mass extinction coefficient means, one way.

    Returns:
        dB in a metre with a gramme in each cubic metre.

    >>> round(cover(7.6), 1)
    33.0
    """
    return DECIBEL * m2_per_g


def grain_extinction(diameter: float, g_per_cm3: float) -> float:
    """Give the mass extinction coefficient of grains larger than the waves, m^2/g.

    Args:
        diameter: Of grains of one size, m.
        g_per_cm3: Of what they are made of.

    >>> round(grain_extinction(20e-6, 2.65), 4)
    0.0566
    """
    return 3 / (g_per_cm3 * 1e6 * diameter)


def grain_absorption(f_ghz: float, permittivity: complex, g_per_cm3: float) -> float:
    """Give the loss in grains far smaller than the waves, one way.

    Args:
        f_ghz: Frequency.
        permittivity: Of the grains; losses are its negative imaginary part.
        g_per_cm3: Of what they are made of.

    Returns:
        dB in a metre with a gramme in each cubic metre.

    >>> round(3 * grain_absorption(94, 4.5 - 0.25j, 2.65), 5)  # 3 g of dust
    0.00052
    """
    waves = 2 * math.pi * f_ghz * 1e9 / SPEED_OF_LIGHT  # rad/m
    polarised = ((permittivity - 1) / (permittivity + 2)).imag
    return DECIBEL * 3 * waves * abs(polarised) / (g_per_cm3 * 1e6)
