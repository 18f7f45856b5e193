"""Echoes of the air: rain in radar scans, and smoke, dust and fog in laser scans.

Rain
====
Radars detect rain as speckle near the sensor.

Within a hundred metres, rain absorbs almost nothing of a radar beam, but its drops
scatter power back. A cell of the beam at range R, one range resolution deep, has a
volume of pi R^2 az el dR / (8 ln 2) m^3, for half-power widths az and el; the volume
times the reflectivity of the rain is the mean cross section. The drops' echoes add up
with random phases, so the power of a cell is distributed exponentially. The smallest
detectable cross section grows with R^4. So a cell is detected with the probability
exp(-1/q), where the contrast q, the ratio of the mean to the smallest cross section,
falls with R^2: rain is detected near the radar.

The nearest detected cell of each beam becomes an echo. An unobstructed wall exceeds the
detection limit by the sensor's margin. The strength of a rain echo is its level above
the limit, minus the two-way loss of the beam up to the cell, dB, relative to the
margin, so walls are stronger. If the remaining level is not above the limit, the beam
has no rain echo. A beam without another end ends at the rain echo.

Nothing is detected below ``BLIND_RANGE`` or the sensor's minimum range, where the
antenna receives its own signal.

Smoke, dust and fog
===================
Clouds of smoke, dust and fog return light to lasers that read first returns.

Each particle of a cloud scatters light back, so a beam can return from any depth. At a
depth of r metres in a cloud, the share exp(-2 a r) of the beams has not returned yet,
since the light travels both ways; a is the one-way extinction coefficient, 1/m:
ln(10) / 10 times the decibels per metre, summed over overlapping clouds. So the optical
depth 2 a r of the return is distributed exponentially with mean 1; it is drawn once for
each beam. The same law holds for a beam that starts inside a cloud. A beam that hits a
surface before that depth reads the surface, even if its echo is weak.

The optical depth of a path in a cloud is the share of penetration power that a beam
loses there times the sensor's margin in nepers, since the margin is two-way.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import BANDS_GHZ, SensorSettings
from radarsim.raycast.rays import EventKind, Events
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import rain_reflectivity
from radarsim.sensors.echo_extraction import (
    ECHO,
    EchoTable,
    insert_echoes,
    return_law,
    returned_share,
)

BLIND_RANGE: Final = 1.0  # m; nearer rain is not detected
DEFAULT_CELL: Final = 0.25  # m, for a sensor without range resolution
DEFAULT_BEAMWIDTH: Final = 2.0  # degrees, for a sensor without beamwidth
REFERENCE_RANGE: Final = 10.0  # m, where ``least_rcs_dbsm`` holds


def cell_depth(settings: SensorSettings) -> float:
    """Return the depth of a range cell of a sensor, m."""
    return settings.range_resolution or settings.range_quantum or DEFAULT_CELL


def contrast(settings: SensorSettings, mm_per_h: float) -> float:
    """Return the ratio of rain echo to detection limit at 1 m; it falls as 1/R^2."""
    az = math.radians(settings.beamwidth_az_deg or DEFAULT_BEAMWIDTH)
    el = math.radians(settings.beamwidth_el_deg or DEFAULT_BEAMWIDTH)
    volume = math.pi * az * el * cell_depth(settings) / (8 * math.log(2))
    band = BANDS_GHZ.index(settings.band_ghz)
    least = 10 ** (settings.least_rcs_dbsm / 10) / REFERENCE_RANGE**4
    return volume * rain_reflectivity(band, mm_per_h) / least


def find_rain(
    tracer: Tracer,
    events: Events,
    rays: NDArray[np.int64],
    random: Floats,
    settings: SensorSettings,
) -> EchoTable:
    """Return, for each beam, the echo of the nearest range cell with detected rain.

    Args:
        tracer: Tracer of the scene.
        events: EVENT of all rays, sorted by ray.
        rays: (N,) index of the ray that represents each beam, in ascending order.
        random: (2, N) exponentially distributed numbers with mean 1, for the range of
            the detected cell and for its power.
        settings: Settings of the sensor.
    """
    contrasts = np.zeros(len(tracer.rain_rate))
    for part in np.flatnonzero(tracer.rain_rate).tolist():
        contrasts[part] = contrast(settings, float(tracer.rain_rate[part]))
    cell = cell_depth(settings)
    # Range cells are at multiples of their depth; the first is beyond the blind range.
    nearest = (math.floor(max(BLIND_RANGE, settings.min_range) / cell) + 1) * cell
    echoes = np.zeros(len(rays), ECHO)
    count = engine.find_rain(
        events,
        rays,
        random,
        tracer.air_part,
        contrasts,
        cell,
        settings.margin_db,
        nearest,
        settings.penetration_power,
        echoes,
    )
    return echoes[:count]


def add_rain(echoes: EchoTable, rain: EchoTable) -> EchoTable:
    """Return all echoes, including rain, sorted by beam and then by range."""
    rain["ends"] = ~np.isin(rain["beam"], echoes["beam"][echoes["ends"]])
    return insert_echoes(echoes, rain)


Rows = NDArray[np.int64]


def answer_in_clouds(
    echoes: EchoTable,
    events: Events,
    density: Floats,
    drawn: Floats,
    settings: SensorSettings,
) -> EchoTable:
    """Replace echoes at the boundaries of clouds by echoes from inside the clouds.

    A beam ends at its return. The echo has the kind ``ENTER``, is marked as an end, and
    begins where the ray enters the cloud, or at the sensor.

    Args:
        echoes: All echoes of beams of one ray each.
        events: EVENT of all rays.
        density: (P,) power lost per metre in each part that is a cloud; otherwise 0.
        drawn: (J, N) optical depth of the return of each beam of J scans.
        settings: Settings of the sensor.
    """
    full, nepers, _ = return_law(settings)
    change = _density_changes(events, density)
    beams, ranges, before = _find_answers(events, change, drawn * full / nepers)
    last = np.full(drawn.size, np.inf)
    last[beams] = ranges
    is_edge = echoes["kind"] == EventKind.ENTER
    is_edge[is_edge] = density[echoes["part"][is_edge]] > 0
    is_kept = ~is_edge & (echoes["t"] <= last[echoes["beam"]])
    kept = echoes.take(np.flatnonzero(is_kept))
    around = _innermost_clouds(events, change, beams, before)
    near = events["t"][before - 1]
    left = events["power"][before - 1] - events["absorbed"][before - 1]
    way = events["t"][before] - near
    gone = np.divide(ranges - near, way, out=np.zeros(len(way)), where=way > 0)
    power = left + gone * (events["power"][before] - left)
    added = np.zeros(len(beams), ECHO)
    added["beam"] = added["row"] = beams
    added["t"], added["front"] = ranges, events["t"][around]
    added["part"], added["power"] = events["part"][around], power
    added["strength"] = returned_share(power / full, settings)
    added["kind"], added["ends"] = EventKind.ENTER, True
    return insert_echoes(kept, added)


def _density_changes(events: Events, density: Floats) -> Floats:
    """Return by how much the density of clouds changes at each event on a ray, (V,)."""
    kinds, change = events["kind"], np.zeros(len(events))
    entering = EventKind.ENTER, EventKind.START_INSIDE
    for kinds_of, sign in ((entering, 1.0), ((EventKind.LEAVE,), -1.0)):
        rows = np.isin(kinds, kinds_of)
        change[rows] = sign * density[events["part"][rows]]
    return change


def _find_answers(
    events: Events, change: Floats, budgets: Floats
) -> tuple[Rows, Floats, Rows]:
    """Find the range at which each beam has lost a given power in clouds.

    Returns:
        For the A beams that return in a cloud: (A,) the number of the beam, the range,
        m, and the next event behind the return.
    """
    budget, (scans, size) = budgets.ravel(), budgets.shape
    rays, t = events["ray"], events["t"]
    first = np.searchsorted(rays, np.arange(len(budget)))[rays]
    # Each scan has its own sum, so its rounding errors do not depend on other scans.
    cuts = np.searchsorted(rays, np.arange(1, scans) * size)
    # The sum of all density changes before each event, over all rays of a scan.
    before = _sums(change, cuts) - change
    inside = before - before[first]
    lost = _sums(inside * np.diff(t, prepend=0.0), cuts)
    lost -= lost[first]
    reached = np.flatnonzero((lost > budget[rays]) & (inside > 0))
    beams, rows = np.unique(rays[reached], return_index=True)
    stops = reached[rows]
    ranges = t[stops] - (lost[stops] - budget[beams]) / inside[stops]
    return beams, np.clip(ranges, t[stops - 1], t[stops]), stops


def _sums(values: Floats, cuts: Rows) -> Floats:
    return np.concatenate([np.cumsum(some) for some in np.split(values, cuts)])


def _innermost_clouds(
    events: Events, change: Floats, beams: Rows, before: Rows
) -> Rows:
    """Return the event at which each beam entered the cloud that returned it, (A,).

    Args:
        events: All events.
        change: (V,) change of the cloud density at each event.
        beams: (A,) beam of each return.
        before: (A,) next event behind each return.
    """
    rays, parts, rows = events["ray"], events["part"], np.flatnonzero(change)
    # The next event of the same part on the same ray is the exit, since a ray must
    # leave a part before it can enter the part again.
    order = rows[np.lexsort((rows, parts[rows], rays[rows]))]
    one, other = order[:-1], order[1:]
    same = (rays[one] == rays[other]) & (parts[one] == parts[other])
    leaves = np.full(len(events), len(events))
    leaves[one[same]] = other[same]
    stops = np.full(rays.max(initial=0) + 1, -1)
    stops[beams] = before
    entered = rows[change[rows] > 0]
    stop = stops[rays[entered]]
    around = entered[(entered < stop) & (stop <= leaves[entered])]
    last = np.full(len(stops), -1)
    np.maximum.at(last, rays[around], around)
    return last[beams]
