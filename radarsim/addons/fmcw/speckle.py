"""Speckle: random amplitudes of rough surfaces, fixed to positions in the map.

Theory of operation
===================
Rough surfaces and dense volumes consist of many scatterers with random phases, so the
amplitude of a cell is a complex Gaussian number. It is constant while nothing moves.
When the radar moves, the phase of each scatterer changes by 4 pi / lambda times the
change of its distance. The speckle pattern changes only if the phases within a beam
change relative to each other.

In this model scatterers form a lattice in the map. Neighbouring directions differ by a
column of the fan, and neighbouring scatterers in a direction by a bin. The amplitude of
a scatterer is a hash of a key, its direction, and its index i along the direction. An
antenna at p sees scatterer i in direction e, a unit vector, at the range i b - p e,
where b is the size of a bin, and with the phase 4 pi / lambda times this range. So
scatterers ahead of a moving radar approach like walls, and a rotation of the radar does
not move them in the map. If the antenna moves by a distance d perpendicular to the line
of sight, the correlation of the power falls as

    exp(-(4 pi s d / lambda)^2), s = beamwidth / (4 sqrt(ln 2)).

The phases of directions that are a column apart repeat after lambda / (2 column), so
beyond this distance other scatterers are used.

Scatterers that move in the wind, such as leaves, have constant speeds with a normal
distribution. After a time t the correlation of the field is
exp(-(4 pi sigma t / lambda)^2 / 2), where sigma is the rms speed.

Ground, walls and plants do not scatter uniformly. If a radar has a ``clutter_shape``,
the mean power at a position is multiplied by a gamma-distributed factor with that shape
and a mean of 1, which varies over about a metre; with speckle, the power then has a K
distribution. The factors are a texture of the map, which repeats after 128 m.

Sources: J. W. Goodman, Speckle Phenomena in Optics, 2007; for the wind: D. K. Barton,
Radar System Analysis and Modeling, 2005; for the texture: K. D. Ward, R. J. A. Tough
and S. Watts, Sea Clutter: Scattering, the K Distribution and Radar Performance, 2006.
"""

import math
from functools import lru_cache
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import gammaincinv, ndtr, ndtri

from radarsim.addons.fmcw.antenna import Viewpoints
from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    fft_length,
    sample_count,
)
from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.rng import generator_for

TEXTURE_CELLS: Final = 512  # cells along each side of the repeated texture
TEXTURE_CELL: Final = 0.25  # m, side of a cell
TEXTURE_LENGTH: Final = 1.0  # m, width of the Gaussian filter of the texture; estimate
_LEVELS: Final = 1024  # number of levels of amplitudes, phases and speeds
_STEP: Final = 0x9E3779B97F4A7C15  # distance between the keys of different sets
# The scatterers in columns of the ray fan as seen from the antenna, as rows for the
# engine.
Scatterers: TypeAlias = NDArray[np.void]


def scatterers_in(
    settings: FmcwSettings,
    azimuths: Floats,
    view: Viewpoints,
    which: NDArray[np.int64],
    key: int,
    salt: int,
) -> Scatterers:
    """Return the scatterers at N azimuths, (N,).

    Args:
        settings: Settings of the radar.
        azimuths: Azimuths, clockwise from straight ahead, (N,) rad.
        view: Viewpoints of the antenna.
        which: Index of the viewpoint at each azimuth, (N,).
        key: Key of the hash; different keys give independent amplitudes.
        salt: Number of a set of scatterers; different sets are independent.
    """
    level = np.stack([np.cos(azimuths), -np.sin(azimuths)], axis=-1)
    first = (key + (salt + 1) * _STEP) % 2**64
    # The key determines the offset of the texture.
    begin = key % TEXTURE_CELLS, key // TEXTURE_CELLS % TEXTURE_CELLS
    keys = np.array([first, *begin], np.uint64)
    found = np.zeros(len(azimuths), engine.rows["Scatterers"])
    engine.find_scatterers(level, which, *view, *_lattice(settings), keys, found)
    return found


@lru_cache(maxsize=16)
def _lattice(settings: FmcwSettings) -> tuple[Floats | float, ...]:
    """Return the arguments of the engine that describe the lattice of scatterers."""
    count = settings.azimuths * settings.rays_across
    width = settings.step / settings.rays_across
    angles = np.arange(-(count // 2) - 1, count // 2 + 2) * width
    turns = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    tone = 0.5 * sample_count(settings) / fft_length(settings)
    wavelength, per_speed = settings.wavelength, float(doppler_shift(settings, 1.0))
    repeat = wavelength / (2 * width)
    return turns, count, width, repeat, settings.bin_size, wavelength, per_speed, tone


@lru_cache(maxsize=4)
def clutter_texture(shape: float) -> NDArray[np.float32]:
    """Return power factors on a grid of positions, (N, N); empty for ``shape`` 0."""
    if not shape:
        return np.zeros((0, 0), np.float32)
    noise = generator_for(0, "clutter").standard_normal([TEXTURE_CELLS] * 2)
    smooth = gaussian_filter(noise, TEXTURE_LENGTH / TEXTURE_CELL, mode="wrap")
    factors = gammaincinv(shape, ndtr(smooth / smooth.std()))
    return np.asarray(factors / factors.mean(), np.float32)


@lru_cache(maxsize=1)
def hash_levels() -> NDArray[np.void]:
    """Return amplitude, phase and speed for each hash level, as rows for the engine."""
    shares = (np.arange(_LEVELS) + 0.5) / _LEVELS
    power = -np.log(shares)
    turns = 2 * math.pi * np.arange(_LEVELS) / _LEVELS
    speeds = ndtri(shares)
    levels = np.zeros(_LEVELS, engine.rows["HashLevel"])
    # Powers have an exponential distribution with mean 1; speeds are standard normal.
    levels["amplitude"] = np.sqrt(power / power.mean())
    levels["real"], levels["imaginary"] = np.cos(turns), np.sin(turns)
    levels["speed"] = speeds / speeds.std()
    return levels
