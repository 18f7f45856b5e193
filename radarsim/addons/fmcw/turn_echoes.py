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
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antenna import pattern_table, rows_in_beam
from radarsim.addons.fmcw.beat_signal import Power
from radarsim.addons.fmcw.speckle import Scatterers, clutter_texture, hash_levels
from radarsim.engine import Packed, engine
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.rays import Events

NEAREST: Final = 0.3  # m; nearer the far field, and 1 / R^2, do not hold


class Echoes(NamedTuple):
    """What some directions receive; N of them.

    Attributes:
        power: (N, B) float32, the mean power, in units of the noise in a bin.
        field: (N, 2 B) float32, real and imaginary parts of the amplitudes.
        velocity: (N, B) float32 m/s, how fast robots that drive move away; nan where
            there is none. None if the turn has met none.
    """

    power: Power
    field: Power
    velocity: Power | None


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
        rows, bins = settings.azimuths + 2 * self._half + 2, settings.bins
        ranges = np.arange(bins) * settings.bin_size
        near = ranges < NEAREST
        self._lines = engine.structures["RangeLines"].pack(
            bin_size=settings.bin_size,
            per_square=np.where(near, 0.0, 1.0 / np.maximum(ranges, NEAREST) ** 2),
            power=np.zeros((2, bins), np.float32),
            sway=np.zeros((2, 2, bins if sways else 0), np.float32),
            spans=np.array([[bins, -1]] * 2),
        )
        # The first row is that of the direction that is ``half`` before the first.
        self._power = np.zeros((rows, bins), np.float32)
        self._field = np.zeros((rows, 2 * bins), np.float32)
        self.total = np.zeros(bins)
        self._velocity: Power | None = None
        self._beams = engine.structures["Beams"].pack(
            power=self._power,
            field=self._field.reshape(rows, bins, 2),
            total=self.total,
            pattern=pattern_table(settings),
            texture=clutter_texture(settings.clutter_shape),
            amplitudes=np.zeros((bins, 2), np.float32),
        )

    def add(
        self,
        rows: range,
        rays: Packed,
        events: Events,
        scattering: Packed,
        scatterers: Scatterers,
    ) -> None:
        """Add the rays of directions, which follow those that were added before.

        Args:
            rows: The directions.
            rays: Their rays, as the engine's ``FanRays``.
            events: What these met, in order.
            scattering: What the scene scatters, as the engine's ``Scattering``.
            scatterers: Those of their columns, and of the first one after these.
        """
        first = rows.start * self._settings.rays_across
        closes = rows.stop == self._settings.azimuths
        engine.add_rays(
            self._beams,
            self._lines,
            rays,
            events,
            scattering,
            scatterers,
            hash_levels(),
            first,
            closes,
        )

    def rows(
        self,
        first: int,
        last: int,
        before: "TurnEchoes",
        after: "TurnEchoes",
    ) -> Echoes:
        """Return the echoes in some directions, without sidelobes; once each.

        They are views of those of the turn, since copies would take as long as the
        scatterers: what is added to them is added to the turn.

        Args:
            first: The first direction.
            last: The one after the last.
            before: The turn before this one.
            after: The turn after this one.
        """
        return Echoes(
            self._sum(first, last, self._power, before._power, after._power),
            self._sum(first, last, self._field, before._field, after._field),
            None if self._velocity is None else self._velocity[first:last],
        )

    def note_velocities(
        self, rows: NDArray[np.int64], ranges: Floats, away: Floats
    ) -> None:
        """Note how fast robots move away, in the bins that their echoes fall into.

        Args:
            rows: (K,) the direction of each echo.
            ranges: (K,) m, by frequency.
            away: (K,) m/s.
        """
        settings = self._settings
        if len(rows) and self._velocity is None:
            shape = settings.azimuths, settings.bins
            self._velocity = np.full(shape, np.nan, np.float32)
        beam = math.ceil(math.radians(settings.beamwidth_az_deg) / settings.step)
        width, bins = math.ceil(2 * settings.padding), ranges / settings.bin_size
        for row, bin_, speed in zip(rows, np.rint(bins).astype(int), away, strict=True):
            assert self._velocity is not None
            # A robot at the antenna may seem to be behind it.
            first, last = max(bin_ - width, 0), max(bin_ + width + 1, 0)
            self._velocity[max(row - beam, 0) : row + beam + 1, first:last] = speed

    def _sum(
        self, first: int, last: int, own: Power, before: Power, after: Power
    ) -> Power:
        half, count = self._half, self._settings.azimuths
        sums = own[half + first : half + last]
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
