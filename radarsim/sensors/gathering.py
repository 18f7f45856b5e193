"""From what happened to rays to the echoes of beams.

Theory of operation
===================
What a ray meets answers: each boundary of a volume that it crosses, each sheet, and the
surface or the point at which it ends. An echo is as strong as what the beam loses from
there on to its next echo: an opaque surface gives back all that is left, the near side
of a volume what the volume takes, its far side nothing. So the strengths of a ray that
ends within reach add up to 1, the whole of its power; smoke that takes nothing gives
nothing back; and of a bush before a wall the stronger one is what took more. A beam of
unlimited power is given back whole by what it hits. What a ray loses around its start,
where no boundary is, nobody gives back.

Where several rays answer together, each carries its share of the beam, and the echoes
of all of them are sorted by range. With incidence weights an echo is multiplied by
what a rough surface sends back the way that it came: cos^2 of the angle between ray
and normal, by Lambert's law. What is met in foliage has all directions: 1/3, the mean
of cos^2 over them.

Echoes that are nearer together than the range resolution merge, from the nearest on:
all that is within one cell of the first of them. What is left has the sum of their
strengths, their mean range, weighted by strength, and is of the strongest's kind.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.compiled import compiled, leaf
from radarsim.raycast.penetration import EventKind, Outcome
from radarsim.raycast.rays import Traces

LEAVES: Final = 1 / 3  # mean of cos^2 over all directions of leaves
LAST, FIRST, STRONGEST = 0, 1, 2
ENTER, LEAVE, SHEET = int(EventKind.ENTER), int(EventKind.LEAVE), int(EventKind.SHEET)
HIT, SPENT = int(EventKind.HIT), int(EventKind.SPENT)
ANSWERING = (ENTER, LEAVE, SHEET, HIT, SPENT)


class Columns(NamedTuple):
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

    def take(self, rows: Any) -> "Columns":
        """Give some of the rows, by their numbers or as a slice."""
        columns: Any = [column[rows] for column in self]
        return Columns(*columns)


def send_back(traces: Traces) -> Floats:
    """Give what the end of each ray sends back of what arrives, (N,), 0 to 1.

    Where the incidence was not asked for, everything; of what is nowhere, nothing.
    """
    if not traces.incidence.size:
        return np.isfinite(traces.ranges).astype(np.float64)
    leaves = np.where(np.isfinite(traces.ranges), LEAVES, 0.0)
    return np.where(np.isnan(traces.incidence), leaves, traces.incidence**2)


def gather(
    events: NDArray[np.void],
    weights: Floats,
    of_a_beam: int,
    full: float,
    incidence: Floats,
) -> Columns:
    """Make echoes of events.

    Args:
        events: (V,) EVENT, ray by ray in the order of the way.
        weights: (M,) the share of each ray in its beam; what comes of a ray without
            any is left out.
        of_a_beam: How many rays each beam has.
        full: The power that a ray starts with.
        incidence: (M,) as in ``Traces``, or empty.
    """
    n = len(events)
    columns = Columns(
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n, np.uint8),
        np.zeros(n, np.int64),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n, np.uint8),
    )
    how = (weights, of_a_beam, full, incidence)
    return columns.take(slice(_gather(events, how, columns)))


@leaf
def _share(power: Any, full: Any) -> Any:
    """Give the share of its power that a ray has left."""
    if full == 0.0 or np.isinf(full):
        return 1.0
    return power / full


@leaf
def _strength(events: Any, i: Any, full: Any) -> Any:
    """Give what a ray loses from an event on to the next."""
    event = events[i]
    if event.kind == HIT:
        return _share(event.power - event.kept, full)
    if event.kind == SPENT:
        return 0.0
    after = events[i + 1]
    if after.kind == SPENT:
        return _share(event.power, full)
    return max(_share(event.power, full) - _share(after.power, full), 0.0)


@leaf
def _sent_back(event: Any, incidence: Any) -> Any:
    """Give what is sent back at an event of what arrives there."""
    if not incidence.size:
        return 1.0
    return incidence[event.ray] ** 2 if event.kind == HIT else LEAVES


@leaf
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


@leaf
def _fill(columns: Any, place: Any, events: Any, i: Any, how: Any) -> None:
    weights, of_a_beam, full, incidence = how
    event = events[i]
    kind, ray = event.kind, event.ray
    columns.beam[place] = ray // of_a_beam
    columns.row[place] = ray
    columns.t[place] = event.t
    columns.kind[place] = kind
    columns.part[place] = event.part
    kept = event.kept if kind == HIT else 0.0
    columns.power[place] = event.power - kept
    strength = _strength(events, i, full) * _sent_back(event, incidence)
    columns.strength[place] = weights[ray] * strength
    columns.ends[place] = kind in (HIT, SPENT)


@compiled
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


def ends_of(traces: Traces, rows: NDArray[np.int64], full: float) -> Columns:
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
    return Columns(
        beams,
        rows,
        traces.ranges[rows],
        np.where(hit, HIT, SPENT).astype(np.uint8),
        traces.parts[rows],
        power,
        np.where(hit, share * send_back(traces)[rows], 0.0),
        np.ones(len(rows), np.uint8),
    )


def merge(columns: Columns, cell: float) -> Columns:
    """Merge echoes of a beam that are nearer together than a cell, m."""
    if cell <= 0 or not len(columns.t):
        return columns
    merged = columns.take(np.arange(len(columns.t)))
    return merged.take(slice(_merge(merged, cell)))


@compiled
def _merge(columns: Any, cell: Any) -> Any:
    """Merge in place; give how many are left."""
    left, i, n = 0, 0, len(columns.t)
    while i < n:
        beam, first = columns.beam[i], columns.t[i]
        best, total, mean, ends = i, 0.0, 0.0, 0
        while i < n and columns.beam[i] == beam and columns.t[i] - first < cell:
            strength = columns.strength[i]
            total += strength
            mean += strength * (columns.t[i] - first)
            if strength > columns.strength[best]:
                best = i
            ends = max(ends, columns.ends[i])
            i += 1
        row, kind, part = columns.row[best], columns.kind[best], columns.part[best]
        columns.beam[left] = beam
        columns.row[left] = row
        columns.t[left] = first + mean / total if total > 0.0 else first
        columns.kind[left] = kind
        columns.part[left] = part
        columns.power[left] = columns.power[best]
        columns.strength[left] = total
        columns.ends[left] = ends
        left += 1
    return left


@compiled
def choose(columns: Any, mode: Any, beams: Any, threshold: Any) -> Any:
    """Choose the echo that gives each beam's range.

    What gives nothing back is neither first nor strongest, unless there is nothing
    else: then it is where the ray ends.

    Args:
        columns: Of all echoes.
        mode: ``LAST``, ``FIRST`` or ``STRONGEST``; of equally strong ones the nearest.
        beams: N.
        threshold: What gives back no more than that is as good as nothing.

    Returns:
        (N,) int64, rows of the columns; -1 for a beam without.
    """
    chosen = np.full(beams, -1, np.int64)
    given = np.zeros(beams)
    for i in range(len(columns.t)):
        beam, strength = columns.beam[i], columns.strength[i]
        if mode == LAST:
            if columns.ends[i]:
                chosen[beam] = i
        elif strength > threshold:
            if given[beam] == 0.0 or (mode == STRONGEST and strength > given[beam]):
                chosen[beam] = i
                given[beam] = strength
        elif given[beam] == 0.0 and columns.ends[i]:
            chosen[beam] = i
    return chosen
