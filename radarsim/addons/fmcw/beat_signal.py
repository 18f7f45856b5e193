"""Simulates the beat signal of echoes, and computes its range spectra.

Theory of operation
===================
A sweep mixed with its echoes is a sum of beat components, one for each range. Rough
surfaces and dense volumes have a complex amplitude in each bin, from the scatterers
there. Points, such as corner reflectors, have their own phase: 4 pi R / lambda of the
carrier, which is the frequency in the middle of the sweep. Leakage of the transmitter
and white noise, different in each sweep, are added, and the sum is clipped to the range
of the converter. Window and FFT then give the spectrum. So speckle, range sidelobes,
the colour of the noise and the effects of saturation on a whole azimuth are results of
the signal model, and no random numbers are drawn for bins of the result.

The receiver has a single channel with a real signal. A clipped signal has harmonics, so
a strong echo at R also appears at 3 R and, if the converter clips asymmetrically, at
2 R. Harmonics beyond the end of the spectrum are aliased.

Leakage returns on many short paths in the antenna and its radome, whose phases differ
in each sweep. The transmitter has phase noise, so in an azimuth with strong echoes the
noise is higher at all ranges.

Amplitudes are relative to the noise in a bin.
"""

import math
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from radarsim.addons.fmcw.radar_equation import (
    fft_length,
    noise_power,
    noise_shape,
    sample_count,
    watts,
    window_of,
)
from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.processes import thread_count

ROUNDED_ALIKE: Final = 8192  # samples, as many as numpy's buffer holds
BINS_AT_ONCE: Final = 150_000  # bins whose data fit into a processor's cache

Power = NDArray[np.float32]
Signal = NDArray[np.complex64]


