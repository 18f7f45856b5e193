"""Turn the events along rays into the echoes of beams.

Theory of operation
===================
Everything that a ray meets returns an echo: each boundary of a volume that it crosses,
each sheet, and the surface or the point at which it ends; how strong each echo is tells
``echo_strength``.

Where the rays of a beam are combined, each carries its share of the beam, and the
echoes of all of them are sorted by range. With incidence weights an echo is multiplied
by what a rough surface returns of the ray: the cosine of the angle between ray and
normal. Rays sample the beam's solid angle, in which a slanted surface of R^2 / cos
returns cos^2 of what it does head-on, by Lambert's law. Leaves face all directions, and
are met in proportion to the cosine: 2/3, the mean of cos^2 over that of cos.

Echoes that a beam cannot resolve are merged, and those that it keeps are selected.

Echoes of a beam that are closer together than the range resolution merge: starting from
the nearest one that returns power, all that is less than the range resolution behind
it, and echoes without strength as close in front of it. The merged echo has the sum of
their strengths and their mean range, weighted by strength. Its kind and object are
those of the strongest end of a ray among them; if no ray ends there, those of the
strongest echo. If that is a volume, the merged echo begins where the ray enters it.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventRow, Events, Outcome
from radarsim.raycast.rays import Traces
from radarsim.sensors.echo_strength import (
    ENTER,
    HIT,
    LEAVE,
    SHEET,
    SPENT,
    Densities,
    EnclosingVolumes,
    EventReturns,
    ReturnLaw,
    compute_strengths,
    find_ranges,
    return_law,
    returned_share,
)

LEAF_BACKSCATTER: Final = 2 / 3  # mean cosine of leaves that rays meet
RETURN_ECHO: Final = (ENTER, LEAVE, SHEET, HIT, SPENT)
SHORT_LIST: Final = 16  # echoes that are sorted by insertion


class EchoColumns(NamedTuple):
    """Echoes, one row each, beam by beam.

    Attributes:
        beam: (E,) int64, the number of the beam.
        row: (E,) int64, the ray, counted over all beams.
        t: (E,) distance from the start of the ray, m; of a volume, that up to which
            half of its power came back.
        kind: (E,) uint8, an ``EventKind``.
        part: (E,) int64, as in ``Traces``.
        power: (E,) power left on arrival, for a hit without what the surface absorbs.
        strength: (E,) share of what a rough wall ahead returns of the whole beam.
        ends: (E,) uint8, whether a ray ends there.
        front: (E,) distance at which the echo begins, m: of a volume, where the ray
            enters it; otherwise as ``t``.
    """

    beam: NDArray[np.int64]
    row: NDArray[np.int64]
    t: Floats
    kind: NDArray[np.uint8]
    part: NDArray[np.int64]
    power: Floats
    strength: Floats
    ends: NDArray[np.uint8]
    front: Floats

    def take(
        self, rows: slice | NDArray[np.integer] | NDArray[np.bool_]
    ) -> "EchoColumns":
        """Return some of the rows, selected by index, mask or slice."""
        columns: list[NDArray[Any]] = [column[rows] for column in self]
        return EchoColumns(*columns)

    def insert(self, added: "EchoColumns") -> "EchoColumns":
        """Return these rows and others, beam by beam, sorted by range."""
        names = EchoColumns._fields
        both = [(getattr(self, name), getattr(added, name)) for name in names]
        joined = EchoColumns(*map(np.concatenate, both))
        return joined.take(np.lexsort([joined.t, joined.beam]))


class BeamRays(NamedTuple):
    """The rays of beams.

    Attributes:
        weights: (M,) the share of each ray in its beam.
        rays_per_beam: How many consecutive rays form a beam.
        incidence: (M,) cosine of the angle of incidence, as in ``Traces``.
    """

    weights: Floats
    rays_per_beam: int
    incidence: Floats


def backscatter(traces: Traces) -> Floats:
    """Return what the end of each ray returns, of what it would head-on, (N,).

    It is 1 for every end without incidence angles, and 0 for a ray without end.
    """
    if not traces.incidence.size:
        return np.isfinite(traces.ranges).astype(np.float64)
    leaves = np.where(np.isfinite(traces.ranges), LEAF_BACKSCATTER, 0.0)
    return np.where(np.isnan(traces.incidence), leaves, traces.incidence)


def extract_echoes(
    traces: Traces,
    weights: Floats,
    rays_per_beam: int,
    densities: Densities,
    settings: SensorSettings,
) -> EchoColumns:
    """Extract the echoes from the events along rays.

    Args:
        traces: The traced rays, with events.
        weights: (M,) the share of each ray in its beam; a ray of weight 0 has no echo.
        rays_per_beam: How many consecutive rays form a beam.
        densities: What the rays lose in the parts and in the air.
        settings: Settings of the sensor.

    Returns:
        The echoes, beam by beam, sorted by range; of equal ranges, in the order of the
        rays and along them.
    """
    events, n = traces.events, len(traces.events)
    columns = EchoColumns(
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n, np.uint8),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, np.uint8),
        np.zeros(n),
    )
    beams = BeamRays(weights, rays_per_beam, traces.incidence)
    count = _extract(events, beams, densities, return_law(settings), *columns)
    return columns if count == n else columns.take(slice(count))


@njit_cached
def _extract(
    events: Events,
    beams: BeamRays,
    densities: Densities,
    law: ReturnLaw,
    *columns: NDArray[Any],
) -> int:
    """Fill columns with the echoes of all events; return how many there are.

    Columns come one by one: numba takes twice as long to unpack tuples of arrays
    (row g of the benchmarks).
    """
    n, parts = len(events), len(densities.parts) + 1
    volumes = EnclosingVolumes(np.zeros(parts, np.int64), np.zeros(parts, np.int64))
    found = EventReturns(np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), volumes)
    compute_strengths(events, densities, law, found)
    find_ranges(events, densities, law, found)
    rows = np.zeros(n, np.int64), np.zeros(n, np.int64)
    order = _EchoOrder(np.zeros(n), rows[0], np.zeros(n), rows[1])
    return _fill_columns(events, beams, found, order, EchoColumns(*columns))


class _EchoOrder(NamedTuple):
    """Echoes of a beam, to be sorted by range, and room for as many.

    Attributes:
        ranges: (V,) m.
        rows: (V,) the event of each.
        spare_ranges: (V,) used while runs are merged, as is ``spare_rows``.
    """

    ranges: Floats
    rows: NDArray[np.int64]
    spare_ranges: Floats
    spare_rows: NDArray[np.int64]


@njit_inline
def _fill_columns(
    events: Events,
    beams: BeamRays,
    found: EventReturns,
    order: _EchoOrder,
    columns: EchoColumns,
) -> int:
    """Fill columns with echoes, beam by beam; return how many there are."""
    of_beam, n = beams.rays_per_beam, len(events)
    total = i = 0
    while i < n:
        beam, count = events[i].ray // of_beam, 0
        while i < n and events[i].ray // of_beam == beam:
            if events[i].kind in RETURN_ECHO and beams.weights[events[i].ray] > 0.0:
                order.ranges[count], order.rows[count] = found.ranges[i], i
                count += 1
            i += 1
        _sort_by_range(order, count)
        for k in range(count):
            _fill_row(columns, total + k, events, order.rows[k], beams, found)
        total += count
    return total


@njit_inline
def _sort_by_range(order: _EchoOrder, count: int) -> None:
    """Sort the first echoes by range; those of equal range keep their order.

    Most lists are short, and the echoes of each ray are sorted already: insertion is
    the fastest. Longer lists are merged from runs that were sorted so. numpy's argsort
    would take seconds to compile.
    """
    for start in range(0, count, SHORT_LIST):
        _sort_run(order, start, min(start + SHORT_LIST, count))
    width = SHORT_LIST
    while width < count:
        for start in range(0, count - width, 2 * width):
            _merge_runs(order, start, start + width, min(start + 2 * width, count))
        width *= 2


@njit_inline
def _sort_run(order: _EchoOrder, start: int, end: int) -> None:
    """Sort the echoes of a short run by insertion."""
    ranges, rows = order.ranges, order.rows
    for k in range(start + 1, end):
        distance, row, i = ranges[k], rows[k], k
        while i > start and ranges[i - 1] > distance:
            ranges[i], rows[i] = ranges[i - 1], rows[i - 1]
            i -= 1
        ranges[i], rows[i] = distance, row


@njit_inline
def _merge_runs(order: _EchoOrder, start: int, middle: int, end: int) -> None:
    """Merge two sorted runs; of equal ranges those of the first run come first."""
    ranges, rows, spare_ranges, spare_rows = order
    for k in range(start, middle):
        spare_ranges[k], spare_rows[k] = ranges[k], rows[k]
    first, second = start, middle
    for k in range(start, end):
        if first == middle:
            return  # the rest is in its place
        if second < end and ranges[second] < spare_ranges[first]:
            ranges[k], rows[k] = ranges[second], rows[second]
            second += 1
        else:
            ranges[k], rows[k] = spare_ranges[first], spare_rows[first]
            first += 1


@njit_inline
def _fill_row(
    columns: EchoColumns,
    row: int,
    events: Events,
    i: Int,
    beams: BeamRays,
    found: EventReturns,
) -> None:
    event: EventRow = events[i]
    kind, ray = event.kind, event.ray
    strength = found.strengths[i]
    if beams.incidence.size:
        hit = kind == HIT
        strength *= beams.incidence[ray] if hit else LEAF_BACKSCATTER
    columns.beam[row] = ray // beams.rays_per_beam
    columns.row[row] = ray
    columns.t[row] = found.ranges[i]
    columns.front[row] = event.t
    columns.kind[row] = kind
    columns.part[row] = event.part
    columns.power[row] = event.power - (event.absorbed if kind == HIT else 0.0)
    # Rounding can add up to a little more than the whole power.
    columns.strength[row] = min(beams.weights[ray] * strength, 1.0)
    columns.ends[row] = kind in (HIT, SPENT)


def extract_ray_ends(
    traces: Traces, rows: NDArray[np.int64], settings: SensorSettings
) -> EchoColumns:
    """Extract only the echoes at the ends of rays, for which no events are needed.

    Args:
        traces: The traced rays.
        rows: (N,) the ray that stands for each beam.
        settings: Settings of the sensor.
    """
    beams = np.flatnonzero(np.isfinite(traces.ranges[rows]))
    rows = rows[beams]
    hit = traces.outcomes[rows] == Outcome.HIT
    power, full = traces.power[rows], settings.penetration_power
    limited = full > 0 and np.isfinite(full)
    share = power / full if limited else np.ones(len(rows))
    strength = returned_share(share, settings) * backscatter(traces)[rows]
    return EchoColumns(
        beams,
        rows,
        traces.ranges[rows],
        np.where(hit, HIT, SPENT).astype(np.uint8),
        traces.parts[rows],
        power,
        np.where(hit, strength, 0.0),
        np.ones(len(rows), np.uint8),
        traces.ranges[rows],
    )


LAST, FIRST, STRONGEST = 0, 1, 2
ROUNDING: Final = 1e-12  # relative difference below which strengths are equal


def merge_echoes(echoes: EchoColumns, resolution: float) -> EchoColumns:
    """Merge echoes of a beam that are closer together than a resolution, m."""
    if resolution <= 0 or not len(echoes.t):
        return echoes
    merged = echoes.take(np.arange(len(echoes.t)))
    return merged.take(slice(_merge_in_place(merged, resolution)))


@njit_inline
def _first_with_power(echoes: EchoColumns, i: int) -> int:
    """Return the first echo of a beam from ``i`` on that has strength or is an end."""
    n, beam = len(echoes.t), echoes.beam[i]
    while i < n and echoes.beam[i] == beam:
        if echoes.strength[i] > 0.0 or echoes.ends[i]:
            return i
        i += 1
    return n


@njit_inline
def _represents(echoes: EchoColumns, one: int, other: int) -> bool:
    """Return whether one echo rather than another gives a merged echo its kind."""
    if echoes.ends[one] != echoes.ends[other]:
        return bool(echoes.ends[one] > echoes.ends[other])
    return bool(echoes.strength[one] > echoes.strength[other] * (1.0 + ROUNDING))


@njit_cached
def _merge_in_place(echoes: EchoColumns, resolution: float) -> int:
    """Merge echoes in place; return how many are left."""
    left, i, n = 0, 0, len(echoes.t)
    while i < n:
        first = _first_with_power(echoes, i)
        if first < n and echoes.t[first] - echoes.t[i] < resolution:
            end = echoes.t[first] + resolution
        else:
            first, end = i, echoes.t[i]  # nothing to merge with
        beam, nearest = echoes.beam[i], echoes.t[first]
        best, total, mean = i, 0.0, 0.0
        j = i
        while j == i or (j < n and echoes.beam[j] == beam and echoes.t[j] < end):
            strength = echoes.strength[j]
            total += strength
            mean += strength * (echoes.t[j] - nearest)
            if _represents(echoes, j, best):
                best = j
            j += 1
        t = nearest + mean / total if total > 0.0 else nearest
        front = echoes.front[best] if echoes.kind[best] == ENTER else t
        _copy_row(echoes, best, left)
        echoes.t[left], echoes.front[left] = t, front
        echoes.strength[left] = min(total, 1.0)
        left += 1
        i = j
    return left


@njit_inline
def _copy_row(echoes: EchoColumns, source: int, target: int) -> None:
    """Copy what a merged echo takes over unchanged."""
    echoes.beam[target] = echoes.beam[source]
    echoes.row[target] = echoes.row[source]
    echoes.kind[target] = echoes.kind[source]
    echoes.part[target] = echoes.part[source]
    echoes.power[target] = echoes.power[source]
    echoes.ends[target] = echoes.ends[source]


@njit_cached
def select_echoes(
    echoes: EchoColumns, mode: int, beams: int, threshold: float
) -> NDArray[np.int64]:
    """Select the echo that gives each beam its range.

    A beam in which no echo is above the threshold has the range at which its ray ends.

    Args:
        echoes: EchoColumns of all beams.
        mode: ``LAST``, ``FIRST`` or ``STRONGEST``; of equally strong ones the nearest.
        beams: N, the number of beams.
        threshold: Strength up to which an echo is neither first nor strongest.

    Returns:
        (N,) int64, rows of the echoes; -1 for a beam without echo.
    """
    selected = np.full(beams, -1, np.int64)
    best = np.zeros(beams)  # strength of the selected echo
    for i in range(len(echoes.t)):
        beam, strength = echoes.beam[i], echoes.strength[i]
        if mode == LAST:
            if echoes.ends[i]:
                selected[beam] = i
        elif strength > threshold:
            if best[beam] == 0.0 or (mode == STRONGEST and strength > best[beam]):
                selected[beam] = i
                best[beam] = strength
        elif best[beam] == 0.0 and echoes.ends[i]:
            selected[beam] = i
    return selected
