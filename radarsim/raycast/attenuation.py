"""The law of penetration: what a ray's crossings cost it, and where it ends.

Theory of operation
===================
A ray leaves with a penetration power. Inside volumes it loses, per metre, the sum of
the densities of all volumes around the point, and of the air's. It ends at the first
opaque surface, where its power runs out, or out of reach. What a surface keeps must be
left on arrival, or nothing comes back.
A ray that is mirrored has several legs: each is walked by itself, and begins with what
is left of the one before. This module knows no scene and no Embree:
it walks one ray's list of crossings, in order of distance, in float64.

A part is around the ray where its winding number is above zero: the number there at
the start, plus one for each front of a triangle that the ray goes in by, minus one for
each back that it comes out by. Shells that overlap count once, cavities are outside,
and two crossings on a grazed edge add up to nothing in either order.

Rule 1: the list is complete, and a surface is on it once; ``line`` sees to that.
Rule 2: the density is summed anew after each crossing, never added to and taken from:
a ray that has left all volumes pays nothing, exactly.
Rule 3: a power of which rounding alone leaves something is spent.

Source: the recursion of a thesis on a radar for USARSim, of which this is the loop;
in that model a penetrable object costs density times length, and where the power
runs out, that point's range is the reading.
"""

from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline

ROUNDING: Final = 1e-12  # share of a power that may be left of it by rounding

EVENT: Final = np.dtype(
    [
        ("ray", "i8"),
        ("t", "f8"),
        ("part", "i4"),
        ("kind", "i4"),
        ("power", "f8"),
        ("absorbed", "f8"),
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),
    ]
)
BEFORE: Final = 6  # place in a leg: m that the ray has come before it


class Outcome(IntEnum):
    """How a ray ends."""

    NOTHING = 0
    HIT = 1
    SPENT = 2
    ABSORBED = 3


class EventKind(IntEnum):
    """What happens to a ray at one point of its way."""

    START_INSIDE = 0
    ENTER = 1
    LEAVE = 2
    SHEET = 3
    HIT = 4
    SPENT = 5
    OUT_OF_RANGE = 6
    MIRRORED = 7
    ABSORBED = 8
    RAIN = 9  # no ray meets it; sensors add it


# The same as plain numbers, of which compiled code makes less ado.
_START_INSIDE, _ENTER, _LEAVE, _SHEET, _HIT, _SPENT = map(int, list(EventKind)[:6])
_OUT_OF_RANGE, MIRRORED, _ABSORBED = map(int, list(EventKind)[6:9])
_ENDED, _ENDED_BY_HIT, _ENDED_SPENT, _ENDED_ABSORBED = map(int, Outcome)


class RayCosts(NamedTuple):
    """What the parts of a scene cost one kind of ray.

    Attributes:
        density: (P,) power per metre inside.
        sheet_loss: (P,) power per crossed surface; nan for a volume.
        air: Power per metre everywhere.
        air_part: The number of the part that the air is.
    """

    density: Floats
    sheet_loss: Floats
    air: float = 0.0
    air_part: int = -1


class RayState(NamedTuple):
    """Where one ray is followed, and what it met; made once for many rays.

    Attributes:
        crossings: (H,) CROSSING: how far a surface is, whose it is, and what it adds
            to the winding number of that part; the first ``before`` of a ``Stop``.
        winding: (P,) int32, the winding number of each part.
        touched: (P,) int32, the parts that the ray had to do with.
        seen: (P,) uint8, which parts these are.
        around: (P,) int32, the parts around the ray, last entered last.
        sizes: (2,) int64, how many are touched and how many around.
        leg: (7,) where the leg starts, m, its unit vector, and how far the ray has come
            before it, m.
        events: (E,) EVENT; what happened, if anybody asks: the ``ray`` of the last
            row counts, and what does not fit is counted only. Without rows, nothing.
    """

    crossings: NDArray[np.void]
    winding: NDArray[np.int32]
    touched: NDArray[np.int32]
    seen: NDArray[np.uint8]
    around: NDArray[np.int32]
    sizes: NDArray[np.int64]
    leg: Floats
    events: NDArray[np.void]


class Stop(NamedTuple):
    """How far a ray can come at all.

    Attributes:
        before: How many surfaces it crosses before.
        t: Where, m.
        part: What stops it; -1 for the end of its reach.
    """

    before: int
    t: float
    part: int


class RayEnd(NamedTuple):
    """Where a ray ended.

    Attributes:
        t: m from its start, over all legs.
        outcome: An ``Outcome``.
        part: What was hit, or the last entered of the volumes in which the power ran
            out, or the sheet that took the rest of it; -1 for nothing.
        power: What is left; of a hit, what comes back.
    """

    t: float
    outcome: int
    part: int
    power: float


@njit_cached
def new_walk(
    parts: int, crossings: NDArray[np.void], events: NDArray[np.void]
) -> RayState:
    """Make room for walks in a scene.

    Args:
        parts: How many parts the scene has.
        crossings: As many as one ray may have.
        events: One more than all rays together may write, or none.
    """
    return RayState(
        crossings,
        np.zeros(parts, np.int32),
        np.zeros(parts, np.int32),
        np.zeros(parts, np.uint8),
        np.zeros(parts, np.int32),
        np.zeros(2, np.int64),
        np.zeros(7),
        events,
    )


@njit_inline
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


