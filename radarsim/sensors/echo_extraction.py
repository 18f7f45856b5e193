"""From what happened to rays to the echoes of beams.

Theory of operation
===================
What a ray meets answers: each boundary of a volume that it crosses, each sheet, and the
surface or the point at which it ends. An echo is as strong as what is lost to it: an
opaque surface gives back all that is left, the near side of a volume what the volume
takes, its far side nothing, a sheet its loss; where volumes overlap, each takes its
share of what is lost, by density. So the strengths of a ray that ends within reach add
up to 1, the whole of its power; smoke that takes nothing gives nothing back; and of a
bush before a wall the stronger one is what took more. A beam of unlimited power is
given back whole by what it hits. What is lost to the air, or to a volume around the
ray's start, nobody gives back: there is no boundary.

Where several rays answer together, each carries its share of the beam, and the echoes
of all of them are sorted by range. With incidence weights an echo is multiplied by
what a rough surface sends back the way that it came: cos^2 of the angle between ray
and normal, by Lambert's law. What is met in foliage has all directions: 1/3, the mean
of cos^2 over them.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind, Outcome
from radarsim.raycast.rays import Traces

LEAVES: Final = 1 / 3  # mean of cos^2 over all directions of leaves
START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT = map(int, list(EventKind)[:6])
ANSWERING = (ENTER, LEAVE, SHEET, HIT, SPENT)


class EchoColumns(NamedTuple):
    """Echoes, a row each, beam by beam.

    Attributes:
        beam: (E,) int64.
        row: (E,) int64, the ray, counted over all beams.
        t: (E,) m.
        kind: (E,) uint8, an ``EventKind``.
        part: (E,) int64, as in ``Traces``.
        power: (E,) left on arrival; of a hit, what comes back.
        strength: (E,) share of the beam.
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
        """Give some of the rows, by their numbers or as a slice."""
        columns: Any = [column[rows] for column in self]
        return EchoColumns(*columns)


def backscatter(traces: Traces) -> Floats:
    """Give what the end of each ray sends back of what arrives, (N,), 0 to 1.

    Where the incidence was not asked for, everything; of what is nowhere, nothing.
    """
    if not traces.incidence.size:
        return np.isfinite(traces.ranges).astype(np.float64)
    leaves = np.where(np.isfinite(traces.ranges), LEAVES, 0.0)
    return np.where(np.isnan(traces.incidence), leaves, traces.incidence**2)


def extract_echoes(
    traces: Traces,
    weights: Floats,
    of_a_beam: int,
    densities: tuple[Floats, float],
    settings: SensorSettings,
) -> EchoColumns:
    """Make echoes of what happened to rays.

    Args:
        traces: With events.
        weights: (M,) the share of each ray in its beam; what comes of a ray without
            any is left out.
        of_a_beam: How many rays each beam has.
        densities: (P,) power that the rays lose per metre in each part, and what they
            lose in the air.
        settings: Of the sensor.
    """
    n = len(traces.events)
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
    strengths = np.zeros(n)
    full = settings.penetration_power
    around = np.zeros((2, len(densities[0]) + 1), np.int64)
    _give_back(traces.events, densities, full, around, strengths)
    how = (weights, of_a_beam, strengths, traces.incidence)
    return columns.take(slice(_gather(traces.events, how, columns)))


@njit_inline
def _share(event: Any, full: Any) -> Any:
    """Give the share of its power that a ray has left on arrival."""
    if event.kind == SPENT:
        return 0.0
    if full == 0.0 or np.isinf(full):
        return 1.0
    return event.power / full


@njit_inline
def _share_kept(event: Any, full: Any) -> Any:
    """Give the share that is lost at a place."""
    if full == 0.0 or np.isinf(full):
        return 0.0
    return event.absorbed / full


@njit_inline
def _split(lost: Any, densities: Any, around: Any, count: Any, strengths: Any) -> None:
    """Give each volume around a ray its share of what is lost, at where it begins."""
    of_parts, total = densities
    for k in range(count):
        total += of_parts[around[0, k]]
    if lost <= 0.0 or total <= 0.0:
        return
    for k in range(count):
        entry = around[1, k]
        if entry >= 0:
            strengths[entry] += lost * of_parts[around[0, k]] / total


