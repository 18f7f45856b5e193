"""How much of a radar's power drops of rain send back.

The figures are the volume reflectivity of rain whose drops have the sizes of Marshall
and Palmer, by Mie's theory: computed for this project, at 24, 77 and 94 GHz. Between
them it is a power of the rain's rate.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.tracer import Tracer
from radarsim.sensors.echo_extraction import ENTER, LEAVE, START_INSIDE, EchoColumns

RATES = (1.0, 5.0, 12.5, 25.0, 50.0, 100.0)  # mm/h
REFLECTIVITY_DB = (  # m^2 of radar cross section in each m^3, dB
    (-53.4, -43.0, -37.5, -33.7, -30.2, -27.0),
    (-39.3, -33.6, -30.9, -29.0, -27.2, -25.5),
    (-38.8, -33.7, -31.2, -29.5, -27.8, -26.2),
)


def rain_reflectivity(band: int, mm_per_h: float) -> float:
    """Give the radar cross section of a cubic metre of rain, m^2/m^3.

    Args:
        band: 0 for 24 GHz, 1 for 77, 2 for 94.
        mm_per_h: Rate of the rain; outside of 1 to 100 the nearest two go on.

    >>> round(rain_reflectivity(1, 25), 5)
    0.00126
    """
    if mm_per_h <= 0:
        return 0.0
    rates, decibels = np.log10(RATES), np.array(REFLECTIVITY_DB[band])
    at = np.log10(mm_per_h)
    i = int(np.clip(np.searchsorted(rates, at) - 1, 0, len(rates) - 2))
    slope = (decibels[i + 1] - decibels[i]) / (rates[i + 1] - rates[i])
    return float(10 ** ((decibels[i] + slope * (at - rates[i])) / 10))


# Section from sensors.rain.
# What a radar sees of rain: speckle, not a veil.
#
# Theory of operation
# ===================
# Within a hundred metres rain takes next to nothing from a radar's beam; its drops
# show
# by what they send back. A cell of the beam at the range R, one range resolution
# deep,
# holds a volume of pi R^2 az el dR / (8 ln 2) m^3, for half-power widths az and el;
# that
# times the reflectivity of the rain is its mean cross section. The drops' echoes add
# up
# at random, so its power is distributed exponentially. The least cross section that
# shows grows with R^4. So a cell shows with the probability exp(-1/q), where q, the
# ratio
# of the mean to the least, falls with R^2: rain shows near the radar.
#
# Of each beam the nearest cell that shows is an echo. It stands above the least by so
# many dB, less those that the beam has lost on the way there and back, and that share
# of
# the sensor's margin is its strength: walls are stronger. If nothing is left of it,
# no
# rain shows in that beam. A beam that has no other end ends there.
#
# Nearer than ``NEAREST`` and than the sensor's least range the antenna hears itself,
# and
# nothing shows.

NEAREST: Final = 1.0  # m
CELL: Final = 0.25  # m, of a sensor without range resolution
WIDTH: Final = 2.0  # degrees, of a sensor without beamwidth
REFERENCE: Final = 10.0  # m, where the least cross section is told


class Speckle(NamedTuple):
    """The nearest cell that shows, a row for each beam.

    Attributes:
        t: (N,) m; inf for a beam without.
        part: (N,) the part in which it rains.
        power: (N,) left on arrival there.
        strength: (N,) share of the beam.
    """

    t: Floats
    part: NDArray[np.int64]
    power: Floats
    strength: Floats


def cell_of(settings: SensorSettings) -> float:
    """Give the depth of a sensor's range cells, m."""
    return settings.range_resolution or settings.range_quantum or CELL


def contrast(settings: SensorSettings, mm_per_h: float) -> float:
    """Give q at 1 m: how many times the least the mean cross section of a cell is.

    At R it is so much divided by R^2.
    """
    az = math.radians(settings.beamwidth_az_deg or WIDTH)
    el = math.radians(settings.beamwidth_el_deg or WIDTH)
    volume = math.pi * az * el * cell_of(settings) / (8 * math.log(2))
    band = BANDS_GHZ.index(settings.band_ghz)
    least = 10 ** (settings.least_rcs_dbsm / 10) / REFERENCE**4
    return volume * rain_reflectivity(band, mm_per_h) / least


