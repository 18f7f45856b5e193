"""The mean power that comes back from each direction and range.

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

A surface that is grazed takes up more than one bin, as the next ray of the beam meets
it farther off: its power is spread over that distance. After a mirror the range is the
whole way, and the pattern that of the first direction.

A ray between two columns counts for both, in proportion. Each column is then seen by
the directions whose main lobes reach it; the sidelobes of all directions see all.

Powers are in units of the noise: in watts many are too small for float32.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.fmcw.antenna import gaussian, rows_in_beam
from radarsim.fmcw.ray_fan import RayFan
from radarsim.fmcw.scattering import NEPER_DB, Scattering
from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.fmcw_settings import FmcwSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Traces

_START_INSIDE, _ENTER, _LEAVE, _SHEET, _HIT = map(int, list(EventKind)[:5])
_MIRRORED = int(EventKind.MIRRORED)

NEAREST: Final = 0.3  # m; nearer the far field, and 1 / R^2, do not hold
LONGEST_SPREAD: Final = 3.0  # m, over which a grazed surface is spread

Power = NDArray[np.float32]


class Rays(NamedTuple):
    """The rays of a turn as the kernel takes them; M rays.

    Attributes:
        column: As in ``RayFan``.
        across: Likewise.
        weights: (M,) as there, times K over the noise.
        spread: As there.
        directions: (M, 3) unit vectors, map frame.
        shift: (M,) m, by how much all seems farther by Doppler's effect.
        incidence: (M,) cosine of the angle of incidence.
    """

    column: NDArray[np.int64]
    across: Floats
    weights: Floats
    spread: Floats
    directions: Floats
    shift: Floats
    incidence: Floats


class Bins(NamedTuple):
    """The range bins.

    Attributes:
        size: m.
        per_square: (B,) 1 / R^2 of each, 1/m^2; 0 where it is too near.
        full: Power with which rays start.
        db_per_power: dB one way in a unit of it.
    """

    size: float
    per_square: Floats
    full: float
    db_per_power: float


class Lines(NamedTuple):
    """Power by range, of one column and the next.

    Attributes:
        power: (2, B) float32.
        spans: (2, 2) int64, the first and the last bin with power in each.
    """

    power: Power
    spans: NDArray[np.int64]


class Place(NamedTuple):
    """Where a ray's power goes.

    Attributes:
        here: Row of ``Lines`` of its column.
        across: Share of the next column.
        weight: Power at 1 m from a gamma of 1.
        shift: m, added to ranges.
    """

    here: int
    across: float
    weight: float
    shift: float


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


class PowerScale(NamedTuple):
    """The units of power.

    Attributes:
        constant: K of the radar equation over the noise in a bin, m^2.
        full: Power with which the rays start.
        db_per_power: dB one way in a unit of that.
        shift: (M,) m, by how much what a ray meets seems farther.
    """

    constant: float
    full: float
    db_per_power: float
    shift: Floats


class TurnPower:
    """The mean power of a turn, added up direction by direction.

    The first and the last directions share their beams with those of the turns before
    and after this one, or, if the radar stands still, with those of its own.

    Attributes:
        total: (B,) the power of all directions.
    """

    def __init__(self, settings: FmcwSettings) -> None:
        """Begin without any power."""
        self._settings = settings
        self._half = rows_in_beam(settings)
        rows = settings.azimuths + 2 * self._half + 2
        self._rows = np.zeros((rows, settings.bins), np.float32)
        self.total = np.zeros(settings.bins)
        self._pattern = pattern_table(settings)
        self._lines = Lines(
            np.zeros((2, settings.bins), np.float32), np.zeros((2, 2), np.int64)
        )
        self._lines.spans[:, 0] = settings.bins
        self._lines.spans[:, 1] = -1
        ranges = np.arange(settings.bins) * settings.bin_size
        near = ranges < NEAREST
        self._per_square = np.where(near, 0.0, 1.0 / np.maximum(ranges, NEAREST) ** 2)

    def add(
        self,
        rows: range,
        fan: RayFan,
        directions: Floats,
        traces: Traces,
        scattering: Scattering,
        scale: PowerScale,
    ) -> None:
        """Add the rays of directions, which follow those that were added before.

        Args:
            rows: The directions.
            fan: Their M rays.
            directions: (M, 3) unit vectors, map frame, in which they were traced.
            traces: How they ended, with events and incidence.
            scattering: What the parts of the scene scatter.
            scale: The units of power.
        """
        settings = self._settings
        rays = Rays(
            *(fan.column, fan.across, fan.weights * scale.constant, fan.spread),
            *(directions, scale.shift, traces.incidence),
        )
        bins = Bins(settings.bin_size, self._per_square, scale.full, scale.db_per_power)
        parts, last = settings.rays_across, rows.stop == settings.azimuths
        _add_rays(
            *(self._rows, self.total, self._lines, traces.events),
            *(rows.start * parts, rows.stop * parts, last, self._pattern),
            *(rays, scattering, bins),
        )

    def rows(
        self,
        first: int,
        last: int,
        before: "TurnPower",
        after: "TurnPower",
    ) -> Power:
        """Return the mean power of some directions, (N, B), without sidelobes.

        Args:
            first: The first direction.
            last: The one after the last.
            before: The turn before this one.
            after: The turn after this one.
        """
        half, count = self._half, self._settings.azimuths
        power = self._rows[half + first : half + last].copy()
        end = min(last, half + 2)
        if first < end:
            edge = half + count
            power[: end - first] += before._rows[edge + first : edge + end]
        start = max(first, count - half)
        if start < last:
            edge = half - count
            power[start - first :] += after._rows[edge + start : edge + last]
        return power

    def sidelobes(self) -> Power:
        """Return what the sidelobes of each direction receive of this turn, (B,)."""
        level = 10 ** (self._settings.sidelobe_db / 10)
        return np.asarray(level * self.total, np.float32)


@njit_cached
def _add_rays(
    mean: Any,
    total: Any,
    lines: Any,
    events: Any,
    first: Any,
    end: Any,
    closes: Any,
    pattern: Any,
    rays: Any,
    scattering: Any,
    bins: Any,
) -> None:
    """Add the power of the rays of some columns.

    Args:
        mean: (A + K, B) float32, added to; its first row is that of the direction that
            is (K - 2) / 2 before the first one.
        total: (B,) added to: the power of all columns.
        lines: The ``Lines``.
        events: The events of the rays, in order.
        first: The first column.
        end: The column after the last.
        closes: Whether that is the first one of the next turn.
        pattern: From ``pattern_table``.
        rays: The ``Rays``.
        scattering: The ``Scattering``.
        bins: The ``Bins``.
    """
    inside = np.zeros(len(scattering.gamma) + 1, np.int64)
    ray, event = 0, 0
    for column in range(first, end):
        here = column & 1
        while ray < len(rays.column) and rays.column[ray] == column:
            event = _add_ray(
                lines, events, event, ray, here, rays, scattering, bins, inside
            )
            ray += 1
        _spread_line(mean, total, lines, here, column, pattern)
    if closes:
        _spread_line(mean, total, lines, end & 1, end, pattern)


@njit_inline
def _spread_line(
    mean: Any, total: Any, lines: Any, here: Any, column: Any, pattern: Any
) -> None:
    """Add a column's power to the directions that see it, and clear it."""
    low, high = lines.spans[here, 0], lines.spans[here, 1]
    if high < low:
        return
    line, parts = lines.power[here], len(pattern)
    row, part = column // parts, column % parts
    for k in range(pattern.shape[1]):
        gain = np.float32(pattern[part, k])
        seen = mean[row + k]
        for b in range(low, high + 1):
            seen[b] += gain * line[b]
    for b in range(low, high + 1):
        total[b] += line[b]
        line[b] = 0.0
    lines.spans[here, 0], lines.spans[here, 1] = len(line), -1