@njit_inline
def _note(events: Any, i: Any, around: Any, count: Any) -> Any:
    """Keep the account of the parts around a ray; give how many they are."""
    event = events[i]
    if event.kind in (ENTER, START_INSIDE):
        around[0, count] = event.part
        around[1, count] = i if event.kind == ENTER else -1
        return count + 1
    return _leave(around, count, event.part) if event.kind == LEAVE else count


@njit_cached
def _give_back(
    events: Any, densities: Any, full: Any, around: Any, strengths: Any
) -> None:
    """Work out what share of its beam each event gives back.

    Args:
        events: Of all rays.
        densities: (P,) of the parts, and of the air.
        full: The power that a ray starts with.
        around: (2, P + 1) room for the parts around a ray, and where it entered them.
        strengths: (V,) zeros, to be filled.
    """
    ray, count, left = np.int64(-1), 0, 0.0
    for i in range(len(events)):
        event = events[i]
        if event.ray != ray:
            ray, count, left = event.ray, 0, 1.0
        arriving, kept = _share(event, full), _share_kept(event, full)
        _split(left - arriving, densities, around, count, strengths)
        if event.kind == HIT:
            strengths[i] = arriving - kept
        elif event.kind == SHEET:
            strengths[i] = kept
        left = arriving - kept
        count = _note(events, i, around, count)


@njit_inline
def _leave(around: Any, count: Any, part: Any) -> Any:
    """Take a part out of those around a ray; give how many are left."""
    for k in range(count):
        if around[0, k] == part:
            around[0, k], around[1, k] = around[0, count - 1], around[1, count - 1]
            return count - 1
    return count


@njit_inline
def _sent_back(event: Any, incidence: Any) -> Any:
    """Give what is sent back at an event of what arrives there."""
    if not incidence.size:
        return 1.0
    return incidence[event.ray] ** 2 if event.kind == HIT else LEAVES


@njit_inline
def _sort(keys: Any, picked: Any, count: Any) -> None:
    """Sort events by range, of equal ones the first first: Shell's sort.

    Args:
        keys: Ranges, m.
        picked: The events that they are of.
        count: How many of both.
    """
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for start in range(gap, count):
            i, key, event = start, keys[start], picked[start]
            while i >= gap and (
                keys[i - gap] > key
                or (keys[i - gap] == key and picked[i - gap] > event)
            ):
                keys[i], picked[i] = keys[i - gap], picked[i - gap]
                i -= gap
            keys[i], picked[i] = key, event
        gap //= 3


@njit_inline
def _fill(columns: Any, place: Any, events: Any, i: Any, how: Any) -> None:
    weights, of_a_beam, strengths, incidence = how
    event = events[i]
    kind, ray = event.kind, event.ray
    columns.beam[place] = ray // of_a_beam
    columns.row[place] = ray
    columns.t[place] = event.t
    columns.kind[place] = kind
    columns.part[place] = event.part
    kept = event.absorbed if kind == HIT else 0.0
    columns.power[place] = event.power - kept
    strength = strengths[i] * _sent_back(event, incidence)
    columns.strength[place] = min(weights[ray] * strength, 1.0)
    columns.ends[place] = kind in (HIT, SPENT)


@njit_cached
def _gather(events: Any, how: Any, columns: Any) -> Any:
    """Fill columns, beam by beam; give how many rows there are."""
    weights, of_a_beam, _, _ = how
    keys, picked = np.zeros(len(events)), np.zeros(len(events), np.int64)
    total = i = 0
    while i < len(events):
        beam, count = events[i].ray // of_a_beam, 0
        while i < len(events) and events[i].ray // of_a_beam == beam:
            answers = events[i].kind in ANSWERING
            if answers and weights[events[i].ray] > 0.0:
                picked[count] = i
                keys[count] = events[i].t
                count += 1
            i += 1
        if of_a_beam > 1:
            _sort(keys, picked, count)
        for k in range(count):
            _fill(columns, total + k, events, picked[k], how)
        total += count
    return total


def ray_ends(traces: Traces, rows: NDArray[np.int64], full: float) -> EchoColumns:
    """Make echoes of the ends of rays alone.

    Args:
        traces: Of rays.
        rows: (N,) the ray that answers for each beam.
        full: The power that a ray starts with.
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
