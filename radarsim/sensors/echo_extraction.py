"""Turn the events along rays into the echoes of beams.

Theory of operation
===================
Everything that a ray meets returns an echo: each boundary of a volume that it crosses,
each sheet, and the surface or the point at which it ends. The strength of an echo is
the share of power that is lost there: an opaque surface returns all that is left, the
near side of a volume what the volume absorbs, its far side nothing, a sheet its loss.
Where volumes overlap, each is credited with its share of the loss, in proportion to
density. So the strengths of a ray that ends within range add up to 1, its whole power;
smoke that absorbs nothing returns nothing; and of a bush in front of a wall, the one
that takes more power is the stronger echo. A beam of unlimited power is returned whole
by what it hits. Power lost to the air, or to a volume around the ray's start, returns
no echo: there is no boundary.

Where the rays of a beam are combined, each carries its share of the beam, and the
echoes of all of them are sorted by range. With incidence weights an echo is multiplied
by the backscatter of a rough surface: cos^2 of the angle between ray and normal, by
Lambert's law. Leaves face all directions: 1/3, the mean of cos^2 over them.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind, Outcome
from radarsim.raycast.rays import Traces

LEAF_BACKSCATTER: Final = 1 / 3  # mean of cos^2 over all directions of leaves
START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT = map(int, list(EventKind)[:6])
RETURN_ECHO: Final = (ENTER, LEAVE, SHEET, HIT, SPENT)
SHORT_LIST: Final = 16  # echoes that are sorted by insertion


class EchoColumns(NamedTuple):
    """Echoes, one row each, beam by beam.

    Attributes:
        beam: (E,) int64, the number of the beam.
        row: (E,) int64, the ray, counted over all beams.
        t: (E,) distance from the start of the ray, m.
        kind: (E,) uint8, an ``EventKind``.
        part: (E,) int64, as in ``Traces``.
        power: (E,) power left on arrival, for a hit without what the surface absorbs.
        strength: (E,) share of the beam's power.
        ends: (E,) uint8, whether a ray ends there.
    """

    beam: NDArray[np.int64]
    row: NDArray[np.int64]
    t: Floats
    kind: NDArray[np.uint8]
    part: NDArray[np.int64]
    power: Floats
    strength: Floats
    ends: NDArray[np.uint8]

    def take(self, rows: Any) -> "EchoColumns":
        """Return some of the rows, selected by index, mask or slice."""
        columns: Any = [column[rows] for column in self]
        return EchoColumns(*columns)


class Densities(NamedTuple):
    """Power that rays lose per metre.

    Attributes:
        parts: (P,) in each part of the scene.
        air: Power lost per metre in the air.
    """

    parts: Floats
    air: float


class EnclosingVolumes(NamedTuple):
    """Work space for the volumes around the current point of a ray.

    Attributes:
        part: (P + 1,) int64, the part of each volume.
        entry: (P + 1,) int64, the event at which the ray entered each; -1 if it
            started inside.
    """

    part: NDArray[np.int64]
    entry: NDArray[np.int64]


class RayReturns(NamedTuple):
    """The weights and strengths that turn events into echoes.

    Attributes:
        weights: (M,) the share of each ray in its beam.
        rays_per_beam: How many consecutive rays form a beam.
        strengths: (V,) the share of its ray's power that each event returns.
        incidence: (M,) cosine of the angle of incidence, as in ``Traces``.
    """

    weights: Floats
    rays_per_beam: int
    strengths: Floats
    incidence: Floats


def backscatter(traces: Traces) -> Floats:
    """Return the share of arriving power that the end of each ray returns, (N,).

    It is 1 for every end without incidence angles, and 0 for a ray without end.
    """
    if not traces.incidence.size:
        return np.isfinite(traces.ranges).astype(np.float64)
    leaves = np.where(np.isfinite(traces.ranges), LEAF_BACKSCATTER, 0.0)
    return np.where(np.isnan(traces.incidence), leaves, traces.incidence**2)


def extract_echoes(
    traces: Traces,
    weights: Floats,
    rays_per_beam: int,
    densities: tuple[Floats, float],
    settings: SensorSettings,
) -> EchoColumns:
    """Extract the echoes from the events along rays.

    Args:
        traces: The traced rays, with events.
        weights: (M,) the share of each ray in its beam; a ray of weight 0 has no echo.
        rays_per_beam: How many consecutive rays form a beam.
        densities: (P,) power that the rays lose per metre in each part, and in the air.
        settings: Settings of the sensor.

    Returns:
        The echoes, beam by beam, sorted by range; of equal ranges, in the order of the
        rays and along them.
    """
    n = len(traces.events)
    strengths = np.zeros(n)
    size = len(densities[0]) + 1
    volumes = EnclosingVolumes(np.zeros(size, np.int64), np.zeros(size, np.int64))
    full = settings.penetration_power
    _compute_strengths(traces.events, Densities(*densities), full, volumes, strengths)
    columns = EchoColumns(
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n, np.uint8),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, np.uint8),
    )
    returns = RayReturns(weights, rays_per_beam, strengths, traces.incidence)
    return columns.take(slice(_fill_columns(traces.events, returns, columns)))


@njit_inline
def _share_left(event: Any, full: Any) -> Any:
    """Return the share of its power that a ray has left on arrival."""
    if event.kind == SPENT:
        return 0.0
    # There is no share of no power, nor of unlimited power.
    if full == 0.0 or np.isinf(full):
        return 1.0
    return event.power / full


@njit_inline
def _share_absorbed(event: Any, full: Any) -> Any:
    """Return the share of a ray's power that a sheet or a surface absorbs."""
    if full == 0.0 or np.isinf(full):
        return 0.0
    return event.absorbed / full