@njit_inline
def _add_ray(
    lines: Any,
    events: Any,
    event: Any,
    ray: Any,
    here: Any,
    rays: Any,
    scattering: Any,
    bins: Any,
    inside: Any,
) -> Any:
    """Add the power of one ray; return the first event of the next one."""
    place = Place(here, rays.across[ray], rays.weights[ray], rays.shift[ray])
    count, last = 0, len(scattering.gamma) - 1
    t, power = 0.0, bins.full
    first = event
    while event < len(events) and events[event].ray == ray:
        e = events[event]
        left = min(e.power, power)
        volume = scattering.air
        for k in range(count):
            volume += scattering.volume[inside[k]]
        if volume > 0.0 and e.t > t:
            loss = (bins.full - power) * bins.db_per_power
            slope = (power - left) / (e.t - t) * bins.db_per_power
            _add_volume(lines, place, bins, t, e.t, volume, loss, slope)
        through = 10.0 ** (-0.2 * (bins.full - left) * bins.db_per_power)
        if e.kind == _HIT:
            _add_end(lines, place, bins, e, ray, rays, scattering, through)
        elif e.kind == _SHEET:
            taken = 1.0 - 10.0 ** (-0.1 * e.absorbed * bins.db_per_power)
            gamma = scattering.albedo[min(e.part, last)] * taken
            _add_surface(lines, place, bins, e.t, gamma * through, 0.0)
        elif e.kind == _MIRRORED:
            cosine = _mirror_cosine(events, first, event, ray, rays)
            gamma = scattering.gamma[e.part] * cosine
            _add_surface(lines, place, bins, e.t, gamma * through, 0.0)
        count = _count_inside(inside, count, e)
        t, power = e.t, left - e.absorbed
        event += 1
    return event


