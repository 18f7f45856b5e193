"""What smoke and dust absorb from radar waves and from light.

Theory of operation
===================
Grains far smaller than a wave absorb in proportion to their mass and to the frequency,
of any size (Rayleigh's law). So a radar, whose waves are millimetres long,
hardly sees dust of tens of micrometres, and smoke even less.

From light, larger grains remove twice what a disc of their size covers, because
diffracted light is lost too; the smaller the grains, the more a gramme covers. Soot is
smaller than the wavelength of light, and its loss is inversely proportional to the
wavelength. The loss for one gramme in a cubic metre is the mass extinction coefficient,
m^2/g.

Source: any book on scattering by small particles.
"""

import math

from oracles.permittivity import SPEED_OF_LIGHT

DECIBEL = 10 / math.log(10)  # dB of power for a factor of e


def extinction_in_db(m2_per_g: float) -> float:
    """Convert a mass extinction coefficient to a one-way loss.

    Returns:
        dB/m for one gramme in each cubic metre.

    >>> round(extinction_in_db(7.6), 1)
    33.0
    """
    return DECIBEL * m2_per_g


def grain_extinction(diameter: float, g_per_cm3: float) -> float:
    """Return the mass extinction coefficient of grains larger than the waves, m^2/g.

    Args:
        diameter: Diameter of the grains, all of one size, m.
        g_per_cm3: Density of the grains' substance.

    >>> round(grain_extinction(20e-6, 2.65), 4)
    0.0566
    """
    return 3 / (g_per_cm3 * 1e6 * diameter)


def grain_absorption(f_ghz: float, permittivity: complex, g_per_cm3: float) -> float:
    """Return the one-way loss in grains far smaller than the waves.

    Args:
        f_ghz: Frequency.
        permittivity: Of the grains; losses are its negative imaginary part.
        g_per_cm3: Density of the grains' substance.

    Returns:
        dB/m for one gramme in each cubic metre.

    >>> round(3 * grain_absorption(94, 4.5 - 0.25j, 2.65), 5)  # 3 g of dust
    0.00052
    """
    wavenumber = 2 * math.pi * f_ghz * 1e9 / SPEED_OF_LIGHT  # rad/m
    polarised = ((permittivity - 1) / (permittivity + 2)).imag
    return DECIBEL * 3 * wavenumber * abs(polarised) / (g_per_cm3 * 1e6)
