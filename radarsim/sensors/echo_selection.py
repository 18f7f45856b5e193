"""Merge the echoes that a beam cannot resolve, and select those that it keeps.

Echoes of a beam that are closer together than the range resolution merge: starting from
the nearest one that returns power, all that is less than the range resolution behind
it, and echoes without strength as close in front of it. The merged echo has the sum of
their strengths and their mean range, weighted by strength. Its kind and object are
those of the strongest end of a ray among them; if no ray ends there, those of the
strongest echo. If that is a volume, the merged echo begins where the ray enters it.
"""

from typing import Any, Final

import numpy as np

from radarsim.jit import njit_cached, njit_inline
from radarsim.sensors.echo_extraction import EchoColumns
from radarsim.sensors.echo_strength import ENTER

LAST, FIRST, STRONGEST = 0, 1, 2
ROUNDING: Final = 1e-12  # relative difference below which strengths are equal


def merge_echoes(echoes: EchoColumns, resolution: float) -> EchoColumns:
    """Merge echoes of a beam that are closer together than a resolution, m."""
    if resolution <= 0 or not len(echoes.t):
        return echoes
    merged = echoes.take(np.arange(len(echoes.t)))
    return merged.take(slice(_merge_in_place(merged, resolution)))


@njit_inline
def _first_with_power(echoes: Any, i: Any) -> Any:
    """Return the first echo of a beam from ``i`` on that has strength or is an end."""
    n, beam = len(echoes.t), echoes.beam[i]
    while i < n and echoes.beam[i] == beam:
        if echoes.strength[i] > 0.0 or echoes.ends[i]:
            return i
        i += 1
    return n


@njit_inline
def _represents(echoes: Any, one: Any, other: Any) -> Any:
    """Return whether one echo rather than another gives a merged echo its kind."""
    if echoes.ends[one] != echoes.ends[other]:
        return echoes.ends[one] > echoes.ends[other]
    return echoes.strength[one] > echoes.strength[other] * (1.0 + ROUNDING)


@njit_cached
def _merge_in_place(echoes: Any, resolution: Any) -> Any:
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
def _copy_row(echoes: Any, source: Any, target: Any) -> None:
    """Copy what a merged echo takes over unchanged."""
    echoes.beam[target] = echoes.beam[source]
    echoes.row[target] = echoes.row[source]
    echoes.kind[target] = echoes.kind[source]
    echoes.part[target] = echoes.part[source]
    echoes.power[target] = echoes.power[source]
    echoes.ends[target] = echoes.ends[source]


@njit_cached
def select_echoes(echoes: Any, mode: Any, beams: Any, threshold: Any) -> Any:
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
