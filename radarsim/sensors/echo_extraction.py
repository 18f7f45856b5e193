"""Turn the events along rays into the echoes of beams.

Theory of operation
===================
Everything that a ray meets returns an echo: each boundary of a volume that it crosses,
each sheet, and the surface or the point at which it ends. The strength of an echo is
its power as a share of what comes back from a rough wall that the whole beam meets
head-on, with nothing before it. Penetration power counts decibels one way; the sensor's
margin is what a beam can lose out and back. So of a ray that has a share p of its power
left, T = 10^(-margin (1 - p) / 10) would come back. An opaque surface returns the T of
what is left there; a volume the difference between its two sides, and a sheet that
before and behind it. Where volumes overlap, each is credited with its share of the
loss, in proportion to density. This holds for plants, which scatter a fifth of what
they take, before walls that return a tenth of what arrives: the strengths of a ray that
ends within range then add up to 1, and what does not come back from the wall comes back
from what is before it. What has another albedo returns more or less than plants, and
smoke nothing. A beam of unlimited power is returned whole by what it hits. Power lost
to the air, or to a volume around the ray's start, returns no echo: there is no
boundary.

A volume answers all along the ray's way through it, and its echo has one range: up to
there half of its power has come back. A sensor that keeps first echoes triggers on
their leading edge instead, which is where the ray enters.

Where the rays of a beam are combined, each carries its share of the beam, and the
echoes of all of them are sorted by range. With incidence weights an echo is multiplied
by what a rough surface returns of the ray: the cosine of the angle between ray and
normal. Rays sample the beam's solid angle, in which a slanted surface of R^2 / cos
returns cos^2 of what it does head-on, by Lambert's law. Leaves face all directions, and
are met in proportion to the cosine: 2/3, the mean of cos^2 over that of cos.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind, Outcome
from radarsim.raycast.rays import Traces

LEAF_BACKSCATTER: Final = 2 / 3  # mean cosine of leaves that rays meet
NOTHING_LEFT: Final = 1e-12  # share of a ray's power
START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT = map(int, list(EventKind)[:6])
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

    def take(self, rows: Any) -> "EchoColumns":
        """Return some of the rows, selected by index, mask or slice."""
        columns: Any = [column[rows] for column in self]
        return EchoColumns(*columns)


class Densities(NamedTuple):
    """Power that rays lose per metre, and what returns of it.

    Attributes:
        parts: (P,) Power lost per metre in each part of the scene.
        air: Power lost per metre in the air.
        scattering: (P,) what each part scatters of a loss, relative to foliage.
    """

    parts: Floats
    air: float
    scattering: Floats


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
        strengths: (V,) the strength of each event's echo, had its ray the whole beam.
        ranges: (V,) m, the range of the echo.
        incidence: (M,) cosine of the angle of incidence, as in ``Traces``.
    """

    weights: Floats
    rays_per_beam: int
    strengths: Floats
    ranges: Floats
    incidence: Floats


class ReturnLaw(NamedTuple):
    """How a ray's power determines what comes back.

    Attributes:
        full: Power with which a ray starts.
        nepers: Natural logarithm of the ratio between what comes back of a ray with all
            its power and of one with none.
        spreads: Whether the echo of a volume has the range of half its power, instead
            of that at which it begins.
    """

    full: float
    nepers: float
    spreads: bool


class Stretch(NamedTuple):
    """A part of a ray's way along which the volumes around it are the same.

    Attributes:
        near: m, where it begins.
        far: m, where it ends.
        before: Share of its power that the ray has at its beginning.
        behind: The same at its end.
        loss: What does not come back from behind it, of what would from before it.
    """

    near: float
    far: float
    before: float
    behind: float
    loss: float


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
    n = len(traces.events)
    strengths, ranges = np.zeros(n), traces.events["t"].copy()
    size = len(densities.parts) + 1
    volumes = EnclosingVolumes(np.zeros(size, np.int64), np.zeros(size, np.int64))
    law = return_law(settings)
    _compute_strengths(traces.events, densities, law, volumes, strengths, ranges)
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
    returns = RayReturns(weights, rays_per_beam, strengths, ranges, traces.incidence)
    return columns.take(slice(_fill_columns(traces.events, returns, columns)))


def return_law(settings: SensorSettings) -> ReturnLaw:
    """Return the law of a sensor."""
    full = settings.penetration_power
    # There is no share of no power, nor of unlimited power.
    full = full if math.isfinite(full) else 0.0
    nepers = settings.margin_db * math.log(10) / 10
    return ReturnLaw(full, nepers, settings.return_mode != "first")


def returned_share(share: Any, settings: SensorSettings) -> Any:
    """Return what comes back of rays that have these shares of their power left."""
    returned = np.exp(return_law(settings).nepers * (np.asarray(share) - 1.0))
    return np.where(np.asarray(share) > NOTHING_LEFT, returned, 0.0)


@njit_inline
def _share_left(event: Any, law: Any) -> Any:
    """Return the share of its power that a ray has left on arrival."""
    if event.kind == SPENT:
        return 0.0
    return event.power / law.full if law.full > 0.0 else 1.0