@njit_inline
def _add_end(
    lines: Any,
    place: Any,
    bins: Any,
    event: Any,
    ray: Any,
    rays: Any,
    scattering: Any,
    through: Any,
) -> None:
    """Add the surface that ends a ray; ``through`` is the share that comes there."""
    part = min(event.part, len(scattering.gamma) - 1)
    cosine = max(rays.incidence[ray], 1e-3)
    gamma = scattering.gamma[part] * cosine ** scattering.exponent[part]
    slant = np.sqrt(1.0 - cosine * cosine) / cosine
    length = min(rays.spread[ray] * event.t * slant, LONGEST_SPREAD)
    _add_surface(lines, place, bins, event.t, gamma * through, length)


@njit_inline
def _mirror_cosine(events: Any, first: Any, event: Any, ray: Any, rays: Any) -> Any:
    """Return the cosine of the angle of incidence on a mirror.

    It is half the length by which the direction changes.
    """
    before = first - 1  # the mirror before this one; of the first one there is none
    for k in range(first, event):
        if events[k].kind == _MIRRORED:
            before = k
    here, after = events[event], events[event + 1]
    run = after.t - here.t
    if run <= 0.0:
        return 1.0
    ux, uy, uz = (
        rays.directions[ray, 0],
        rays.directions[ray, 1],
        rays.directions[ray, 2],
    )
    if before >= first:
        last = events[before]
        way = max(here.t - last.t, 1e-9)
        ux, uy, uz = (
            (here.x - last.x) / way,
            (here.y - last.y) / way,
            (here.z - last.z) / way,
        )
    dx, dy, dz = (
        (after.x - here.x) / run,
        (after.y - here.y) / run,
        (after.z - here.z) / run,
    )
    change = np.sqrt((dx - ux) ** 2 + (dy - uy) ** 2 + (dz - uz) ** 2)
    return min(0.5 * change, 1.0)


