"""What vegetation absorbs from radar waves.

Theory of operation
===================
Leaves and twigs scatter and absorb; a beam loses so many dB for each metre of them.
Measured losses differ by a factor of seven between species, and by two between dry and
wet leaves. Between bands they grow as f^0.284, by the law that Weissberger fitted to
measurements from 0.23 to 95 GHz. That exponent converts a loss measured in one band to
another: bare and leafy pecan trees at 28.8 GHz, 0.75 and 2.5 dB/m, give a difference
of 2.34 dB/m at 80 GHz, where 2.16 was measured.

In deep woods the loss grows more slowly with depth, because scattered waves arrive too.
They arrive late and from other directions, so a radar counts them as clutter: the
engine keeps the slope of the first metres.

ITU-R P.833 has a law for one terminal in a wood, between 0.1 and 2.1 GHz: the loss
grows by so many dB a metre at first, and ends at a maximum that grows with frequency.

Sources: ITU-R P.833-9, equations 1 and 2 and table 1; M. Weissberger, an initial
critical summary of models for predicting the attenuation of radio waves by trees, 1982;
T. Rappaport and S. Deng, 73 GHz wideband millimeter-wave foliage and ground reflection
measurements, ICC 2015, and the measurements that they quote; J. Zavorka and others,
IEEE Access 2024, at 80 GHz.
"""

import math
from typing import Final

EXPONENT: Final = 0.284  # of frequency
LINEAR_DEPTH: Final = 14.0  # m; up to here the loss is proportional to depth


def weissberger(f_ghz: float, depth: float) -> float:
    """Return the one-way loss through trees, dB.

    Args:
        f_ghz: Frequency, 0.23 to 95.
        depth: Depth of the trees, m, up to 400.

    >>> round(weissberger(0.9, 100), 1), round(weissberger(2.4, 50), 1)
    (19.4, 17.0)
    """
    if depth < LINEAR_DEPTH:
        return float(0.45 * f_ghz**EXPONENT * depth)
    return float(1.33 * f_ghz**EXPONENT * depth**0.588)


def convert_band(db_per_m: float, measured_at_ghz: float, f_ghz: float) -> float:
    """Convert a loss measured in one band to another, dB/m.

    >>> round(convert_band(2.5, 28.8, 77), 2)
    3.31
    """
    return float(db_per_m * (f_ghz / measured_at_ghz) ** EXPONENT)


def p833(db_per_m: float, most: float, depth: float) -> float:
    """Return the one-way loss of a wood of some depth by ITU-R P.833, equation 1, dB.

    Args:
        db_per_m: Loss in the first metres.
        most: Loss of deep woods, dB.
        depth: m.
    """
    return most * -math.expm1(-depth * db_per_m / most)


def p833_most(f_ghz: float) -> float:
    """Return the loss of deep woods, dB: equation 2 for a forest near St Petersburg."""
    return float(1.37 * (1000 * f_ghz) ** 0.42)
