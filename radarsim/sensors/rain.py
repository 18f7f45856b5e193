"""What a radar detects of rain: speckle near the sensor.

Theory of operation
===================
Within a hundred metres rain absorbs almost nothing of a radar's beam; its drops show by
what they scatter back. A cell of the beam at range R, one range resolution deep, has
a volume of pi R^2 az el dR / (8 ln 2) m^3, for half-power widths az and el; that times
the reflectivity of the rain is its mean cross section. The drops' echoes add up with
random phases, so the power of a cell is distributed exponentially. The smallest cross
section that is detected grows with R^4. So a cell is detected with the probability
exp(-1/q), where the contrast q, the ratio of the mean to the smallest cross section,
falls with R^2: rain shows near the radar.

The nearest detected cell of each beam is an echo. A wall ahead is as far above the
detection limit as the sensor's margin; the strength of the echo is its own level above
the limit, dB, minus the loss of the beam on the way there and back, relative to that:
walls are stronger. If nothing is left of the level, no rain shows in that beam. A beam
that has no other end ends there.

Nothing is detected nearer than ``BLIND_RANGE`` or than the sensor's minimum range,
where the antenna receives its own signal.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.attenuation import EventKind, EventRow, Events
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import rain_reflectivity
from radarsim.sensors.echo_extraction import EchoColumns
from radarsim.sensors.echo_strength import ENTER, LEAVE, START_INSIDE

BLIND_RANGE: Final = 1.0  # m
DEFAULT_CELL: Final = 0.25  # m, for a sensor without range resolution
DEFAULT_BEAMWIDTH: Final = 2.0  # degrees, for a sensor without beamwidth
REFERENCE_RANGE: Final = 10.0  # m, where ``least_rcs_dbsm`` holds


class Speckle(NamedTuple):
    """The nearest cell of each beam in which rain is detected.

    Attributes:
        t: (N,) distance, m; inf for a beam without.
        part: (N,) the part in which it rains.
        power: (N,) power left on arrival there.
        strength: (N,) share of what a rough wall ahead returns.
    """

    t: Floats
    part: NDArray[np.int64]
    power: Floats
    strength: Floats


class RainField(NamedTuple):
    """Where it rains, and how strongly a sensor sees it.

    Attributes:
        around_start: (P,) uint8, the parts that enclose every ray at its start.
        contrasts: (P,) contrast of the rain in each part at 1 m; 0 without rain.
    """

    around_start: NDArray[np.uint8]
    contrasts: Floats


class BeamDraws(NamedTuple):
    """The rays that stand for the beams, and their random numbers.

    Attributes:
        rows: (N,) index of the ray.
        first_event: (N,) index of its first event.
        random: (2, N) exponentially distributed with mean 1: how far the beam reaches,
            and how bright the detected cell is.
    """

    rows: NDArray[np.int64]
    first_event: NDArray[np.int64]
    random: Floats


class RainLimits(NamedTuple):
    """Limits of the search for rain.

    Attributes:
        cell: Depth of a range cell, m.
        margin_db: Margin of the sensor, dB.
        nearest: Distance of the first cell, m.
        full_power: Penetration power with which a ray starts.
    """

    cell: float
    margin_db: float
    nearest: float
    full_power: float


def cell_depth(settings: SensorSettings) -> float:
    """Return the depth of a sensor's range cells, m."""
    return settings.range_resolution or settings.range_quantum or DEFAULT_CELL


def contrast(settings: SensorSettings, mm_per_h: float) -> float:
    """Return the contrast q of a cell at 1 m; at range R it is q / R^2."""
    az = math.radians(settings.beamwidth_az_deg or DEFAULT_BEAMWIDTH)
    el = math.radians(settings.beamwidth_el_deg or DEFAULT_BEAMWIDTH)
    volume = math.pi * az * el * cell_depth(settings) / (8 * math.log(2))
    band = BANDS_GHZ.index(settings.band_ghz)
    least = 10 ** (settings.least_rcs_dbsm / 10) / REFERENCE_RANGE**4
    return volume * rain_reflectivity(band, mm_per_h) / least


