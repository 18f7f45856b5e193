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
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from radarsim.addons.fmcw.radar_equation import (
    doppler_shift,
    elevation_pattern,
    fft_length,
    gaussian,
    noise_power,
    noise_shape,
    received_power,
    rows_in_beam,
    sample_count,
    watts,
    window_of,
)
from radarsim.geometry import Floats, Pose3
from radarsim.jit import njit_cached
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import RayClass, Rays
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.rng import NumberedStreams

ROWS_AT_ONCE: Final = 40  # directions; what they need fits into a processor's cache

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
        return Tones._make(column[which] for column in self)


NO_TONES = Tones(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0))

CLEARANCE: Final = 1e-3  # m; a surface this near a point does not hide it


class Points(NamedTuple):
    """Points that reflect; N of them.

    Attributes:
        positions: (N, 3) m, map frame.
        rcs: (N,) m^2, their radar cross sections.
    """

    positions: Floats
    rcs: Floats


def point_tones(
    settings: FmcwSettings,
    pose: Pose3,
    points: Points,
    loss_db: Floats,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Tones:
    """Return the tones of points in the directions whose beams they are in.

    Args:
        settings: The radar.
        pose: Pose of its antenna, map frame.
        points: N points.
        loss_db: (N,) loss on the way to each, dB one way; inf if it is hidden.
        velocity: Of the antenna, m/s, map frame.
    """
    seen = (points.positions - pose.position()) @ pose.rotation()
    distance = np.linalg.norm(seen, axis=1)
    visible = np.isfinite(loss_db) & (distance > 0)
    seen, distance = seen[visible], distance[visible]
    azimuth = -np.arctan2(seen[:, 1], seen[:, 0])
    elevation = np.arcsin(np.clip(seen[:, 2] / distance, -1, 1))
    half = rows_in_beam(settings)
    # Every direction whose main lobe reaches the point receives it, by the pattern.
    rows = np.rint(azimuth / settings.step)[:, None] + np.arange(-half, half + 1)
    across = gaussian(
        rows * settings.step - azimuth[:, None], math.radians(settings.beamwidth_az_deg)
    )
    pattern = across * elevation_pattern(settings, elevation)[:, None]
    power = received_power(settings, points.rcs[visible], distance)
    power *= 10 ** (-loss_db[visible] / 5) / noise_power(settings)
    speeds = (seen @ (pose.rotation().T @ np.array(velocity))) / distance
    ranges = distance + doppler_shift(settings, speeds)
    # The phase follows the true distance, the tone what Doppler makes of it.
    wide = np.ones_like(rows)
    phases = -4 * math.pi * distance / settings.wavelength
    return Tones(
        (rows.astype(np.int64) % settings.azimuths).ravel(),
        (ranges[:, None] * wide).ravel(),
        (phases[:, None] * wide).ravel(),
        (power[:, None] * pattern**2).ravel(),
    )


def losses_to(
    tracer: Tracer,
    pose: Pose3,
    points: Points,
    ray_class: RayClass,
    power: float,
    boxes: Boxes | None = None,
    carrier_id: int = -1,
) -> Floats:
    """Return the loss on the way to points, (N,) dB one way; inf if one is hidden.

    Args:
        tracer: Tracer of the scene.
        pose: Pose of the antenna, map frame.
        points: The points.
        ray_class: Class of the radar's rays.
        power: The power with which they start.
        boxes: The robots.
        carrier_id: The robot that carries the radar; -1 for none.
    """
    offsets = points.positions - pose.position()
    distance = np.linalg.norm(offsets, axis=1)
    loss = np.full(len(distance), np.inf)
    rows = np.flatnonzero(distance > CLEARANCE)
    if not len(rows):
        return loss
    rays = Rays(
        np.broadcast_to(pose.position(), (len(rows), 3)).copy(),
        offsets[rows] / distance[rows, None],
        distance[rows] - CLEARANCE,
        np.full(len(rows), power),
        np.zeros(len(rows), np.uint8),
        np.full(len(rows), carrier_id, np.int64),
        # A mirror on the way hides the point, as any other surface.
        (ray_class._replace(max_reflections=0),),
    )
    for event in tracer.trace(rays, boxes, events=True).events:
        if event["kind"] == EventKind.OUT_OF_RANGE:
            spent = power - event["power"]
            loss[rows[event["ray"]]] = spent / ray_class.power_per_db
    return loss


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
    samples, shape, window = (
        sample_count(settings),
        noise_shape(settings),
        window_of(settings),
    )
    # White noise of this amplitude has a mean power of 1 in a bin.
    amplitude = np.float32(1 / math.sqrt(2 * float((window**2).sum())))
    full_scale = watts(settings.full_scale_dbm) / noise_power(settings)
    limit = np.float32(math.sqrt(float(full_scale)))
    power = np.zeros(mean.shape, np.float32)
    for start in range(0, len(mean), ROWS_AT_ONCE):
        rows, row = slice(start, start + ROWS_AT_ONCE), first + start
        sweeps: Signal = np.zeros((len(mean[rows]), fft_length(settings)), np.complex64)
        _fill_speckle(settings, row, mean[rows], streams, sweeps)
        sweeps = fft.ifft(sweeps, axis=1, norm="forward", overwrite_x=True)
        sweeps[:, samples:] = 0  # a sweep has no more samples; the rest is padding
        signal = sweeps[:, :samples]
        _add_tones(settings, signal, row, tones)
        signal += _leakage(settings)
        noise = np.zeros((len(signal), 2 * samples), np.float32)
        for number, line in enumerate(noise, row):
            streams.fill_normal(2 * number + 1, line)
        noise *= amplitude
        signal += noise.view(np.complex64)
        # The converter clips both of its channels: that spreads over the whole sweep.
        parts = signal.view(np.float32)
        if parts.max(initial=0.0) > limit or parts.min(initial=0.0) < -limit:
            np.clip(parts, -limit, limit, out=parts)
        signal *= window.astype(np.float32)
        _square(fft.fft(sweeps, axis=1, overwrite_x=True), shape, power[rows])
    return power


@njit_cached
def _square(spectra: Signal, shape: Power, power: Power) -> None:
    for row in range(len(power)):
        for b in range(len(shape)):
            field = spectra[row, b]
            power[row, b] = shape[b] * (field.real**2 + field.imag**2)


def _fill_speckle(
    settings: FmcwSettings,
    first: int,
    mean: Power,
    streams: NumberedStreams,
    lines: Signal,
) -> None:
    """Fill the amplitudes of what is rough into the first bins of ``lines``."""
    occupied = np.flatnonzero(mean.any(axis=0))
    if not len(occupied):
        return
    depth, half = int(occupied[-1]) + 1, rows_in_beam(settings)
    # The directions beside these share points with them. Each has a stream of its own,
    # by its number in the turn, so that any part of a turn is computed as the whole.
    white = np.zeros((len(mean) + 2 * half, 2 * depth), np.float32)
    for k, row in enumerate(white):
        streams.fill_normal(2 * ((first - half + k) % settings.azimuths), row)
    rough = mean[:, :depth] / noise_shape(settings)[:depth]
    _correlate(white.view(np.complex64), rough, _taps(settings), lines)


@lru_cache(maxsize=16)
def _taps(settings: FmcwSettings) -> Power:
    """Return by how much the points of one direction count in the next, (2 n + 1,).

    That is the two-way pattern of the field; the factor makes the power of Gaussian
    amplitudes of variance 2 come out as 1.
    """
    half = rows_in_beam(settings)
    steps = np.arange(-half, half + 1) * settings.step
    taps = gaussian(steps, math.radians(settings.beamwidth_az_deg))
    return (taps / math.sqrt(2 * float((taps**2).sum()))).astype(np.float32)


@njit_cached
def _correlate(white: Signal, mean: Power, taps: Power, lines: Signal) -> None:
    """Fill correlated amplitudes of a mean power from white ones.

    Args:
        white: (R + 2 n, D), n more directions on each side.
        mean: (R, B) mean power.
        taps: (2 n + 1,).
        lines: (R, L) filled up to bin D.
    """
    for row in range(len(lines)):
        line = lines[row]
        for k in range(len(taps)):
            tap, source = taps[k], white[row + k]
            for b in range(len(source)):
                line[b] += tap * source[b]
        for b in range(white.shape[1]):
            line[b] *= np.sqrt(mean[row, b])


def _add_tones(
    settings: FmcwSettings, signal: Signal, first: int, tones: Tones
) -> None:
    """Add the tones of points to the directions from ``first`` on."""
    shape, samples = noise_shape(settings), signal.shape[1]
    own = tones.of_rows(range(first, first + len(signal)))
    for row, distance, phase, power in zip(*own, strict=True):
        place = distance / settings.bin_size
        level = np.interp(place, np.arange(len(shape)), shape)
        amplitude = np.sqrt(power / level) * np.exp(1j * phase)
        signal[row - first] += _tone(amplitude, place / fft_length(settings), samples)


@lru_cache(maxsize=16)
def _leakage(settings: FmcwSettings) -> Signal:
    """Return what the transmitter leaks: the same tone in all directions."""
    turn = settings.leakage_range / settings.bin_size / fft_length(settings)
    amplitude = 10 ** (settings.leakage_db / 20)
    return _tone(amplitude, turn, sample_count(settings))


def _tone(amplitude: complex, turn: float, samples: int) -> Signal:
    """Return a tone that turns by ``turn`` from one sample to the next."""
    phases = 2j * np.pi * turn * np.arange(samples)
    tone: Signal = (amplitude * np.exp(phases)).astype(np.complex64)
    return tone