@njit_inline
def _count_inside(inside: Any, count: Any, event: Any) -> Any:
    """Keep the list of volumes around a ray; return their number after an event."""
    if event.kind in (_ENTER, _START_INSIDE):
        inside[count] = event.part
        return count + 1
    if event.kind == _LEAVE:
        return _without(inside, count, event.part)
    # After a mirror the volumes are entered anew.
    return 0 if event.kind == _MIRRORED else count


@njit_inline
def _without(inside: Any, count: Any, part: Any) -> Any:
    """Remove a part from the list of volumes around the ray; return their number."""
    kept = 0
    for k in range(count):
        if inside[k] != part:
            inside[kept] = inside[k]
            kept += 1
    return kept


@njit_inline
def _add_to_bin(lines: Any, place: Any, b: Any, power: Any) -> None:
    here, beside = place.here, 1 - place.here
    lines.power[here, b] += power * (1.0 - place.across)
    lines.power[beside, b] += power * place.across


@njit_inline
def _widen(lines: Any, low: Any, high: Any) -> None:
    """Note that bins from ``low`` to ``high`` have power."""
    for k in range(2):
        lines.spans[k, 0] = min(lines.spans[k, 0], low)
        lines.spans[k, 1] = max(lines.spans[k, 1], high)


@njit_inline
def _add_surface(
    lines: Any, place: Any, bins: Any, t: Any, gamma: Any, length: Any
) -> None:
    """Add what a surface returns, evenly over a length, and at least over one bin."""
    if gamma <= 0.0 or t < NEAREST:
        return
    power = place.weight * gamma / (t * t)
    size, count = bins.size, len(bins.per_square)
    half = 0.5 * max(length, size)
    middle = t + place.shift
    # Bin b is from (b - 1/2) to (b + 1/2) bin sizes.
    start, end = (middle - half) / size + 0.5, (middle + half) / size + 0.5
    low, high = max(int(np.floor(start)), 0), min(int(np.floor(end)), count - 1)
    if high < low:
        return
    density = power / (end - start)
    for b in range(low, high + 1):
        share = min(end, b + 1.0) - max(start, float(b))
        _add_to_bin(lines, place, b, density * share)
    _widen(lines, low, high)


@njit_inline
def _add_volume(
    lines: Any,
    place: Any,
    bins: Any,
    t0: Any,
    t1: Any,
    volume: Any,
    loss: Any,
    slope: Any,
) -> None:
    """Add what a volume returns between two points of a ray.

    Args:
        lines: The ``Lines``.
        place: The ``Place``.
        bins: The ``Bins``.
        t0: Where it begins, m.
        t1: Where it ends, m.
        volume: Cross section of a cubic metre, m^2/m^3.
        loss: dB one way up to there.
        slope: dB per metre one way within.
    """
    size, count = bins.size, len(bins.per_square)
    rate = 2.0 * slope / NEPER_DB  # nepers of power per metre, out and back
    start, end = (t0 + place.shift) / size + 0.5, (t1 + place.shift) / size + 0.5
    low, high = max(int(np.floor(start)), 0), min(int(np.floor(end)), count - 1)
    if high < low:
        return
    strength = place.weight * volume * 10.0 ** (-0.2 * loss)
    whole = size if rate * size < 1e-6 else (1.0 - np.exp(-rate * size)) / rate
    fade = np.exp(-rate * size)
    begin = max(start, float(low))
    left = strength * np.exp(-rate * (begin - start) * size)
    for b in range(low, high + 1):
        depth = (min(end, b + 1.0) - begin) * size
        if depth < 0.999999 * size:
            thin = rate * depth < 1e-6
            inner = depth if thin else (1.0 - np.exp(-rate * depth)) / rate
            _add_to_bin(lines, place, b, left * inner * bins.per_square[b])
            left *= np.exp(-rate * depth)
        else:
            _add_to_bin(lines, place, b, left * whole * bins.per_square[b])
            left *= fade
        begin = b + 1.0
    _widen(lines, low, high)
