"""Sort the echoes of a scan by object, in one compiled call."""

import math

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline

_GOLDEN = 2654435761  # multiplies numbers so that their upper bits are spread


@njit_cached
def sort_into_lines(
    parts: NDArray[np.int64],
    beams: NDArray[np.int64],
    ranges: Floats,
    power: Floats,
    strength: Floats,
    full: float,
    echoes_a_line: int,
) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Sort echoes into lines of one part each, as many as fit into a line.

    Parts are in the order of their first beam, and of their numbers for the same; the
    echoes of a part by beam and range.

    Args:
        parts: (E,) part of each echo; echoes are sorted by beam.
        beams: (E,) beam of each.
        ranges: (E,) m.
        power: (E,) power that is left on arrival.
        strength: (E,) share of the beam that is reflected back.
        full: Full power of a beam.
        echoes_a_line: How many fit into a line.

    Returns:
        (E, 4) beam, range, share of the power and strength, both from 0 to 1, in the
        order of the lines; (E,) the former row of each; (L, 3) of each line the part,
        its first row, and the row after its last.
    """
    count = len(parts)
    group_of, firsts, sizes = _group(parts)
    ranks = _rank(parts, beams, firsts)
    lines = np.zeros((count, 3), np.int64)
    starts = np.zeros(len(firsts), np.int64)  # of each group
    places = np.zeros(len(firsts), np.int64)  # of the next echo of each group
    line, start = 0, 0
    for group in ranks:
        starts[group] = places[group] = start
        end = start + sizes[group]
        while start < end:
            last = min(end, start + echoes_a_line)
            lines[line, 0], lines[line, 1], lines[line, 2] = (
                parts[firsts[group]],
                start,
                last,
            )
            line, start = line + 1, last
    numbers, order = np.zeros((count, 4)), np.zeros(count, np.int64)
    for row in range(count):
        group, beam = group_of[row], float(beams[row])
        place = places[group]
        places[group] += 1
        while place > starts[group] and _follows(numbers[place - 1], beam, ranges[row]):
            numbers[place], order[place] = numbers[place - 1], order[place - 1]
            place -= 1
        order[place] = row
        numbers[place, 0], numbers[place, 1] = beam, ranges[row]
        numbers[place, 2] = _power_share(power[row], full)
        numbers[place, 3] = _clip_to_unit(strength[row])
    return numbers, order, lines[:line]


@njit_cached
def _group(
    parts: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Group rows by part, in the order of their first rows.

    Returns:
        (E,) the group of each row, (G,) the first row and (G,) the size of each group.
    """
    size = 16
    while size < 2 * len(parts):
        size *= 2
    table = np.zeros(size, np.int64)  # groups by the hash of their part, from 1
    group_of = np.zeros(len(parts), np.int64)
    firsts = np.zeros(len(parts), np.int64)
    sizes = np.zeros(len(parts), np.int64)
    groups = 0
    for row in range(len(parts)):
        at = (parts[row] * _GOLDEN >> 8) & (size - 1)
        while table[at] and parts[firsts[table[at] - 1]] != parts[row]:
            at = (at + 1) & (size - 1)
        if not table[at]:
            firsts[groups] = row
            groups += 1
            table[at] = groups
        group = table[at] - 1
        group_of[row] = group
        sizes[group] += 1
    return group_of, firsts[:groups], sizes[:groups]


@njit_cached
def _rank(
    parts: NDArray[np.int64], beams: NDArray[np.int64], firsts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return groups by their first beam, and for the same beam by their part."""
    ranks = np.zeros(len(firsts), np.int64)
    for group in range(len(ranks)):  # by beam they are sorted already
        part, beam, at = parts[firsts[group]], beams[firsts[group]], group
        while at and beams[firsts[ranks[at - 1]]] == beam:
            if parts[firsts[ranks[at - 1]]] < part:
                break
            ranks[at] = ranks[at - 1]
            at -= 1
        ranks[at] = group
    return ranks


@njit_inline
def _follows(numbers: Floats, beam: float, range_: float) -> bool:
    """Return whether an echo is of a beam, and farther than a range."""
    return bool(numbers[0] == beam and numbers[1] > range_)


@njit_inline
def _power_share(power: float, full: float) -> float:
    """Return the share of a beam's power that is left on arrival."""
    if math.isinf(full):
        return 1.0
    return _clip_to_unit(power / full) if full > 0.0 else 0.0


@njit_inline
def _clip_to_unit(share: float) -> float:
    """Clip rounding errors off a share, and the sign off zero."""
    return 0.0 if share <= 0.0 else min(share, 1.0)


def warm_up() -> None:
    """Compile the kernel, or read it from the cache."""
    numbers, empty = np.zeros(0), np.zeros(0, np.int64)
    sort_into_lines(empty, empty, numbers, numbers, numbers, 1.0, 1)