@njit_inline
def forget(walk: Any) -> None:
    """Leave all parts."""
    for i in range(walk.sizes[0]):
        part = walk.touched[i]
        walk.winding[part] = 0
        walk.seen[part] = 0
    walk.sizes[0] = 0
    walk.sizes[1] = 0


@njit_inline
def _density(walk: Any, toll: Any) -> Any:
    total = toll.air
    for i in range(walk.sizes[1]):
        total += toll.density[walk.around[i]]
    return total


@njit_inline
def write(walk: Any, ray: Any, t: Any, what: Any, power: Any, kept: Any) -> None:
    """Write an event down, if anybody asks; ``what`` is its kind and its part."""
    last = walk.events.size - 1
    if last < 0:
        return
    n = walk.events[last].ray
    if n < last:
        event = walk.events[n]
        event.ray = ray
        event.t = walk.leg[BEFORE] + t
        event.kind, event.part = what
        event.power = power
        event.absorbed = kept
        event.x = walk.leg[0] + t * walk.leg[3]
        event.y = walk.leg[1] + t * walk.leg[4]
        event.z = walk.leg[2] + t * walk.leg[5]
    walk.events[last].ray = n + 1


@njit_inline
def _cross(walk: Any, toll: Any, crossing: Any, power: Any) -> Any:
    """Go through one surface.

    Returns:
        What happens there, an ``EventKind`` or -1 for nothing, and the power behind it.
    """
    loss = toll.sheet_loss[crossing.part]
    if not np.isnan(loss):
        return _SHEET, max(power - loss, 0.0)
    change = wind(walk, crossing.part, crossing.turn)
    if change > 0:
        return _ENTER, power
    return _LEAVE if change < 0 else -1, power


@njit_inline
def begin(ray: Any, power: Any, walk: Any) -> Any:
    """Start to walk a ray whose winding numbers at the start are set.

    Args:
        ray: The ray's number, for the events.
        power: What it starts with.
        walk: To be used for nothing else until ``end``.

    Returns:
        How far it is, what power it has, at what power it is spent, and the part that
        took the last of it, -1 for none: the state that ``follow`` takes and gives.
    """
    for i in range(walk.sizes[1]):
        write(walk, ray, 0.0, (_START_INSIDE, walk.around[i]), power, 0.0)
    least = power * ROUNDING if np.isfinite(power) else 0.0
    return 0.0, power, least, np.int64(-1)


@njit_inline
def _innermost(walk: Any, toll: Any) -> Any:
    """Give the last entered of the volumes around a ray; the air if there is none."""
    n = walk.sizes[1]
    return np.int64(walk.around[n - 1]) if n else np.int64(toll.air_part)


@njit_inline
def follow(ray: Any, state: Any, stop: Any, toll: Any, walk: Any) -> Any:
    """Go on from crossing to crossing, as far as the power carries.

    Args:
        ray: The ray's number.
        state: From ``begin``, or from the call before.
        stop: Where the crossings that are known end.
        toll: Of this kind of ray.
        walk: Holds the sorted crossings before the stop.

    Returns:
        The state there.
    """
    at, power, least, _ = state
    density = _density(walk, toll)
    for i in range(stop.before + 1):
        t = walk.crossings[i].t if i < stop.before else stop.t
        if density > 0.0:
            left = power - density * (t - at)
            if left <= least:
                at = min(at + power / density, t)
                return at, 0.0, least, _innermost(walk, toll)
            power = left
        at = t
        if i == stop.before:
            break
        crossing = walk.crossings[i]
        arriving = power
        kind, power = _cross(walk, toll, crossing, power)
        if kind >= 0:
            kept = arriving - power if power < arriving else 0.0
            write(walk, ray, at, (kind, crossing.part), arriving, kept)
            if kind == _SHEET and power <= least:
                return at, 0.0, least, np.int64(crossing.part)
            density = _density(walk, toll)
    return at, power, least, np.int64(-1)


@njit_inline
def end(ray: Any, state: Any, stop: Any, keeps: Any, walk: Any) -> Any:
    """Say how a ray ended; its winding numbers are forgotten.

    Args:
        ray: Its number.
        state: From ``follow``.
        stop: Where it stopped.
        keeps: Power that the surface there keeps of what arrives.
        walk: Of the last leg.
    """
    at, left, least, spent = state
    forget(walk)
    t = walk.leg[BEFORE] + at
    if spent >= 0:
        write(walk, ray, at, (_SPENT, spent), 0.0, 0.0)
        return RayEnd(t, _ENDED_SPENT, spent, 0.0)
    part: Any = np.int64(stop.part)
    if part < 0:
        write(walk, ray, at, (_OUT_OF_RANGE, part), left, 0.0)
        return RayEnd(t, _ENDED, part, left)
    if keeps > 0.0 and is_absorbed(left, least, keeps):
        write(walk, ray, at, (_ABSORBED, part), left, keeps)
        return RayEnd(t, _ENDED_ABSORBED, part, 0.0)
    kept = min(keeps, left)  # rounding may make it more
    write(walk, ray, at, (_HIT, part), left, kept)
    return RayEnd(t, _ENDED_BY_HIT, part, left - kept)


@njit_inline
def is_absorbed(left: Any, least: Any, keeps: Any) -> Any:
    """Say whether a surface keeps all that is left of a ray."""
    return np.isinf(keeps) or keeps - left > least


@njit_inline
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
        An ``RayEnd``.
    """
    state = follow(ray, begin(ray, power, walk), stop, toll, walk)
    return end(ray, state, stop, 0.0, walk)
