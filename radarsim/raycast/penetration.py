"""The law of penetration: what a ray's crossings cost it, and where it ends.

Theory of operation
===================
A ray leaves with a penetration power. Inside volumes it loses, per metre, the sum of
the densities of all volumes around the point. It ends at the first opaque surface,
where its power runs out, or out of reach. This module knows no scene and no Embree:
it walks one ray's list of crossings, in order of distance, in float64.

A part is around the ray where its winding number is above zero: the number there at
the start, plus one for each front of a triangle that the ray goes in by, minus one for
each back that it goes out by. Shells that overlap count once, cavities are outside,
and two crossings on a grazed edge add up to nothing in either order.

Rule 1: a crossing is counted once. That a ray through an edge meets both triangles of
it is for the caller to mend; here it would be two surfaces.
Rule 2: the density is summed anew after each crossing, never added to and taken from:
a ray that has left all volumes pays nothing, exactly.

Source: the recursion of a thesis on a radar for USARSim, of which this is the loop;
in that model a penetrable object costs density times length, and where the power
runs out, that point's range is the reading.
"""

from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from radarsim.geometry import Floats

EVENT: Final = np.dtype(
    [("ray", "i8"), ("t", "f8"), ("part", "i4"), ("kind", "i4"), ("power", "f8")]
)


class Outcome(IntEnum):
    """How a ray ends."""

    NOTHING = 0
    HIT = 1
    SPENT = 2


class EventKind(IntEnum):
    """What happens to a ray at one point of its way."""

    START_INSIDE = 0
    ENTER = 1
    LEAVE = 2
    SHEET = 3
    HIT = 4
    SPENT = 5
    OUT_OF_RANGE = 6


class Toll(NamedTuple):
    """What the parts of a scene cost one kind of ray.

    Attributes:
        density: (P,) power per metre inside.
        sheet_loss: (P,) power per crossed surface; nan for a volume.
    """

    density: Floats
    sheet_loss: Floats


class Walk(NamedTuple):
    """Where one ray is followed, and what it met; made once for many rays.

    Attributes:
        t: (H,) m, where the ray crosses surfaces; the first ``count`` of a ``Stop``.
        part: (H,) int32, whose they are.
        turn: (H,) int32, what that adds to the part's winding number.
        row: (H,) int64, which triangle it is; for the caller only.
        winding: (P,) int32, the winding number of each part.
        touched: (P,) int32, the parts with an entry in ``seen``.
        seen: (P,) uint8, whether the ray had to do with a part.
        around: (P,) int32, the parts around the ray, last entered last.
        sizes: (2,) int64, how many are touched and how many around.
        events: (E,) EVENT; what happened, if anybody asks: the ``ray`` of the last
            row counts, and what does not fit is counted only. Without rows, nothing.
    """

    t: Floats
    part: NDArray[np.int32]
    turn: NDArray[np.int32]
    row: NDArray[np.int64]
    winding: NDArray[np.int32]
    touched: NDArray[np.int32]
    seen: NDArray[np.uint8]
    around: NDArray[np.int32]
    sizes: NDArray[np.int64]
    events: NDArray[np.void]


class Stop(NamedTuple):
    """How far a ray can come at all.

    Attributes:
        count: How many surfaces it crosses before.
        t: Where, m.
        part: What stops it; -1 for the end of its reach.
    """

    count: int
    t: float
    part: int


class Ending(NamedTuple):
    """Where a ray ended.

    Attributes:
        t: m from its start.
        outcome: An ``Outcome``.
        part: What was hit, or the last entered of the volumes in which the power ran
            out, or the sheet that took the rest of it; -1 for nothing.
        power: What is left.
    """

    t: float
    outcome: int
    part: int
    power: float