@njit_inline
def _credit_volumes(
    loss: Any, densities: Any, volumes: Any, count: Any, strengths: Any
) -> None:
    """Add a loss to the echoes of the volumes around a ray, in proportion to density.

    The echo of a volume is that of its near side.
    """
    total = densities.air
    for k in range(count):
        total += densities.parts[volumes.part[k]]
    if loss <= 0.0 or total <= 0.0:
        return
    # A volume around the start has no near side; its share, like the air's, returns no
    # echo.
    for k in range(count):
        entry = volumes.entry[k]
        if entry >= 0:
            strengths[entry] += loss * densities.parts[volumes.part[k]] / total


@njit_inline
def _update_volumes(events: Any, i: Any, volumes: Any, count: Any) -> Any:
    """Enter or leave the volume of an event; return how many enclose the ray."""
    event = events[i]
    if event.kind in (ENTER, START_INSIDE):
        volumes.part[count] = event.part
        volumes.entry[count] = i if event.kind == ENTER else -1
        return count + 1
    if event.kind == LEAVE:
        for k in range(count):
            if volumes.part[k] == event.part:
                # The order of the volumes does not matter: the last one fills the gap.
                volumes.part[k] = volumes.part[count - 1]
                volumes.entry[k] = volumes.entry[count - 1]
                return count - 1
    return count


@njit_cached
def _compute_strengths(
    events: Any, densities: Any, full: Any, volumes: Any, strengths: Any
) -> None:
    """Compute the share of its ray's power that each event returns.

    Args:
        events: (V,) EVENT of all rays, ray by ray.
        densities: Densities of the parts and of the air.
        full: Power with which a ray starts.
        volumes: Work space.
        strengths: (V,) zeros, to be filled.
    """
    ray, count, left = np.int64(-1), 0, 0.0
    for i in range(len(events)):
        event = events[i]
        if event.ray != ray:
            ray, count, left = event.ray, 0, 1.0
        arriving, absorbed = _share_left(event, full), _share_absorbed(event, full)
        # What is missing since the previous event was lost inside the volumes
        _credit_volumes(left - arriving, densities, volumes, count, strengths)
        if event.kind == HIT:
            strengths[i] = arriving - absorbed
        elif event.kind == SHEET:
            strengths[i] = absorbed
        left = arriving - absorbed
        count = _update_volumes(events, i, volumes, count)


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


@njit_cached
def _fill_columns(events: Any, returns: Any, columns: Any) -> Any:
    """Fill columns with echoes, beam by beam; return how many there are."""
    of_beam, n = returns.rays_per_beam, len(events)
    ranges, rows = np.zeros(n), np.zeros(n, np.int64)
    order = _EchoOrder(ranges, rows, np.zeros(n), np.zeros(n, np.int64))
    total = i = 0
    while i < n:
        beam, count = events[i].ray // of_beam, 0
        while i < n and events[i].ray // of_beam == beam:
            if events[i].kind in RETURN_ECHO and returns.weights[events[i].ray] > 0.0:
                ranges[count], rows[count] = events[i].t, i
                count += 1
            i += 1
        if of_beam > 1:  # the events of a single ray are sorted already
            _sort_by_range(order, count)
        for k in range(count):
            _fill_row(columns, total + k, events, rows[k], returns)
        total += count
    return total


@njit_inline
def _sort_by_range(order: Any, count: Any) -> None:
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
def _sort_run(order: Any, start: Any, end: Any) -> None:
    """Sort the echoes of a short run by insertion."""
    ranges, rows = order.ranges, order.rows
    for k in range(start + 1, end):
        distance, row, i = ranges[k], rows[k], k
        while i > start and ranges[i - 1] > distance:
            ranges[i], rows[i] = ranges[i - 1], rows[i - 1]
            i -= 1
        ranges[i], rows[i] = distance, row


@njit_inline
def _merge_runs(order: Any, start: Any, middle: Any, end: Any) -> None:
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
def _fill_row(columns: Any, row: Any, events: Any, i: Any, returns: Any) -> None:
    event = events[i]
    kind, ray = event.kind, event.ray
    strength = returns.strengths[i]
    if returns.incidence.size:
        hit = kind == HIT
        strength *= returns.incidence[ray] ** 2 if hit else LEAF_BACKSCATTER
    columns.beam[row] = ray // returns.rays_per_beam
    columns.row[row] = ray
    columns.t[row] = event.t
    columns.kind[row] = kind
    columns.part[row] = event.part
    columns.power[row] = event.power - (event.absorbed if kind == HIT else 0.0)
    # Rounding can add up to a little more than the whole power.
    columns.strength[row] = min(returns.weights[ray] * strength, 1.0)
    columns.ends[row] = kind in (HIT, SPENT)


def extract_ray_ends(
    traces: Traces, rows: NDArray[np.int64], full: float
) -> EchoColumns:
    """Extract only the echoes at the ends of rays, for which no events are needed.

    Args:
        traces: The traced rays.
        rows: (N,) the ray that stands for each beam.
        full: Power with which a ray starts.
    """
    beams = np.flatnonzero(np.isfinite(traces.ranges[rows]))
    rows = rows[beams]
    hit = traces.outcomes[rows] == Outcome.HIT
    power = traces.power[rows]
    limited = full > 0 and np.isfinite(full)
    share = power / full if limited else np.ones(len(rows))
    return EchoColumns(
        beams,
        rows,
        traces.ranges[rows],
        np.where(hit, HIT, SPENT).astype(np.uint8),
        traces.parts[rows],
        power,
        np.where(hit, share * backscatter(traces)[rows], 0.0),
        np.ones(len(rows), np.uint8),
    )
