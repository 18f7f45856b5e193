"""Which echoes a beam keeps, and which it cannot tell apart.

Echoes of a beam that are too near together to be told apart merge: from the nearest
one that gives something back on, all that is less than the range resolution behind it,
and what gives nothing back as near before it. What is left has the sum of their
strengths and their mean range, weighted by strength. It is of the kind and the object
of the strongest end of a ray among them; if no ray ends there, of the strongest echo.
"""

from typing import Any, Final

import numpy as np

from radarsim.jit import njit_cached, njit_inline
from radarsim.sensors.echo_extraction import EchoColumns

LAST, FIRST, STRONGEST = 0, 1, 2
ROUNDING: Final = 1e-12  # strengths that differ by less are the same


def merge(columns: EchoColumns, cell: float) -> EchoColumns:
    """Merge echoes of a beam that are nearer together than a cell, m."""
    if cell <= 0 or not len(columns.t):
        return columns
    merged = columns.take(np.arange(len(columns.t)))
    return merged.take(slice(_merge(merged, cell)))


@njit_inline
def _first_giving(columns: Any, i: Any) -> Any:
    """Give the first echo of a beam from ``i`` on that gives back, or is an end."""
    n, beam = len(columns.t), columns.beam[i]
    while i < n and columns.beam[i] == beam:
        if columns.strength[i] > 0.0 or columns.ends[i]:
            return i
        i += 1
    return n


@njit_inline
def _is_better(columns: Any, one: Any, other: Any) -> Any:
    """Say whether an echo rather than another tells what a merged one is."""
    if columns.ends[one] != columns.ends[other]:
        return columns.ends[one] > columns.ends[other]
    return columns.strength[one] > columns.strength[other] * (1.0 + ROUNDING)


@njit_cached
def _merge(columns: Any, cell: Any) -> Any:
    """Merge in place; give how many are left."""
    left, i, n = 0, 0, len(columns.t)
    while i < n:
        first = _first_giving(columns, i)
        if first < n and columns.t[first] - columns.t[i] < cell:
            end = columns.t[first] + cell
        else:
            first, end = i, columns.t[i]  # nothing is near: it stays as it is
        beam, near = columns.beam[i], columns.t[first]
        best, total, mean = i, 0.0, 0.0
        at = i
        while at == i or (at < n and columns.beam[at] == beam and columns.t[at] < end):
            strength = columns.strength[at]
            total += strength
            mean += strength * (columns.t[at] - near)
            if _is_better(columns, at, best):
                best = at
            at += 1
        t = near + mean / total if total > 0.0 else near
        _move(columns, best, left)
        columns.t[left] = t
        columns.strength[left] = min(total, 1.0)
        left += 1
        i = at
    return left


@njit_inline
def _move(columns: Any, source: Any, target: Any) -> None:
    columns.beam[target] = columns.beam[source]
    columns.row[target] = columns.row[source]
    columns.kind[target] = columns.kind[source]
    columns.part[target] = columns.part[source]
    columns.power[target] = columns.power[source]
    columns.ends[target] = columns.ends[source]


@njit_cached
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