def find_speckle(
    tracer: Tracer,
    events: Events,
    rows: NDArray[np.int64],
    random: Floats,
    settings: SensorSettings,
) -> Speckle:
    """Find the nearest cell of each beam in which rain is detected.

    Args:
        tracer: Tracer of the scene.
        events: EVENT of all rays.
        rows: (N,) the ray that stands for each beam.
        random: (2, N) as in ``BeamDraws``.
        settings: Settings of the sensor.
    """
    n = len(rows)
    speckle = Speckle(np.full(n, np.inf), np.full(n, -1), np.zeros(n), np.zeros(n))
    contrasts = np.zeros(len(tracer.rain_rate))
    for part in np.flatnonzero(tracer.rain_rate).tolist():
        contrasts[part] = contrast(settings, float(tracer.rain_rate[part]))
    around_start = np.zeros(len(contrasts), np.uint8)
    if tracer.air_part >= 0:
        around_start[tracer.air_part] = 1
    cell = cell_depth(settings)
    # All cells are at multiples of their depth; the first is beyond the blind range.
    nearest = (math.floor(max(BLIND_RANGE, settings.min_range) / cell) + 1) * cell
    _find_cells(
        events,
        # Events are sorted by ray.
        BeamDraws(rows, np.searchsorted(events["ray"], rows), random),
        RainField(around_start, contrasts),
        RainLimits(cell, settings.margin_db, nearest, settings.penetration_power),
        speckle,
    )
    return speckle


@njit_inline
def _contrast_at(enclosing: NDArray[np.uint8], contrasts: Floats) -> tuple[float, int]:
    """Return the contrast of the rain around a ray, and the part in which it rains."""
    total, part = 0.0, -1
    for k in range(len(contrasts)):
        if enclosing[k] and contrasts[k] > 0.0:
            total, part = total + contrasts[k], k
    return total, part


@njit_inline
def _search(
    t: float, end: float, cell: float, contrast: float, budget: float
) -> tuple[float, float]:
    """Search cells of constant contrast until rain is detected in one.

    Each cell reduces the budget by its -log(probability that nothing shows), so a
    single exponential random number decides the whole search.

    Returns:
        The distance of the first cell that was not searched, or that shows rain; and
        what is left of the budget, at most 0 if rain shows.
    """
    # Where it does not rain, skip the cells, but stay at multiples of their depth.
    if contrast <= 0.0:
        return t + cell * max(np.ceil((end - t) / cell), 0.0), budget
    while t < end:
        # log1p stays exact where the probability of a detection is tiny.
        budget += np.log1p(-np.exp(-t * t / contrast))
        if budget <= 0.0:
            return t, budget
        t += cell
    return t, budget


@njit_cached
def _find_cells(
    events: Events,
    beams: BeamDraws,
    rain: RainField,
    limits: RainLimits,
    speckle: Speckle,
) -> None:
    """Fill a speckle; see ``find_speckle``."""
    # Beams are searched cell by cell only while it rains around them and their budget
    # lasts; one random number decides a whole search.
    full = limits.full_power
    enclosing = rain.around_start.copy()
    for beam in range(len(beams.rows)):
        for part in range(len(enclosing)):
            enclosing[part] = rain.around_start[part]
        budget, t, i = beams.random[0, beam], limits.nearest, beams.first_event[beam]
        before, power = 0.0, full  # distance and power after the previous event
        while i < len(events) and events[i].ray == beams.rows[beam] and budget > 0.0:
            event: EventRow = events[i]
            contrast, part = _contrast_at(enclosing, rain.contrasts)
            t, budget = _search(t, event.t, limits.cell, contrast, budget)
            if budget <= 0.0:
                # Power falls linearly between events; unlimited power does not fall.
                lost = (power - event.power) * (t - before) if power < np.inf else 0.0
                lost /= event.t - before
                # The exponential distribution has no memory: what a detected cell has
                # above the detection limit is distributed as without the limit.
                level = 10.0 * np.log10(
                    1.0 + contrast / (t * t) * beams.random[1, beam]
                )
                share = (power - lost) / full if 0.0 < full < np.inf else 1.0
                margin = limits.margin_db
                above = min(level, margin) - margin * (1.0 - share)
                if above > 0.0:
                    speckle.t[beam], speckle.part[beam] = t, part
                    speckle.power[beam] = power - lost
                    speckle.strength[beam] = 10.0 ** ((above - margin) / 10.0)
            if event.kind in (START_INSIDE, ENTER):
                enclosing[event.part] = 1
            elif event.kind == LEAVE:
                enclosing[event.part] = 0
            before, power = event.t, event.power - event.absorbed
            i += 1


def add_rain(
    columns: EchoColumns, speckle: Speckle, rows: NDArray[np.int64]
) -> EchoColumns:
    """Insert the echoes of rain among the other echoes of their beams."""
    beams = np.flatnonzero(np.isfinite(speckle.t))
    has_end = np.zeros(len(rows), bool)
    has_end[columns.beam[columns.ends > 0]] = True
    added = EchoColumns(
        beams,
        rows[beams],
        speckle.t[beams],
        np.full(len(beams), EventKind.RAIN, np.uint8),
        speckle.part[beams],
        speckle.power[beams],
        speckle.strength[beams],
        (~has_end[beams]).astype(np.uint8),
        speckle.t[beams],
    )
    return columns.insert(added)
