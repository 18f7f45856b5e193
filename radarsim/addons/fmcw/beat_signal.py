"""From mean powers to a spectrum, by way of the beat signal.

Theory of operation
===================
A sweep mixed with its echoes is a sum of tones, one for each range. What is rough or
dense has a complex amplitude in each bin, by the scatterers that are there. Points,
such as corner reflectors, have their own phase: 4 pi R / lambda of the carrier, which
the sweep passes in its middle. To these tones come the leakage of the transmitter and
white noise, which is new in each sweep; what is beyond the range of the converter is
clipped. Window and FFT then make the spectrum. So speckle, sidelobes in range, the
colour of the noise, and what saturation does to a whole direction follow by themselves,
and nothing is drawn for a bin of the result.

The receiver has one channel, a real signal. What is clipped has harmonics, so that a
strong echo from R shows at 3 R as well, and at 2 R as far as the converter ends earlier
on one side than on the other. What is beyond the end of the spectrum folds back.

The leakage comes back by many short ways, of the antenna and its radome, whose phases
are others in each sweep. The phase of the transmitter is not quite steady: in a
direction with strong echoes the noise is higher at all ranges.

Amplitudes are in units of the noise in a bin.
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

BINS_AT_ONCE: Final = 150_000  # what they need fits into a processor's cache

Power = NDArray[np.float32]
Signal = NDArray[np.complex64]


class NumberedStreams:
    """Streams of random numbers by number, which can be drawn in any order.

    Each stream begins again whenever it is drawn from.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        """Create the streams of a child of a generator.

        Args:
            rng: It is not drawn from, but spawns a child.
        """
        (child,) = rng.spawn(1)
        seed: Any = child.bit_generator.seed_seq
        state: Any = np.random.PCG64(seed).state["state"]
        words = [divmod(state[name], 2**64) for name in ("state", "inc")]
        self._words = np.array(words, np.uint64).ravel()

    def fill_normal(self, first: int, out: Power) -> None:
        """Fill rows with the first standard normal numbers of neighbouring streams.

        Threads may do so at once.

        Args:
            first: Number of the stream of the first row, at least 0.
            out: (N, S), each row contiguous.
        """
        engine.fill_normal(self._words, first, out)


class Tones(NamedTuple):
    """Echoes of points; N of them.

    Attributes:
        rows: (N,) int64, the direction of the radar that receives each.
        ranges: (N,) m, by frequency.
        phases: (N,) rad, in the middle of the sweep.
        power: (N,) in units of the noise.
    """

    rows: NDArray[np.int64]
    ranges: Floats
    phases: Floats
    power: Floats

    def of_rows(self, rows: range) -> "Tones":
        """Return the tones of some directions."""
        which = (self.rows >= rows.start) & (self.rows < rows.stop)
        return Tones._make(column[which] for column in self)


