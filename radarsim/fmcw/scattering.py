"""What the parts of a scene take from a wave, and what they scatter back.

Surfaces follow gamma = sigma0 / cos: the share of the power on a square metre across
the ray that is scattered back, as if to all sides. A wall of Lambert's law has gamma0
cos; ground has the same gamma at all angles. Volumes scatter a share of what they take,
their albedo omega: a canopy that lets nothing through has a gamma of omega / 2. So does
a sheet, which has no depth: omega times the share that it takes.

Gamma and albedo are those of the materials of the map.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.presets.rain_reflectivity import rain_reflectivity
from radarsim.raycast.rays import RayClass
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material

NEPER_DB: Final = 10 / math.log(10)  # dB of power in a neper of power, 4.343
MIRROR_DB: Final = -30.0  # of what a mirror scatters beside its reflection; estimate
_GROUND: Final = ("soil", "ground", "grass", "asphalt", "gravel", "floor")


class Scattering(NamedTuple):  # compiled into kernels
    """What the parts of a scene scatter; P parts, and a last row for robots.

    Attributes:
        gamma: (P + 1,) of the surfaces, at normal incidence.
        exponent: (P + 1,) of the cosine by which it falls off: 1 for Lambert's law, 0
            for ground.
        volume: (P + 1,) radar cross section of a cubic metre inside, m^2/m^3.
        albedo: (P + 1,) share of what a sheet takes that comes back.
        air: Cross section of a cubic metre of the air, m^2/m^3.
    """

    gamma: Floats
    exponent: Floats
    volume: Floats
    albedo: Floats
    air: float


def scattering_of(tracer: Tracer, ray_class: RayClass) -> Scattering:
    """Return what the parts of a scene scatter of the waves of a class."""
    materials = [part.material for part in tracer.parts]
    density, air_density = tracer.densities(ray_class)
    per_db = ray_class.power_per_db
    loss = np.where(np.isfinite(density), density, 0.0) / (per_db * NEPER_DB)
    sheet = np.array([each.sheet_loss is not None for each in materials], np.bool_)
    albedo = np.array([each.albedo for each in materials])
    rain = np.array([rain_reflectivity(ray_class.band, r) for r in tracer.rain_rate])
    volume = np.where(sheet, 0.0, albedo * loss) + rain
    air = 0.0
    if tracer.air_part >= 0:
        air = albedo[-1] * air_density / (per_db * NEPER_DB) + rain[-1]
    return Scattering(
        _with_robots([10 ** (surface_db(each) / 10) for each in materials], -5.0),
        np.append([0.0 if is_ground(each) else 1.0 for each in materials], 1.0),
        np.append(volume, 0.0),
        np.append(albedo, 0.0),
        float(air),
    )


def _with_robots(gamma: list[float], robots_db: float) -> Floats:
    return np.append(gamma, 10 ** (robots_db / 10))


def is_ground(material: Material) -> bool:
    """Return whether a material scatters like open ground."""
    return material.name in _GROUND


def surface_db(material: Material) -> float:
    """Return gamma of an opaque surface at normal incidence, dB."""
    return MIRROR_DB if material.radar_mirror else material.backscatter_db
