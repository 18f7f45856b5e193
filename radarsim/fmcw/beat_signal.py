"""From mean powers to a spectrum, by way of the beat signal.

Theory of operation
===================
A sweep mixed with its echoes is a sum of tones, one for each range. What is rough or
dense returns from many points with random phases: each bin has a complex amplitude of
Gaussian distribution, and neighbouring directions see the same points through their
overlapping beams, so that the amplitudes are correlated by the pattern of the antenna.
Points, such as corner reflectors, have their own phase, 4 pi R / lambda. To these tones
come the leakage of the transmitter and white noise; what is beyond the range of the
converter is clipped. Window and FFT then make the spectrum. So speckle, sidelobes in
range, the colour of the noise, and what saturation does to a whole direction follow by
themselves, and nothing is drawn for a bin of the result.

Amplitudes are in units of the noise in a bin.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from radarsim.fmcw.antenna import gaussian, rows_in_beam
from radarsim.fmcw.radar_equation import noise_power, noise_shape, watts
from radarsim.fmcw.windows import fft_length, sample_count, window_of
from radarsim.geometry import Floats
from radarsim.jit import njit_cached
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.rng import NumberedStreams

Power = NDArray[np.float32]
Signal = NDArray[np.complex64]


class Tones(NamedTuple):
    """Echoes of points; N of them.

    Attributes:
        rows: (N,) int64, the direction of the radar that receives each.
        ranges: (N,) m, by frequency.
        phases: (N,) rad.
        power: (N,) in units of the noise.
    """

    rows: NDArray[np.int64]
    ranges: Floats
    phases: Floats
    power: Floats

    def of_rows(self, rows: range) -> "Tones":
        """Return the tones of some directions."""
        which = (self.rows >= rows.start) & (self.rows < rows.stop)
        return Tones(
            *(self.rows[which], self.ranges[which]),
            *(self.phases[which], self.power[which]),
        )


NO_TONES = Tones(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def beat_spectrum(
    settings: FmcwSettings, mean: Power, tones: Tones, rng: np.random.Generator
) -> Power:
    """Return the power in each bin of a turn, (A, B), in units of the noise.

    Args:
        settings: The radar.
        mean: (A, B) mean power, likewise.
        tones: Echoes of points.
        rng: Source of speckle and noise; it spawns a child.
    """
    return beat_rows(settings, 0, mean, tones, NumberedStreams(rng))


def beat_rows(
    settings: FmcwSettings,
    first: int,
    mean: Power,
    tones: Tones,
    streams: NumberedStreams,
) -> Power:
    """Return the power in each bin of some directions of a turn, (N, B).

    They are the same numbers as those of the whole turn.

    Args:
        settings: The radar.
        first: The first of N neighbouring directions.
        mean: (N, B) mean power of these, in units of the noise.
        tones: Echoes of points, in any directions.
        streams: Source of speckle and noise: two streams for each direction.
    """
    shape = noise_shape(settings)
    signal = _speckle_signal(settings, first, mean / shape, streams)
    own = tones.of_rows(range(first, first + len(signal)))
    _add_tones(settings, signal, own._replace(rows=own.rows - first), shape)
    _add_leakage(settings, signal)
    _add_noise(settings, first, signal, streams)
    _clip(settings, signal)
    signal *= window_of(settings).astype(np.float32)
    bins = fft.fft(signal, fft_length(settings), axis=1)[:, : settings.bins]
    power: Power = bins.real**2
    power += bins.imag**2
    power *= shape
    return power


def _speckle_signal(
    settings: FmcwSettings, first: int, mean: Power, streams: NumberedStreams
) -> Signal:
    """Return the beat signal of what is rough, (N, S); arguments as ``beat_rows``."""
    occupied = np.flatnonzero(mean.any(axis=0))
    samples, length = sample_count(settings), fft_length(settings)
    if not len(occupied):
        return np.zeros((len(mean), samples), np.complex64)
    depth, half = int(occupied[-1]) + 1, rows_in_beam(settings)
    # The directions beside these share points with them.
    white = np.zeros((len(mean) + 2 * half, 2 * depth), np.float32)
    for k, row in enumerate(white):
        streams.fill_normal(2 * ((first - half + k) % settings.azimuths), row)
    lines = np.zeros((len(mean), depth), np.complex64)
    _correlate(white.view(np.complex64), mean, _taps(settings), lines)
    signal = fft.ifft(lines, length, axis=1, norm="forward", overwrite_x=True)
    return np.ascontiguousarray(signal[:, :samples])


def _taps(settings: FmcwSettings) -> NDArray[np.float32]:
    """Return by how much the points of one direction count in the next, (2 n + 1,).

    That is the two-way pattern of the field; the factor makes the power of Gaussian
    amplitudes of variance 2 come out as 1.
    """
    half = rows_in_beam(settings)
    steps = np.arange(-half, half + 1) * settings.step
    taps = gaussian(steps, math.radians(settings.beamwidth_az_deg))
    return (taps / math.sqrt(2 * float((taps**2).sum()))).astype(np.float32)


@njit_cached
def _correlate(white: Any, mean: Any, taps: Any, lines: Any) -> None:
    """Fill correlated amplitudes of a mean power, (N, D), from white ones.

    The white ones are (N + K - 1, D), those of the directions beside included, for K
    taps.
    """
    for row in range(len(lines)):
        line = lines[row]
        for k in range(len(taps)):
            tap, source = taps[k], white[row + k]
            for b in range(len(line)):
                line[b] += tap * source[b]
        for b in range(len(line)):
            line[b] *= np.sqrt(mean[row, b])


def _add_tones(
    settings: FmcwSettings, signal: Signal, tones: Tones, shape: Power
) -> None:
    """Add the tones of points."""
    bins = tones.ranges / settings.bin_size
    level = np.interp(bins, np.arange(len(shape)), shape)
    amplitudes = np.sqrt(tones.power / level) * np.exp(1j * tones.phases)
    turns = bins / fft_length(settings)
    samples = np.arange(signal.shape[1])
    for row, turn, amplitude in zip(tones.rows, turns, amplitudes, strict=True):
        signal[row] += (amplitude * np.exp(2j * np.pi * turn * samples)).astype(
            np.complex64
        )


def _add_leakage(settings: FmcwSettings, signal: Signal) -> None:
    """Add what the transmitter leaks: the same tone in all directions."""
    amplitude = 10 ** (settings.leakage_db / 20)
    turn = settings.leakage_range / settings.bin_size / fft_length(settings)
    samples = np.arange(signal.shape[1])
    signal += (amplitude * np.exp(2j * np.pi * turn * samples)).astype(np.complex64)


def _add_noise(
    settings: FmcwSettings, first: int, signal: Signal, streams: NumberedStreams
) -> None:
    """Add white noise whose mean power in a bin will be 1."""
    window = window_of(settings)
    deviation = 1 / math.sqrt(2 * float((window**2).sum()))
    noise = np.zeros((len(signal), 2 * signal.shape[1]), np.float32)
    for k, row in enumerate(noise):
        streams.fill_normal(2 * (first + k) + 1, row)
    noise *= np.float32(deviation)
    signal += noise.view(np.complex64)


def _clip(settings: FmcwSettings, signal: Signal) -> None:
    """Clip what exceeds the converter, in both of its channels."""
    full_scale = watts(settings.full_scale_dbm) / noise_power(settings)
    limit = np.float32(math.sqrt(float(full_scale)))
    parts = signal.view(np.float32)
    if parts.max(initial=0.0) > limit or parts.min(initial=0.0) < -limit:
        np.clip(parts, -limit, limit, out=parts)
