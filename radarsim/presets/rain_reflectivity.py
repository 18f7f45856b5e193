"""The radar cross section of rain.

The reflectivities are those of rain with Marshall and Palmer's drop sizes, by Mie's
theory, computed for this project at 24, 77 and 94 GHz. Between the tabulated rates the
reflectivity is a power of the rain rate.
"""

from typing import Final

import numpy as np

RATES: Final = (1.0, 5.0, 12.5, 25.0, 50.0, 100.0)  # mm/h
REFLECTIVITY_DB: Final = (  # radar cross section per volume, dB(m^2/m^3), by band
    (-53.4, -43.0, -37.5, -33.7, -30.2, -27.0),
    (-39.3, -33.6, -30.9, -29.0, -27.2, -25.5),
    (-38.8, -33.7, -31.2, -29.5, -27.8, -26.2),
)


def rain_reflectivity(band: int, mm_per_h: float) -> float:
    """Return the radar cross section of a cubic metre of rain, m^2/m^3.

    Args:
        band: Index into ``BANDS_GHZ``.
        mm_per_h: Rate of the rain; outside 1 to 100 the law is extrapolated.

    >>> round(rain_reflectivity(1, 25), 5)
    0.00126
    """
    if mm_per_h <= 0:
        return 0.0
    rates, decibels = np.log10(RATES), np.array(REFLECTIVITY_DB[band])
    rate = np.log10(mm_per_h)
    i = int(np.clip(np.searchsorted(rates, rate) - 1, 0, len(rates) - 2))
    slope = (decibels[i + 1] - decibels[i]) / (rates[i + 1] - rates[i])
    return float(10 ** ((decibels[i] + slope * (rate - rates[i])) / 10))