@njit_inline
def _share_behind(event: Any, law: Any) -> Any:
    """Return the share of its power that a ray has left behind a sheet or a surface."""
    if event.kind == SPENT:
        return 0.0
    return (event.power - event.absorbed) / law.full if law.full > 0.0 else 1.0


@njit_inline
def _returned(share: Any, law: Any) -> Any:
    """Return what comes back of a ray that has a share of its power left."""
    if share <= NOTHING_LEFT:
        return 0.0
    return np.exp(law.nepers * (share - 1.0))


@njit_inline
def _total_density(densities: Any, volumes: Any, count: Any) -> Any:
    total = densities.air
    for k in range(count):
        total += densities.parts[volumes.part[k]]
    return total


@njit_inline
def _credit_volumes(
    stretch: Any, densities: Any, volumes: Any, count: Any, strengths: Any
) -> None:
    """Add the loss along a stretch to the echoes of the volumes around the ray.

    They share it in proportion to density. The echo of a volume is that of its near
    side.
    """
    total = _total_density(densities, volumes, count)
    if stretch.loss <= 0.0 or total <= 0.0:
        return
    # A volume around the start has no near side; its share, like the air's, returns no
    # echo.
    for k in range(count):
        entry = volumes.entry[k]
        if entry >= 0:
            part = volumes.part[k]
            share = densities.parts[part] / total * densities.scattering[part]
            strengths[entry] += stretch.loss * share


@njit_inline
def _find_middles(stretch: Any, densities: Any, law: Any, found: Any) -> None:
    """Find the ranges up to which half of the power of volumes has come back.

    Args:
        stretch: The next stretch of the ray.
        densities: Densities of the parts and of the air.
        law: The ReturnLaw.
        found: The volumes around the ray, how many these are, what is missing to half
            of the strength of each event, and the ranges to be set.
    """
    volumes, count, missing, ranges = found
    total = _total_density(densities, volumes, count)
    if stretch.loss <= 0.0 or total <= 0.0:
        return
    for k in range(count):
        entry, part = volumes.entry[k], volumes.part[k]
        share = densities.parts[part] / total * densities.scattering[part]
        if entry < 0 or share <= 0.0 or missing[entry] <= 0.0:
            continue
        credit = stretch.loss * share
        if credit >= missing[entry]:
            left = _returned(stretch.before, law) - missing[entry] / share
            at = 1.0 + np.log(left) / law.nepers if left > 0.0 else stretch.behind
            lost = (stretch.before - at) / (stretch.before - stretch.behind)
            depth = min(max(lost, 0.0), 1.0) * (stretch.far - stretch.near)
            ranges[entry] = stretch.near + depth
        missing[entry] -= credit


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
    events: Any, densities: Any, law: Any, volumes: Any, strengths: Any, ranges: Any
) -> None:
    """Compute what each event returns of its ray, and the ranges of volumes.

    Args:
        events: (V,) EVENT of all rays, ray by ray.
        densities: Densities of the parts and of the air.
        law: The ReturnLaw.
        volumes: Work space.
        strengths: (V,) zeros, to be filled.
        ranges: (V,) m, where the events are; those of entered volumes are changed.
    """
    missing = np.zeros(len(events))
    # The second time all strengths are known, and so are the halves of them.
    for is_second in (False, True):
        ray, count, near, before = np.int64(-1), 0, 0.0, 1.0
        for i in range(len(events)):
            event = events[i]
            if event.ray != ray:
                ray, count, near, before = event.ray, 0, 0.0, 1.0
            arriving, behind = _share_left(event, law), _share_behind(event, law)
            loss = _returned(before, law) - _returned(arriving, law)
            stretch = Stretch(near, event.t, before, arriving, loss)
            if is_second:
                found = volumes, count, missing, ranges
                _find_middles(stretch, densities, law, found)
                missing[i] = strengths[i] / 2.0 if event.kind == ENTER else 0.0
            else:
                _credit_volumes(stretch, densities, volumes, count, strengths)
                if event.kind == HIT:
                    strengths[i] = _returned(behind, law)
                elif event.kind == SHEET:
                    lost = _returned(arriving, law) - _returned(behind, law)
                    strengths[i] = lost * densities.scattering[event.part]
            near, before = event.t, behind
            count = _update_volumes(events, i, volumes, count)
        if not law.spreads:
            return


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
                ranges[count], rows[count] = returns.ranges[i], i
                count += 1
            i += 1
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
        strength *= returns.incidence[ray] if hit else LEAF_BACKSCATTER
    columns.beam[row] = ray // returns.rays_per_beam
    columns.row[row] = ray
    columns.t[row] = returns.ranges[i]
    columns.front[row] = event.t
    columns.kind[row] = kind
    columns.part[row] = event.part
    columns.power[row] = event.power - (event.absorbed if kind == HIT else 0.0)
    # Rounding can add up to a little more than the whole power.
    columns.strength[row] = min(returns.weights[ray] * strength, 1.0)
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
