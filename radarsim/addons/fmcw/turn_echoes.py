"""The echoes of a revolution: mean power and amplitude by azimuth and range bin.

Theory of operation
===================
Each ray stands for a solid angle dOmega of the beam. K is the constant of the radar
equation, g^2 the two-way pattern, and A the one-way loss, dB. A ray returns:

- from a surface, K g^2 gamma(theta) dOmega 10^(-A/5) / R^2. Rays sample solid angles,
  so the cos^2 of Lambert's law for an area becomes a single cosine here, and the power
  of a surface that fills the beam falls with R^2 instead of R^4;
- from a volume, in every bin that the ray passes, K g^2 sigma_v dOmega 10^(-A/5)
  integral of e^(-2 kappa r) dr / R^2;
- from a sheet, the same as from a surface with a gamma of the albedo times the share
  of the power that the sheet absorbs.

After a mirror, R is the length of the whole path, and g^2 belongs to its first segment.

The power of a ray between two columns is divided between both. Each bin of a column
then gets a random amplitude with this mean power, from the scatterers at its position.
Power and amplitude are added to all azimuths whose main lobes cover the column. The
sidelobes of every azimuth receive the power of all columns.

Powers are in units of the noise, since many powers in watts are too small for float32.
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
    """The echoes at N azimuths.

    Attributes:
        power: Mean power in units of the noise in a bin, (N, B) float32.
        field: Real and imaginary parts of the amplitudes, (N, 2 B) float32.
        velocity: Speeds at which moving robots recede, (N, B) float32 m/s; nan for bins
            without moving robots. None if the revolution has no echo of such a robot.
    """

    power: Power
    field: Power
    velocity: Power | None


class TurnEchoes:
    """The echoes of a revolution, added azimuth by azimuth.

    The beams of the first and last azimuths overlap the previous and the next
    revolution; if the radar stands still, they overlap the other end of this one.

    Attributes:
        total: Sum of the power over all azimuths, (B,).
    """

    def __init__(self, settings: FmcwSettings, *, sways: bool) -> None:
        """Create an object without echoes.

        Args:
            settings: Settings of the radar.
            sways: Whether the wind moves any part of the scene.
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
        # Row 0 belongs to the azimuth that is ``half`` azimuths before the first one.
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
        """Add the echoes of rays; azimuths must be added in order, without gaps.

        Args:
            rows: Indices of the azimuths.
            rays: Rays of these azimuths, as the engine's ``FanRays``.
            events: Events along the rays, in order.
            scattering: Scattering of the scene, as the engine's ``Scattering``.
            scatterers: Scatterers of the columns of the azimuths, and of the next one.
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
        """Return the echoes at some azimuths, without sidelobes.

        Call this method only once for each azimuth. The arrays are views of this
        object's arrays, since copying them would be slow: changes affect both.

        Args:
            first: Index of the first azimuth.
            last: Index after the last azimuth.
            before: Echoes of the previous revolution.
            after: Echoes of the next revolution.
        """
        return Echoes(
            self._sum(first, last, self._power, before._power, after._power),
            self._sum(first, last, self._field, before._field, after._field),
            None if self._velocity is None else self._velocity[first:last],
        )

    def note_velocities(
        self, rows: NDArray[np.int64], ranges: Floats, away: Floats
    ) -> None:
        """Store in the bins of K echoes the speeds at which the echoes' robots recede.

        Args:
            rows: Index of the azimuth of each echo, (K,).
            ranges: Range that corresponds to the beat frequency of each echo, (K,) m.
            away: Speed at which the robot of each echo recedes, (K,) m/s.
        """
        settings = self._settings
        if len(rows) and self._velocity is None:
            shape = settings.azimuths, settings.bins
            self._velocity = np.full(shape, np.nan, np.float32)
        beam = math.ceil(math.radians(settings.beamwidth_az_deg) / settings.step)
        width, bins = math.ceil(2 * settings.padding), ranges / settings.bin_size
        for row, bin_, speed in zip(rows, np.rint(bins).astype(int), away, strict=True):
            assert self._velocity is not None
            # The Doppler shift may give a robot at the antenna a negative range.
            first, last = max(bin_ - width, 0), max(bin_ + width + 1, 0)
            self._velocity[max(row - beam, 0) : row + beam + 1, first:last] = speed

    def _sum(
        self, first: int, last: int, own: Power, before: Power, after: Power
    ) -> Power:
        half, count = self._half, self._settings.azimuths
        sums = own[half + first : half + last]
        # Beams overlap the ends of a revolution, so rays of the previous and the next
        # revolution also give echoes at its first and last azimuths.
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
        """Return the power that the sidelobes receive at each azimuth, (B,)."""
        level = 10 ** (self._settings.sidelobe_db / 10)
        return np.asarray(level * self.total, np.float32)
