"""Speckle: the amplitudes of what is rough, tied to places in the map.

Theory of operation
===================
What is rough or dense returns from many scatterers with random phases: the amplitude of
a cell is a complex number of Gaussian distribution. It stays the same as long as
nothing moves. When the radar moves, the phase of each scatterer changes by 4 pi /
lambda times the change of its distance, and the pattern changes as far as the phases in
a beam turn against each other.

Here scatterers stand on a lattice of the map: in directions that are one column of the
fan apart, and, along a direction of unit vector e, a bin apart. The amplitude of each
is a hash of a key, of its direction, and of its number i along it. An antenna at p sees
scatterer i at the range i b - p e, b being the size of a bin, with the phase 4 pi /
lambda of that. So scatterers ahead of a radar that drives come nearer as walls do, and
one that turns sees them turn. Across the way the correlation of the power falls with
the distance d as

    exp(-(4 pi s d / lambda)^2), s = beamwidth / (4 sqrt(ln 2)).

The phases of directions that are one column apart repeat after lambda / (2 column):
from there on, other scatterers take the place of the first ones.

Scatterers in a wind, as leaves, each have a constant speed of their own, of normal
distribution. Over a time t the field keeps exp(-(4 pi sigma t / lambda)^2 / 2) of its
correlation, sigma being the rms speed.

Source: J. W. Goodman, Speckle Phenomena in Optics, 2007; for the wind: D. K. Barton,
Radar System Analysis and Modeling, 2005.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    fft_length,
    sample_count,
)
from radarsim.addons.fmcw.viewpoints import Viewpoints
from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.rng import fixed_number

Words = NDArray[np.uint64]
Field = NDArray[np.complex64]

FAINT: Final = 1e-5  # in units of the noise; what is less has no amplitude
_LEVELS: Final = 1024  # of amplitudes, phases and speeds
_MASK: Final = np.uint64(_LEVELS - 1)
# Steps and factors of the generator SplitMix64 (Steele, Lea and Flood, 2014).
_STEP: Final = np.uint64(0x9E3779B97F4A7C15)
_FIRST_FACTOR: Final = np.uint64(0xBF58476D1CE4E5B9)
_SECOND_FACTOR: Final = np.uint64(0x94D049BB133111EB)
_BITS: Final = tuple(np.uint64(n) for n in (10, 20, 27, 30, 31))


class Tables(NamedTuple):
    """Values for each of the levels of a hash.

    Attributes:
        amplitudes: (L,) float32, of a mean power of 1 and exponential distribution.
        phasors: (L, 2) float32, real and imaginary part of a unit vector.
        speeds: (L,) float32, standard normal.
    """

    amplitudes: NDArray[np.float32]
    phasors: NDArray[np.float32]
    speeds: NDArray[np.float32]


class Scatterers(NamedTuple):
    """The scatterers of columns of the fan, as an antenna sees them; N columns.

    Attributes:
        keys: (N,) uint64, of the hash of each column.
        starts: (N,) int64, number of the scatterer in the first bin.
        phases: (N,) uint64, of the column, in levels.
        drifts: (N,) by how many levels the phase turns of a scatterer of 1 m/s.
        tables: The ``Tables``.
    """

    keys: Words
    starts: NDArray[np.int64]
    phases: Words
    drifts: Floats
    tables: Tables


class Speckle:
    """The amplitudes of all scatterers of a radar."""

    def __init__(self, settings: FmcwSettings, rng: np.random.Generator) -> None:
        """Fix the amplitudes.

        Args:
            settings: The radar.
            rng: Its seed is the key; it is not drawn from.
        """
        self._settings = settings
        self._key = fixed_number(rng)

    def scatterers(self, azimuths: Floats, view: Viewpoints, salt: int) -> Scatterers:
        """Return the scatterers in directions.

        Args:
            azimuths: (N,) rad, clockwise from straight ahead.
            view: From where the antenna looks into each.
            salt: Number of a set of scatterers; those of two are independent.
        """
        it = self._settings
        width = it.step / it.rays_across
        level = np.stack([np.cos(azimuths), -np.sin(azimuths)], axis=-1)
        ahead = np.einsum("nij,nj->ni", view.rotations[:, :, :2], level)
        number = np.rint(np.arctan2(ahead[:, 1], ahead[:, 0]) / width).astype(np.int64)
        angle = number * width
        number %= it.azimuths * it.rays_across
        x, y = view.positions[:, 0], view.positions[:, 1]
        along = x * np.cos(angle) + y * np.sin(angle)
        beside = y * np.cos(angle) - x * np.sin(angle)
        base = np.uint64((self._key + (salt + 1) * int(_STEP)) % 2**64)
        keys = _mixed(base + number.astype(np.uint64))
        # Strips begin elsewhere in each direction, so that not all change at once.
        repeat = it.wavelength / (2 * width)
        strips = np.floor(beside / repeat + keys / 2.0**64).astype(np.int64)
        keys = _mixed(keys + _STEP * strips.astype(np.uint64))
        shift = doppler_shift(it, np.einsum("ni,ni->n", ahead, view.velocities))
        starts = np.rint((along - shift) / it.bin_size).astype(np.int64)
        # The phase is that in the middle of the sweep, by when a tone has turned too.
        tone = 0.5 * sample_count(it) / fft_length(it)
        turns = np.remainder(starts * tone - 2 * along / it.wavelength, 1.0)
        return Scatterers(
            keys,
            starts,
            (turns * _LEVELS).astype(np.uint64) & _MASK,
            _LEVELS * 2 * view.times / it.wavelength,
            _tables(),
        )


def _mixed(words: Words) -> Words:
    mixed: Words = np.empty_like(words)
    _mix_all(words, mixed)
    return mixed


@njit_cached
def _mix_all(words: Words, mixed: Words) -> None:
    for i in range(len(words)):
        mixed[i] = _mix(words[i])


@njit_inline
def _mix(word: np.uint64) -> np.uint64:
    word = (word ^ (word >> _BITS[3])) * _FIRST_FACTOR
    word = (word ^ (word >> _BITS[2])) * _SECOND_FACTOR
    return word ^ (word >> _BITS[4])


@lru_cache(maxsize=1)
def _tables() -> Tables:
    shares = (np.arange(_LEVELS) + 0.5) / _LEVELS
    power = -np.log(shares)
    turns = 2 * math.pi * np.arange(_LEVELS) / _LEVELS
    phasors = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    speeds = ndtri(shares)
    return Tables(
        np.sqrt(power / power.mean()).astype(np.float32),
        phasors.astype(np.float32),
        (speeds / speeds.std()).astype(np.float32),
    )


@njit_inline
def fill_amplitudes(
    scatterers: Scatterers,
    column: int,
    first: int,
    power: NDArray[np.float32],
    sway: NDArray[np.float32],
    amplitudes: NDArray[np.float32],
) -> None:
    """Fill the amplitudes of neighbouring bins of a column.

    Args:
        scatterers: The ``Scatterers``.
        column: Row of these.
        first: The first bin.
        power: (N,) mean power of each bin.
        sway: (2, N) mean power of what the wind moves, and that times its rms speed,
            m/s; (2, 0) if nothing does.
        amplitudes: (2 N,) real and imaginary parts.
    """
    key, phase = scatterers.keys[column], scatterers.phases[column]
    start, drift = scatterers.starts[column] + first, scatterers.drifts[column]
    tables = scatterers.tables
    for b in range(len(power)):
        if power[b] <= FAINT:
            amplitudes[2 * b] = 0.0
            amplitudes[2 * b + 1] = 0.0
            continue
        word = _mix(key + np.uint64(start + b) * _STEP)
        size = np.sqrt(power[b]) * tables.amplitudes[word & _MASK]
        turned = (word >> _BITS[0]) + phase
        if sway.shape[1] > 0 and sway[0, b] > 0.0:
            # Of all scatterers as many move as the share of the power that does.
            share = float(word >> _BITS[3]) / 2.0**34
            if share * power[b] < sway[0, b]:
                speed = tables.speeds[(word >> _BITS[1]) & _MASK]
                levels = drift * speed * sway[1, b] / sway[0, b]
                turned += np.uint64(np.int64(np.floor(levels)))
        place = turned & _MASK
        amplitudes[2 * b] = size * tables.phasors[place, 0]
        amplitudes[2 * b + 1] = size * tables.phasors[place, 1]


@njit_cached
def add_amplitudes(
    scatterers: Scatterers, power: NDArray[np.float32], field: NDArray[np.float32]
) -> None:
    """Add the amplitudes of the same mean power in several directions.

    Args:
        scatterers: (N) the ``Scatterers``.
        power: (B,) mean power.
        field: (N, 2 B) real and imaginary parts.
    """
    amplitudes = np.zeros(field.shape[1], np.float32)
    still = np.zeros((2, 0), np.float32)
    for row in range(len(field)):
        fill_amplitudes(scatterers, row, 0, power, still, amplitudes)
        for b in range(len(amplitudes)):
            field[row, b] += amplitudes[b]