def new_walk(parts: int, crossings: int, events: int = 0) -> Walk:
    """Make room for walks in a scene.

    Args:
        parts: How many parts the scene has.
        crossings: How many one ray may meet.
        events: How many all rays together may write; 0 if nobody asks.
    """
    return Walk(
        t=np.zeros(crossings),
        part=np.zeros(crossings, np.int32),
        turn=np.zeros(crossings, np.int32),
        row=np.zeros(crossings, np.int64),
        winding=np.zeros(parts, np.int32),
        touched=np.zeros(parts, np.int32),
        seen=np.zeros(parts, np.uint8),
        around=np.zeros(parts, np.int32),
        sizes=np.zeros(2, np.int64),
        events=np.zeros(events + 1 if events else 0, EVENT),
    )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def new_walk_like(walk: Any) -> Any:
    """Make room for as many crossings, to list them aside; nobody walks these."""
    return Walk(
        np.zeros_like(walk.t),
        np.zeros_like(walk.part),
        np.zeros_like(walk.turn),
        np.zeros_like(walk.row),
        walk.winding[:0],
        walk.touched[:0],
        walk.seen[:0],
        walk.around[:0],
        walk.sizes[:0],
        walk.events[:0],
    )


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _comes_after(walk: Any, i: Any, j: Any) -> Any:
    """Order by distance; where distances are equal, by part, and in before out."""
    if walk.t[i] != walk.t[j]:
        return walk.t[i] > walk.t[j]
    if walk.part[i] != walk.part[j]:
        return walk.part[i] > walk.part[j]
    if walk.turn[i] != walk.turn[j]:
        return walk.turn[i] < walk.turn[j]
    return walk.row[i] > walk.row[j]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _swap(column: Any, i: Any, j: Any) -> None:
    kept = column[i]
    column[i] = column[j]
    column[j] = kept


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def sort_crossings(walk: Any, count: Any) -> None:
    """Sort the first ``count`` crossings in place: Shell's sort, in gaps of 3k + 1."""
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for start in range(gap, count):
            i = start
            while i >= gap and _comes_after(walk, i - gap, i):
                _swap(walk.t, i - gap, i)
                _swap(walk.part, i - gap, i)
                _swap(walk.turn, i - gap, i)
                _swap(walk.row, i - gap, i)
                i -= gap
        gap //= 3


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def wind(walk: Any, part: Any, turn: Any) -> Any:
    """Add to a part's winding number; above zero, the part is around the ray.

    Returns:
        1 if the ray enters the part by it, -1 if it leaves it, 0 if neither.
    """
    if not walk.seen[part]:
        walk.seen[part] = 1
        walk.touched[walk.sizes[0]] = part
        walk.sizes[0] += 1
    before = walk.winding[part] > 0
    walk.winding[part] += turn
    after = walk.winding[part] > 0
    n = walk.sizes[1]
    if after and not before:
        walk.around[n] = part
        walk.sizes[1] = n + 1
        return 1
    if before and not after:
        place = 0
        while walk.around[place] != part:
            place += 1
        for i in range(place, n - 1):
            walk.around[i] = walk.around[i + 1]
        walk.sizes[1] = n - 1
        return -1
    return 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _density(walk: Any, toll: Any) -> Any:
    total = 0.0
    for i in range(walk.sizes[1]):
        total += toll.density[walk.around[i]]
    return total


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _write(walk: Any, ray: Any, t: Any, part: Any, what: Any) -> None:
    """Write an event down; ``what`` is its kind and the power there."""
    last = walk.events.size - 1
    if last < 0:
        return
    n = walk.events[last].ray
    if n < last:
        walk.events[n].ray = ray
        walk.events[n].t = t
        walk.events[n].part = part
        walk.events[n].kind = what[0]
        walk.events[n].power = what[1]
    walk.events[last].ray = n + 1


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _cross(walk: Any, toll: Any, i: Any, power: Any) -> Any:
    """Go through one surface.

    Returns:
        What happens there, an ``EventKind`` or -1 for nothing, and the power behind it.
    """
    part = walk.part[i]
    loss = toll.sheet_loss[part]
    if loss == loss:
        return np.int64(EventKind.SHEET), max(power - loss, 0.0)
    change = wind(walk, part, walk.turn[i])
    if change > 0:
        return np.int64(EventKind.ENTER), power
    return np.int64(EventKind.LEAVE if change < 0 else -1), power


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def settle(ray: Any, power: Any, stop: Any, toll: Any, walk: Any) -> Any:
    """Walk one ray from its start to where it ends.

    Args:
        ray: The ray's number, for the events.
        power: What it starts with.
        stop: A ``Stop``.
        toll: Of this kind of ray.
        walk: Holds the sorted crossings before the stop, and the winding numbers at
            the start; these are forgotten afterwards.

    Returns:
        An ``Ending``.
    """
    for i in range(walk.sizes[1]):
        _write(walk, ray, 0.0, walk.around[i], (EventKind.START_INSIDE, power))
    at, spent = 0.0, -1
    density = _density(walk, toll)
    for i in range(stop.count + 1):
        last = i == stop.count
        t = max(stop.t if last else walk.t[i], at)
        if density > 0.0:
            if density * (t - at) >= power:
                at += power / density
                spent = walk.around[walk.sizes[1] - 1]
                break
            power -= density * (t - at)
        at = t
        if last:
            break
        kind, power = _cross(walk, toll, i, power)
        if kind >= 0:
            _write(walk, ray, at, walk.part[i], (kind, power))
            density = _density(walk, toll)
            if kind == EventKind.SHEET and power == 0.0:
                spent = walk.part[i]
                break
    forget(walk)
    if spent >= 0:
        _write(walk, ray, at, spent, (EventKind.SPENT, 0.0))
        return Ending(at, np.int64(Outcome.SPENT), np.int64(spent), 0.0)
    hit = stop.part >= 0
    kind = np.int64(EventKind.HIT if hit else EventKind.OUT_OF_RANGE)
    _write(walk, ray, at, stop.part, (kind, power))
    outcome = np.int64(Outcome.HIT if hit else Outcome.NOTHING)
    return Ending(at, outcome, np.int64(stop.part), power)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def forget(walk: Any) -> None:
    """Leave all parts."""
    for i in range(walk.sizes[0]):
        part = walk.touched[i]
        walk.winding[part] = 0
        walk.seen[part] = 0
    walk.sizes[:] = 0