class NumberedStreams:
    """Numbered streams of random numbers, which can be read in any order.

    Each read starts at the beginning of the stream.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """Create streams from a generator that is spawned from a random generator.

        Args:
            rng: Generator from which a new generator is spawned; no numbers are drawn.
        """
        (child,) = rng.spawn(1)
        seed: Any = child.bit_generator.seed_seq
        state: Any = np.random.PCG64(seed).state["state"]
        words = [divmod(state[name], 2**64) for name in ("state", "inc")]
        self._words = np.array(words, np.uint64).ravel()

    def fill_normal(self, first: int, out: Power) -> None:
        """Fill each row with standard normal numbers from its own stream; thread-safe.

        Args:
            first: Number of the stream of the first row, at least 0.
            out: Array to fill, (N, S), with contiguous rows.
        """
        engine.fill_normal(self._words, first, out)


class Tones(NamedTuple):
    """The components of the beat signal that are echoes of N points.

    Attributes:
        rows: Index of the azimuth that receives each component, (N,) int64.
        ranges: Ranges that correspond to the beat frequencies, (N,) m.
        phases: Phases in the middle of the sweep, (N,) rad.
        power: Powers relative to the noise, (N,).
    """

    rows: NDArray[np.int64]
    ranges: Floats
    phases: Floats
    power: Floats

    def of_rows(self, rows: range) -> "Tones":
        """Return the components that some azimuths receive."""
        which = (self.rows >= rows.start) & (self.rows < rows.stop)
        return Tones._make(column[which] for column in self)


NO_TONES = Tones(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def join_tones(parts: Iterable[Tones]) -> Tones:
    """Concatenate several sets of beat components."""
    return Tones._make(map(np.concatenate, zip(NO_TONES, *parts, strict=True)))


def beat_rows(
    settings: FmcwSettings,
    first: int,
    field: Power,
    tones: Tones,
    streams: NumberedStreams,
) -> Power:
    """Return the power in each range bin of N azimuths of a revolution, (N, B).

    The numbers are the same as in a computation of the whole revolution.

    Args:
        settings: Settings of the radar.
        first: Index of the first of N consecutive azimuths.
        field: Amplitudes relative to the noise, real and imaginary parts, (N, 2 B).
        tones: Echoes of points; those of other azimuths are ignored.
        streams: Source of noise: a stream for each azimuth.
    """
    power = np.zeros((len(field), settings.bins), np.float32)
    block = max(1, BINS_AT_ONCE // settings.bins)
    starts = range(0, len(field), block)

    window = window_of(settings).astype(np.float32)

    def fill(start: int) -> None:
        own, rows = first + start, slice(start, start + block)
        sweep = sample_sweeps(settings, own, field[rows], tones, streams, window)
        spectra = fft.rfft(sweep, axis=1, overwrite_x=True)
        fields = spectra.view(np.float32).reshape(*spectra.shape, 2)
        engine.square_spectra(fields, noise_shape(settings), power[rows])

    threads = min(thread_count(), len(starts))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, starts))
    else:
        for start in starts:
            fill(start)
    return power


def sample_sweeps(
    settings: FmcwSettings,
    first: int,
    field: Power,
    tones: Tones,
    streams: NumberedStreams,
    window: Power,
) -> Power:
    """Return sweeps as ADC samples, padded for the FFT; arguments as in ``beat_rows``.

    A beat component with unit power in a bin has an amplitude of 2. The samples are
    multiplied by ``window``, (S,).
    """
    samples, length = sample_count(settings), fft_length(settings)
    shape, leakage = noise_shape(settings), _leakage(settings)
    sweeps: Signal = np.zeros((len(field), length // 2 + 1), np.complex64)
    numbers = sweeps.view(np.float32)[:, : field.shape[1]]
    np.multiply(field, np.repeat(1 / np.sqrt(shape), 2), out=numbers)
    random = np.zeros((len(sweeps), samples + 2 * len(leakage)), np.float32)
    streams.fill_normal(first, random)
    ways = np.ascontiguousarray(random[:, samples:]).view(np.complex64)
    sweeps[:, : len(leakage)] += leakage * ways
    # The signal is twice the real part of the sum of all components, so that an FFT of
    # the signal gives their amplitudes.
    sweep: Power = fft.irfft(sweeps, length, axis=1, norm="forward", overwrite_x=True)
    _add_tones(settings, sweep, first, tones)
    _add_noise(settings, sweep, random, window)
    return sweep


def _add_noise(
    settings: FmcwSettings, sweeps: Power, white: Power, window: Power
) -> None:
    """Add thermal noise and phase noise of the transmitter to sweeps, and clip them.

    Args:
        settings: Settings of the radar.
        sweeps: The sweeps, (N, L); the samples after the first S become padding.
        white: Standard normal numbers, (N, S) or more.
        window: Factor of each sample, (S,).
    """
    signal = sweeps[:, : len(window)]
    # White noise of this amplitude has a mean power of 1 in each range bin.
    thermal = 1 / math.sqrt(float((window_of(settings) ** 2).sum()))
    # numpy's sum of a long row depends on the number of rows, so rows are split.
    parts = np.split(signal, range(ROUNDED_ALIKE, signal.shape[1], ROUNDED_ALIKE), 1)
    energy = sum(np.einsum("ns,ns->n", part, part) for part in parts)
    received = energy / (2 * signal.shape[1])
    share = 10 ** (settings.phase_noise_db / 10)
    amplitudes = (thermal * np.sqrt(1 + share * received)).astype(np.float32)
    # The converter clips samples, which changes the power in all bins of the spectrum.
    full_scale = watts(settings.full_scale_dbm)
    limit = 2 * math.sqrt(float(full_scale / noise_power(settings)))
    low = (settings.clip_skew - 1) * limit
    engine.add_noise(sweeps, white, amplitudes, low, limit, window)


def _add_tones(settings: FmcwSettings, sweeps: Power, first: int, tones: Tones) -> None:
    """Add the beat components of points to sweeps, the first at azimuth ``first``."""
    shape = noise_shape(settings)
    rows, ranges, phases, power = tones.of_rows(range(first, first + len(sweeps)))
    places = ranges / settings.bin_size
    level = np.interp(places, np.arange(len(shape)), shape)
    turns = 2 * np.pi * places / fft_length(settings)
    amplitudes, samples = 2 * np.sqrt(power / level), sample_count(settings)
    # Phases are given for the middle of the sweep, where the window has its maximum,
    # but the engine needs the phases at the first sample.
    phases = phases - turns * samples / 2
    engine.add_cosines(sweeps, samples, rows - first, turns, phases, amplitudes)


@lru_cache(maxsize=16)
def _leakage(settings: FmcwSettings) -> Power:
    """Return the rms amplitude of the transmitter's leakage in each range bin, (L,).

    The level is constant up to ``leakage_range``; from there to twice that range it
    falls linearly in dB to the level of the noise.
    """
    bins = math.ceil(2 * settings.leakage_range / settings.bin_size)
    ranges = np.arange(min(bins, settings.bins)) * settings.bin_size
    share = np.clip(2 - ranges / max(settings.leakage_range, 1e-9), 0, 1)
    # The window adds up the leakage of all bins within a resolution cell.
    window = window_of(settings)
    spread = float((window**2).sum()) * fft_length(settings)
    power = 10 ** (settings.leakage_db * share / 10) / spread
    return np.asarray(np.sqrt(power / 2), np.float32)