def speckle(
    tracer: Tracer,
    events: NDArray[np.void],
    rows: NDArray[np.int64],
    drawn: Floats,
    settings: SensorSettings,
) -> Speckle:
    """Find the nearest cell of each beam in which rain shows.

    Args:
        tracer: Of the scene.
        events: EVENT of all rays.
        rows: (N,) the ray that stands for each beam.
        drawn: (2, N) exponentially distributed, of mean 1: how far the beam comes, and
            how bright the cell is.
        settings: Of the sensor.
    """
    n = len(rows)
    found = Speckle(np.full(n, np.inf), np.full(n, -1), np.zeros(n), np.zeros(n))
    contrasts = np.zeros(len(tracer.rain_rate))
    for part in np.flatnonzero(tracer.rain_rate).tolist():
        contrasts[part] = contrast(settings, float(tracer.rain_rate[part]))
    start = np.zeros(len(contrasts), np.uint8)
    if tracer.air_part >= 0:
        start[tracer.air_part] = 1
    firsts = np.searchsorted(events["ray"], rows)
    cell, full = cell_of(settings), settings.penetration_power
    nearest = (math.floor(max(NEAREST, settings.min_range) / cell) + 1) * cell
    limits = (cell, settings.margin_db, nearest, full)
    _speckle(events, (rows, firsts), (start, contrasts), drawn, limits, found)
    return found


@njit_inline
def _contrast_here(around: Any, contrasts: Any) -> Any:
    """Give the contrast where a ray is, and the part that it is of."""
    total, part = 0.0, -1
    for k in range(len(contrasts)):
        if around[k] and contrasts[k] > 0.0:
            total, part = total + contrasts[k], k
    return total, part


@njit_inline
def _search(at: Any, end: Any, cell: Any, here: Any, left: Any) -> Any:
    """Go from cell to cell until one shows.

    Returns:
        Where the first cell is that was not looked at, or that shows; and how much of
        what was drawn is left, at most 0 if that one shows.
    """
    if here <= 0.0:
        return at + cell * max(np.ceil((end - at) / cell), 0.0), left
    while at < end:
        left += np.log1p(-np.exp(-at * at / here))
        if left <= 0.0:
            return at, left
        at += cell
    return at, left


@njit_cached
def _speckle(
    events: Any, rays: Any, rain: Any, drawn: Any, limits: Any, found: Any
) -> None:
    (rows, firsts), (start, contrasts) = rays, rain
    cell, margin, nearest, full = limits
    around = start.copy()
    for beam in range(len(rows)):
        around[:] = start
        left, at, i = drawn[0, beam], nearest, firsts[beam]
        before, power = 0.0, full
        while i < len(events) and events[i].ray == rows[beam] and left > 0.0:
            event = events[i]
            here, part = _contrast_here(around, contrasts)
            at, left = _search(at, event.t, cell, here, left)
            if left <= 0.0:
                lost = (power - event.power) * (at - before) if power < np.inf else 0.0
                lost /= event.t - before
                above = 10.0 * np.log10(1.0 + here / (at * at) * drawn[1, beam])
                share = (power - lost) / full if 0.0 < full < np.inf else 1.0
                strength = min(above / margin, 1.0) - (1.0 - share)
                if strength > 0.0:
                    found.t[beam], found.part[beam] = at, part
                    found.power[beam], found.strength[beam] = power - lost, strength
            if event.kind in (START_INSIDE, ENTER):
                around[event.part] = 1
            elif event.kind == LEAVE:
                around[event.part] = 0
            before, power = event.t, event.power - event.absorbed
            i += 1


def with_rain(
    columns: EchoColumns, shown: Speckle, rows: NDArray[np.int64]
) -> EchoColumns:
    """Put what shows of rain among the echoes of its beams."""
    beams = np.flatnonzero(np.isfinite(shown.t))
    ended = np.zeros(len(rows), bool)
    ended[columns.beam[columns.ends > 0]] = True
    added = EchoColumns(
        beams,
        rows[beams],
        shown.t[beams],
        np.full(len(beams), EventKind.RAIN, np.uint8),
        shown.part[beams],
        shown.power[beams],
        shown.strength[beams],
        (~ended[beams]).astype(np.uint8),
    )
    pairs: list[Any] = list(zip(columns, added, strict=True))
    both: list[Any] = [np.concatenate(pair) for pair in pairs]
    joined = EchoColumns(*both)
    return joined.take(np.lexsort([joined.t, joined.beam]))
