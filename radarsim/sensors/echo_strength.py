"""What comes back of each event along rays.

Theory of operation
===================
The strength of an echo is its power as a share of what comes back from a rough wall
that the whole beam meets head-on, with nothing before it. Penetration power counts
decibels one way; the sensor's margin is what a beam can lose out and back. So of a ray
that has a share p of its power left, T = 10^(-margin (1 - p) / 10) would come back. An
opaque surface returns the T of what is left there; a volume the difference between its
two sides, and a sheet that before and behind it. Where volumes overlap, each is
credited with its share of the loss, in proportion to density. This holds for plants,
which scatter a fifth of what they take, before walls that return a tenth of what
arrives: the strengths of a ray that ends within range then add up to 1, and what does
not come back from the wall comes back from what is before it. What has another albedo
returns more or less than plants, and smoke nothing. A beam of unlimited power is
returned whole by what it hits. Power lost to the air, or to a volume around the ray's
start, returns no echo: there is no boundary.

A volume answers all along the ray's way through it, and its echo has one range: up to
there half of its power has come back. A sensor that keeps first echoes triggers on
their leading edge instead, which is where the ray enters.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings

NOTHING_LEFT: Final = 1e-12  # share of a ray's power


class Densities(NamedTuple):
    """Power that rays lose per metre, and what returns of it.

    Attributes:
        parts: (P,) Power lost per metre in each part of the scene.
        air: Power lost per metre in the air.
        scattering: (P,) what each part scatters of a loss, relative to foliage.
    """

    parts: Floats
    air: float
    scattering: Floats


class ReturnLaw(NamedTuple):
    """How a ray's power determines what comes back.

    Attributes:
        full: Power with which a ray starts.
        nepers: Natural logarithm of the ratio between what comes back of a ray with all
            its power and of one with none.
        spreads: Whether the echo of a volume has the range of half its power, instead
            of that at which it begins.
    """

    full: float
    nepers: float
    spreads: bool


def return_law(settings: SensorSettings) -> ReturnLaw:
    """Return the law of a sensor."""
    full = settings.penetration_power
    # There is no share of no power, nor of unlimited power.
    full = full if math.isfinite(full) else 0.0
    nepers = settings.margin_db * math.log(10) / 10
    return ReturnLaw(full, nepers, settings.return_mode != "first")


def returned_share(share: Floats | float, settings: SensorSettings) -> Floats:
    """Return what comes back of rays that have these shares of their power left."""
    returned = np.exp(return_law(settings).nepers * (np.asarray(share) - 1.0))
    return np.where(np.asarray(share) > NOTHING_LEFT, returned, 0.0)
