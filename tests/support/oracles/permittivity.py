"""What building materials reflect and absorb, computed from their permittivity.

Theory of operation
===================
ITU-R P.2040-3 gives the relative permittivity of a material as ``a f^b`` and its
conductivity as ``c f^d`` S/m, with f in GHz. Together they form one complex number,
whose imaginary part is 17.98 times the conductivity over f. From it, Fresnel's
equations give the reflectance of a smooth, infinitely thick block, and its square root,
the complex refractive index, gives the loss per metre.

The numbers hold up to 100 GHz, except for brick, which was measured up to 40 GHz:
beyond that the law makes it far too transparent.

Source: ITU-R P.2040-3, effects of building materials and structures on radiowave
propagation above about 100 MHz.
"""

import cmath
import math
from typing import Final, NamedTuple

SPEED_OF_LIGHT: Final = 299_792_458.0  # m/s


class Medium(NamedTuple):
    """A row of the table: permittivity ``a f^b``, conductivity ``c f^d`` S/m."""

    a: float
    b: float
    c: float
    d: float


P2040: Final = {
    "concrete": Medium(5.24, 0.0, 0.0462, 0.7822),
    "brick": Medium(3.91, 0.0, 0.0238, 0.16),
    "plasterboard": Medium(2.73, 0.0, 0.0085, 0.9395),
    "wood": Medium(1.99, 0.0, 0.0047, 1.0718),
    "glass": Medium(6.31, 0.0, 0.0036, 1.3394),
    "chipboard": Medium(2.58, 0.0, 0.0217, 0.78),
    "metal": Medium(1.0, 0.0, 1e7, 0.0),
}


def permittivity(medium: Medium, f_ghz: float) -> complex:
    """Return the complex relative permittivity; losses are its negative imaginary part.

    >>> permittivity(P2040["metal"], 17.98)
    (1-10000000j)
    """
    conductivity = medium.c * f_ghz**medium.d
    return complex(medium.a * f_ghz**medium.b, -17.98 * conductivity / f_ghz)


def reflectance(relative: complex) -> float:
    """Return the share of power that a smooth block reflects, met head-on.

    >>> round(reflectance(4.0), 4)
    0.1111
    """
    index = cmath.sqrt(relative)
    return abs((1 - index) / (1 + index)) ** 2


def bulk_loss(relative: complex, f_ghz: float) -> float:
    """Return the one-way loss inside the block, dB/m.

    >>> round(bulk_loss(permittivity(P2040["wood"], 24), 24))
    164
    """
    wavenumber = 2 * math.pi * f_ghz * 1e9 / SPEED_OF_LIGHT  # rad/m
    return 20 / math.log(10) * wavenumber * abs(cmath.sqrt(relative).imag)
