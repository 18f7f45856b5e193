"""What comes back from each direction and range: mean power and amplitude.

Theory of operation
===================
Each ray carries the share of the beam that its solid angle is. From what it meets comes
back, with K of the radar equation, the two-way pattern g^2, and A the loss one way, dB:

- from a surface, K g^2 gamma(theta) dOmega 10^(-A/5) / R^2. Rays sample solid angles,
  so that Lambert's cos^2 of an area is a single cosine here, and the power of what
  fills the beam falls with R^2, not R^4;
- from a volume, into every bin that the ray passes, K g^2 sigma_v dOmega 10^(-A/5)
  integral of e^(-2 kappa r) dr / R^2;
- from a sheet, as from a surface whose gamma is the albedo times the share it takes.

After a mirror the range is the whole way, and the pattern that of the first direction.

A ray between two columns counts for both, in proportion. Each bin of a column then gets
an amplitude of that mean power, which is that of the scatterers there. The directions
whose main lobes reach the column see both, power and amplitude; the sidelobes of all
directions see all.

Powers are in units of the noise: in watts many are too small for float32.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.radar_equation import gaussian, rows_in_beam
from radarsim.addons.fmcw.range_lines import NEAREST, Bins, Lines, Power
from radarsim.addons.fmcw.ray_power import FanRays, TracedFan, add_ray
from radarsim.addons.fmcw.scattering import Scattering
from radarsim.addons.fmcw.speckle import Scatterers, fill_amplitudes
from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.fmcw_settings import FmcwSettings


def pattern_table(settings: FmcwSettings) -> Floats:
    """Return the two-way pattern across the beam, (F, 2 half + 2).

    Row ``f`` is for columns that begin f / F of a step clockwise from a direction of
    the radar; the entries are for the directions from ``half`` before it to
    ``half + 1`` after it.
    """
    half, parts = rows_in_beam(settings), settings.rays_across
    steps = np.arange(-half, half + 2)[None, :] - np.arange(parts)[:, None] / parts
    width = math.radians(settings.beamwidth_az_deg)
    return gaussian(steps * settings.step, width) ** 2


class Beams(NamedTuple):
    """Where the power of a turn is added up.

    Attributes:
        power: (A + K, B) float32, of the directions; its first row is that of the one
            that is (K - 2) / 2 before the first.
        total: (B,) the power of all columns.
        field: (A + K, 2 B) float32, real and imaginary parts of the amplitudes of the
            same directions.
        lines: That of one column and the next, which are not spread yet.
        pattern: (F, K) from ``pattern_table``.
        amplitudes: (2 B,) float32, overwritten.
    """

    power: Power
    total: Floats
    field: Power
    lines: Lines
    pattern: Floats
    amplitudes: Power


class Echoes(NamedTuple):
    """What some directions receive; N of them.

    Attributes:
        power: (N, B) float32, the mean power, in units of the noise in a bin.
        field: (N, 2 B) float32, real and imaginary parts of the amplitudes.
    """

    power: Power
    field: Power


class TurnEchoes:
    """The echoes of a turn, added up direction by direction.

    The first and the last directions share their beams with those of the turns before
    and after this one, or, if the radar stands still, with those of its own.

    Attributes:
        total: (B,) the power of all directions.
    """

    def __init__(self, settings: FmcwSettings, *, sways: bool) -> None:
        """Begin without any.

        Args:
            settings: The radar.
            sways: Whether the wind moves anything.
        """
        self._settings = settings
        self._half = rows_in_beam(settings)
        rows = settings.azimuths + 2 * self._half + 2
        bins = settings.bins
        self.total = np.zeros(bins)
        lines = Lines(
            np.zeros((2, bins), np.float32),
            np.zeros((2, 2, bins if sways else 0), np.float32),
            np.zeros((2, 2), np.int64),
        )
        lines.spans[:, 0] = bins
        lines.spans[:, 1] = -1
        self._beams = Beams(
            np.zeros((rows, bins), np.float32),
            self.total,
            np.zeros((rows, 2 * bins), np.float32),
            lines,
            pattern_table(settings),
            np.zeros(2 * bins, np.float32),
        )
        ranges = np.arange(settings.bins) * settings.bin_size
        near = ranges < NEAREST
        self._per_square = np.where(near, 0.0, 1.0 / np.maximum(ranges, NEAREST) ** 2)

    def add(
        self,
        rows: range,
        rays: FanRays,
        events: NDArray[np.void],
        scattering: Scattering,
        scatterers: Scatterers,
        full: float,
        db_per_power: float,
    ) -> None:
        """Add the rays of directions, which follow those that were added before.

        Args:
            rows: The directions.
            rays: Their rays.
            events: What these met, in order.
            scattering: What the parts of the scene scatter.
            scatterers: Those of their columns, and of the first one after these.
            full: Power with which the rays start.
            db_per_power: dB one way in a unit of that.
        """
        settings = self._settings
        bins = Bins(
            settings.bin_size,
            self._per_square,
            full,
            db_per_power,
            settings.wavelength,
        )
        traced = TracedFan(rays, events, scattering, bins)
        parts = settings.rays_across
        first, end = rows.start * parts, rows.stop * parts
        closes = rows.stop == settings.azimuths
        _add_rays(self._beams, traced, scatterers, first, end, closes)

    def rows(
        self,
        first: int,
        last: int,
        before: "TurnEchoes",
        after: "TurnEchoes",
    ) -> Echoes:
        """Return the echoes in some directions, without sidelobes.

        Args:
            first: The first direction.
            last: The one after the last.
            before: The turn before this one.
            after: The turn after this one.
        """
        own, other, next_ = self._beams, before._beams, after._beams
        return Echoes(
            self._sum(first, last, own.power, other.power, next_.power),
            self._sum(first, last, own.field, other.field, next_.field),
        )

    def _sum(
        self, first: int, last: int, own: Power, before: Power, after: Power
    ) -> Power:
        half, count = self._half, self._settings.azimuths
        sums = own[half + first : half + last].copy()
        # Beams reach over the ends of a turn: what its neighbours' rays added to rows
        # beyond their own is of these directions.
        end = min(last, half + 2)
        if first < end:
            edge = half + count
            sums[: end - first] += before[edge + first : edge + end]
        start = max(first, count - half)
        if start < last:
            edge = half - count
            sums[start - first :] += after[edge + start : edge + last]
        return sums

    def sidelobes(self) -> Power:
        """Return what the sidelobes of each direction receive of this turn, (B,)."""
        level = 10 ** (self._settings.sidelobe_db / 10)
        return np.asarray(level * self.total, np.float32)


@njit_cached
def _add_rays(
    beams: Beams,
    fan: TracedFan,
    scatterers: Scatterers,
    first: int,
    end: int,
    closes: bool,
) -> None:
    """Add the power of the rays of some columns.

    Args:
        beams: The ``Beams``.
        fan: The ``TracedFan``.
        scatterers: The ``Scatterers`` of these columns, and of the one after the last.
        first: The first column.
        end: The column after the last.
        closes: Whether that is the first one of the next turn.
    """
    inside = np.zeros(len(fan.scattering.gamma) + 1, np.int64)
    ray, event = 0, 0
    # Rays add to their column and to the next one, so that two lines are enough: each
    # is spread when its column is done, and is then the one after the next.
    for column in range(first, end):
        while ray < len(fan.rays.column) and fan.rays.column[ray] == column:
            event = add_ray(fan, beams.lines, inside, column & 1, ray, event)
            ray += 1
        _spread_line(beams, scatterers, column, column - first)
    if closes:
        _spread_line(beams, scatterers, end, end - first)


@njit_inline
def _spread_line(beams: Beams, scatterers: Scatterers, column: int, own: int) -> None:
    """Add a column's echoes to the directions that see it, and clear it.

    Args:
        beams: The ``Beams``.
        scatterers: The ``Scatterers``.
        column: The column.
        own: Its row in these.
    """
    lines, pattern, here = beams.lines, beams.pattern, column & 1
    low, high = lines.spans[here, 0], lines.spans[here, 1]
    if high < low:
        return
    line = lines.power[here, low : high + 1]
    sway = lines.sway[here, :, low : high + 1]
    amplitudes = beams.amplitudes[2 * low : 2 * high + 2]
    fill_amplitudes(scatterers, own, low, line, sway, amplitudes)
    row, part = column // len(pattern), column % len(pattern)
    # Loops over bins, not sums of slices, which would be new arrays.
    for k in range(pattern.shape[1]):
        # Row 0 is that of ``half`` directions before the first, as in the pattern.
        gain = np.float32(pattern[part, k])
        seen = beams.power[row + k, low : high + 1]
        for b in range(len(line)):
            seen[b] += gain * line[b]
        field_gain = np.float32(np.sqrt(pattern[part, k]))
        field = beams.field[row + k, 2 * low : 2 * high + 2]
        for b in range(len(amplitudes)):
            field[b] += field_gain * amplitudes[b]
    total = beams.total[low : high + 1]
    for b in range(len(line)):
        total[b] += line[b]
        line[b] = 0.0
    sway[:] = 0.0
    lines.spans[here, 0], lines.spans[here, 1] = len(beams.total), -1