NO_TONES = Tones(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def join_tones(parts: Iterable[Tones]) -> Tones:
    """Return all tones of several."""
    return Tones._make(map(np.concatenate, zip(NO_TONES, *parts, strict=True)))


def beat_rows(
    settings: FmcwSettings,
    first: int,
    field: Power,
    tones: Tones,
    streams: NumberedStreams,
) -> Power:
    """Return the power in each bin of some directions of a turn, (N, B).

    They are the same numbers as those of the whole turn.

    Args:
        settings: The radar.
        first: The first of N neighbouring directions.
        field: (N, 2 B) their amplitudes, real and imaginary parts, in units of the
            noise.
        tones: Echoes of points, in any directions.
        streams: Source of noise: a stream for each direction.
    """
    power = np.zeros((len(field), settings.bins), np.float32)
    share = math.ceil(len(field) / thread_count())
    block = max(1, min(share, BINS_AT_ONCE // settings.bins))
    starts = range(0, len(field), block)

    def fill(start: int) -> None:
        rows = slice(start, start + block)
        _fill_power(settings, first + start, field[rows], tones, streams, power[rows])

    threads = min(thread_count(), len(starts))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, starts))
    else:
        for start in starts:
            fill(start)
    return power


def _fill_power(
    settings: FmcwSettings,
    first: int,
    field: Power,
    tones: Tones,
    streams: NumberedStreams,
    power: Power,
) -> None:
    """Fill the power in each bin of directions; arguments as of ``beat_rows``."""
    sweep = sample_sweeps(settings, first, field, tones, streams)
    sweep[:, : sample_count(settings)] *= window_of(settings).astype(np.float32)
    spectra = fft.rfft(sweep, axis=1, overwrite_x=True)
    fields = spectra.view(np.float32).reshape(*spectra.shape, 2)
    engine.square_spectra(fields, noise_shape(settings), power)


def sample_sweeps(
    settings: FmcwSettings,
    first: int,
    field: Power,
    tones: Tones,
    streams: NumberedStreams,
) -> Power:
    """Return the samples of sweeps, padded for the FFT; arguments as of ``beat_rows``.

    A tone of unit power in a bin has an amplitude of 2.
    """
    samples, length = sample_count(settings), fft_length(settings)
    shape, leakage = noise_shape(settings), _leakage(settings)
    # The least and the greatest sample that the converter knows.
    full_scale = watts(settings.full_scale_dbm)
    limit = 2 * math.sqrt(float(full_scale / noise_power(settings)))
    limits = np.float32((settings.clip_skew - 1) * limit), np.float32(limit)
    amplitudes: Signal = field.view(np.complex64)
    sweeps: Signal = np.zeros((len(amplitudes), length // 2 + 1), np.complex64)
    np.multiply(amplitudes, 1 / np.sqrt(shape), out=sweeps[:, : settings.bins])
    random = np.zeros((len(sweeps), samples + 2 * len(leakage)), np.float32)
    streams.fill_normal(first, random)
    ways = np.ascontiguousarray(random[:, samples:]).view(np.complex64)
    sweeps[:, : len(leakage)] += leakage * ways
    # Twice the real part of the tones: the FFT finds their amplitudes again.
    sweep: Power = fft.irfft(sweeps, length, axis=1, norm="forward", overwrite_x=True)
    sweep[:, samples:] = 0  # a sweep has no more samples; the rest is padding
    signal = sweep[:, :samples]
    _add_tones(settings, sweep, first, tones)
    _add_noise(settings, signal, random[:, :samples])
    # What the converter clips spreads over the whole sweep.
    if signal.max(initial=0.0) > limits[1] or signal.min(initial=0.0) < limits[0]:
        np.clip(signal, *limits, out=signal)
    return sweep


def _add_noise(settings: FmcwSettings, signal: Power, white: Power) -> None:
    """Add thermal noise to sweeps, and that of the transmitter's phase.

    Args:
        settings: The radar.
        signal: (N, S) the sweeps.
        white: (N, S) standard normal numbers, overwritten.
    """
    # Of this amplitude it has a mean power of 1 in a bin.
    thermal = 1 / math.sqrt(float((window_of(settings) ** 2).sum()))
    received = np.einsum("ns,ns->n", signal, signal) / (2 * signal.shape[1])
    share = 10 ** (settings.phase_noise_db / 10)
    white *= (thermal * np.sqrt(1 + share * received)).astype(np.float32)[:, None]
    signal += white


def _add_tones(settings: FmcwSettings, sweeps: Power, first: int, tones: Tones) -> None:
    """Add the tones of points to the directions from ``first`` on."""
    shape = noise_shape(settings)
    rows, ranges, phases, power = tones.of_rows(range(first, first + len(sweeps)))
    places = ranges / settings.bin_size
    level = np.interp(places, np.arange(len(shape)), shape)
    turns = 2 * np.pi * places / fft_length(settings)
    amplitudes, samples = 2 * np.sqrt(power / level), sample_count(settings)
    # The engine counts phases from the first sample; the window is greatest here.
    phases = phases - turns * samples / 2
    engine.add_cosines(sweeps, samples, rows - first, turns, phases, amplitudes)


@lru_cache(maxsize=16)
def _leakage(settings: FmcwSettings) -> Power:
    """Return the rms amplitudes of the leakage by bin, (L,), for normal numbers.

    Its level is even as far as ``leakage_range``; from there to twice that range its
    decibels fall to those of the noise.
    """
    bins = math.ceil(2 * settings.leakage_range / settings.bin_size)
    ranges = np.arange(min(bins, settings.bins)) * settings.bin_size
    share = np.clip(2 - ranges / max(settings.leakage_range, 1e-9), 0, 1)
    # The window adds up what is in the bins of one resolution.
    window = window_of(settings)
    spread = float((window**2).sum()) * fft_length(settings)
    power = 10 ** (settings.leakage_db * share / 10) / spread
    return np.asarray(np.sqrt(power / 2), np.float32)
