"""The penetration model: the power that a ray loses, and where it ends.

Theory of operation
===================
A ray starts with a penetration power. Inside volumes it loses, per metre, the sum of
the densities of all volumes that enclose the point, and of the air. It ends at the
first opaque surface, where its power runs out, or at its maximum range. An opaque
surface absorbs power of its own; a ray that arrives with less returns nothing.

A reflected ray consists of several straight segments. Each is followed separately and
starts with the power left by the one before. This module knows neither the scene nor
Embree: it follows one segment through its sorted list of crossings, in float64.

A part encloses the ray where its winding number is positive: the winding number at the
start, plus one for each triangle that the ray enters by its front, minus one for each
that it leaves by its back. Hence overlapping shells of a part count once, cavities are
outside, and two crossings on a grazed edge cancel in either order.

Rule 1: the list of crossings is complete and without duplicates; ``intersect`` ensures
that.
Rule 2: the density is summed anew after each crossing. Adding and subtracting would
leave a rounding error: a ray that has left all volumes loses exactly nothing.
Rule 3: a remaining power that is due to rounding alone counts as zero.

Source: the recursion in a thesis on a radar for USARSim, written as a loop. There a
penetrable object costs density times length, and the range that is measured is that of
the point where the power runs out.
"""

from enum import IntEnum
from typing import Final, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.raycast.crossings import Crossing, Crossings

ROUNDING: Final = 1e-12  # share of the initial power that may be left by rounding

# One row for each event; the fields are those of ``rays.Event``.
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
Events: TypeAlias = NDArray[np.void]  # of EVENT


class EventRow(Protocol):
    """A row of EVENT, as kernels see it."""

    ray: int
    t: float
    part: int
    kind: int
    power: float
    absorbed: float
    x: float
    y: float
    z: float


# Indices into ``RayState.segment``, which begins with the start's x, y, z.
DIRECTION: Final = 3
T_START: Final = 6


class Outcome(IntEnum):
    """How a ray ends."""

    NOTHING = 0
    HIT = 1
    SPENT = 2
    ABSORBED = 3


class EventKind(IntEnum):
    """What happens to a ray at one point of its path."""

    START_INSIDE = 0
    ENTER = 1
    LEAVE = 2
    SHEET = 3
    HIT = 4
    SPENT = 5
    OUT_OF_RANGE = 6
    MIRRORED = 7
    ABSORBED = 8
    RAIN = 9  # added by sensors: rain has no surfaces


# numba compiles plain integers faster than the members of an enumeration.
_START_INSIDE, _ENTER, _LEAVE, SHEET, _HIT, _SPENT = map(int, list(EventKind)[:6])
_OUT_OF_RANGE, MIRRORED, _ABSORBED = map(int, list(EventKind)[6:9])
_END_NOTHING, END_HIT, END_SPENT, _END_ABSORBED = map(int, Outcome)


class RayCosts(NamedTuple):
    """The power that one class of rays loses in the parts of a scene.

    Attributes:
        density: (P,) power lost per metre inside.
        sheet_loss: (P,) power lost per crossed surface; nan for a volume.
        air: Power lost per metre everywhere.
        air_part: The index of the part that represents the air.
    """

    density: Floats
    sheet_loss: Floats
    air: float = 0.0
    air_part: int = -1


class RayState(NamedTuple):
    """Arrays that describe one ray at one point, allocated once for many rays.

    Attributes:
        crossings: (H,) CROSSING, the surfaces that the segment crosses.
        winding: (P,) int32, the winding number of each part.
        touched: (P,) int32, the parts whose winding number was changed; only these are
            reset for the next ray.
        seen: (P,) uint8, whether a part is among them.
        enclosing: (P,) int32, the parts that enclose the point, last entered last.
        sizes: (2,) int64, the number of parts that are touched and that enclose.
        segment: (7,) start of the segment, m, its unit vector, and the distance that
            the ray has travelled before it, m.
        events: (E + 1,) EVENT to be filled; the ``ray`` of the last row counts them,
            also those for which there is no row. Empty if none are requested.
    """

    crossings: Crossings
    winding: NDArray[np.int32]
    touched: NDArray[np.int32]
    seen: NDArray[np.uint8]
    enclosing: NDArray[np.int32]
    sizes: NDArray[np.int64]
    segment: Floats
    events: Events


class Progress(NamedTuple):
    """How far a ray has come on a segment, and in what state.

    Attributes:
        t: m from the start of the segment.
        power: Remaining power.
        min_power: Power at which, or below which, the ray is spent.
        spent_in: The part that took the last of the power; -1 while there is some.
    """

    t: float
    power: float
    min_power: float
    spent_in: Int


class SegmentEnd(NamedTuple):
    """Where a segment ends at the latest.

    Attributes:
        crossed: The number of surfaces crossed before.
        t: m from the start of the segment.
        part: The opaque part there; -1 for the maximum range.
    """

    crossed: Int
    t: float
    part: Int


class RayEnd(NamedTuple):
    """Where a ray ended.

    Attributes:
        t: m from the ray's origin, over all segments.
        outcome: An ``Outcome``.
        part: The part that was hit, the last entered of the volumes in which the power
            ran out, or the sheet that took the rest of it; -1 for none.
        power: Remaining power; of a hit, what the surface returns.
    """

    t: float
    outcome: int
    part: Int
    power: float


@njit_cached
def new_ray_state(parts: int, crossings: Crossings, events: Events) -> RayState:
    """Allocate the state of a ray.

    Args:
        parts: Number of parts of the scene.
        crossings: Room for the crossings of one segment.
        events: Room for the events of all rays and the counter, or empty.
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
def update_winding(state: RayState, part: int, sign: int) -> int:
    """Add to a part's winding number, and keep the list of enclosing parts.

    Returns:
        1 if the ray enters the part by that, -1 if it leaves the part, 0 if neither.
    """
    if not state.seen[part]:
        state.seen[part] = 1
        state.touched[state.sizes[0]] = part
        state.sizes[0] += 1
    was_inside = state.winding[part] > 0
    state.winding[part] += sign
    is_inside = state.winding[part] > 0
    n = state.sizes[1]
    if is_inside and not was_inside:
        state.enclosing[n] = part
        state.sizes[1] = n + 1
        return 1
    if was_inside and not is_inside:
        # Shift the others: the last in the list has to remain the last entered.
        index = 0
        while state.enclosing[index] != part:
            index += 1
        for i in range(index, n - 1):
            state.enclosing[i] = state.enclosing[i + 1]
        state.sizes[1] = n - 1
        return -1
    return 0


@njit_inline
def reset_winding(state: RayState) -> None:
    """Set all winding numbers to zero."""
    # Only the parts that this ray has touched: a scene can have thousands, and clearing
    # all of them would take longer than most rays do.
    for i in range(state.sizes[0]):
        part = state.touched[i]
        state.winding[part] = 0
        state.seen[part] = 0
    state.sizes[0] = 0
    state.sizes[1] = 0


@njit_inline
def record_event(
    state: RayState,
    ray: Int,
    t: float,
    kind: int,
    part: Int,
    power: float,
    absorbed: float,
) -> None:
    """Append an event if events are requested; ``t`` is m from the segment's start."""
    last = state.events.size - 1
    if last < 0:
        return
    n = state.events[last].ray
    if n < last:
        segment = state.segment
        event = state.events[n]
        event.ray = ray
        event.t = segment[T_START] + t
        event.kind = kind
        event.part = part
        event.power = power
        event.absorbed = absorbed
        event.x = segment[0] + t * segment[DIRECTION]
        event.y = segment[1] + t * segment[DIRECTION + 1]
        event.z = segment[2] + t * segment[DIRECTION + 2]
    # Count also what does not fit: the caller allocates more rows by this number.
    state.events[last].ray = n + 1


@njit_inline
def start_ray(ray: Int, power: float, state: RayState) -> Progress:
    """Return the ``Progress`` at the start of a ray whose winding numbers are set.

    Args:
        ray: The ray's index, for the events.
        power: The power that it starts with.
        state: The ray's state.
    """
    for i in range(state.sizes[1]):
        record_event(state, ray, 0.0, _START_INSIDE, state.enclosing[i], power, 0.0)
    # A share of an infinite power is infinite: the ray would be spent at once.
    min_power = power * ROUNDING if np.isfinite(power) else 0.0
    return Progress(0.0, power, min_power, np.int64(-1))


@njit_inline
def _density(state: RayState, costs: RayCosts) -> float:
    total = costs.air
    for i in range(state.sizes[1]):
        total += costs.density[state.enclosing[i]]
    return total


@njit_inline
def _innermost(state: RayState, costs: RayCosts) -> np.int64:
    """Return the last entered of the enclosing parts, or the air if there is none."""
    n = state.sizes[1]
    return np.int64(state.enclosing[n - 1]) if n else np.int64(costs.air_part)


@njit_inline
def _cross_surface(
    state: RayState, costs: RayCosts, crossing: Crossing, power: float
) -> tuple[int, float]:
    """Pass through one surface.

    Returns:
        The ``EventKind``, -1 for none, and the power behind the surface.
    """
    loss = costs.sheet_loss[crossing.part]
    if not np.isnan(loss):
        return SHEET, max(power - loss, 0.0)
    change = update_winding(state, crossing.part, crossing.sign)
    if change > 0:
        return _ENTER, power
    return _LEAVE if change < 0 else -1, power


@njit_inline
def advance_ray(
    ray: Int, progress: Progress, limit: SegmentEnd, costs: RayCosts, state: RayState
) -> Progress:
    """Go from crossing to crossing as far as the power lasts.

    Args:
        ray: The ray's index, for the events.
        progress: From ``start_ray`` or the previous call.
        limit: A ``SegmentEnd``, up to which the crossings are known.
        costs: The ``RayCosts`` of this class of rays.
        state: The ray's state, with the sorted crossings before the limit.

    Returns:
        The new ``Progress``.
    """
    at, power, min_power, _ = progress
    density = _density(state, costs)
    # There is one stretch more than surfaces: the last one ends at the limit.
    for i in range(limit.crossed + 1):
        t = state.crossings[i].t if i < limit.crossed else limit.t
        if density > 0.0:
            left = power - density * (t - at)
            if left <= min_power:
                # Rounding must not carry the end past the next surface.
                at = min(at + power / density, t)
                return Progress(at, 0.0, min_power, _innermost(state, costs))
            power = left
        at = t
        if i == limit.crossed:
            break
        crossing = state.crossings[i]
        arriving = power
        kind, power = _cross_surface(state, costs, crossing, power)
        if kind >= 0:
            # An infinite power minus itself would be NaN.
            absorbed = arriving - power if power < arriving else 0.0
            record_event(state, ray, at, kind, crossing.part, arriving, absorbed)
            if kind == SHEET and power <= min_power:
                return Progress(at, 0.0, min_power, np.int64(crossing.part))
            density = _density(state, costs)
    return Progress(at, power, min_power, np.int64(-1))


@njit_inline
def end_ray(
    ray: Int, progress: Progress, end: SegmentEnd, absorption: float, state: RayState
) -> RayEnd:
    """Return the ``RayEnd``, record it as an event, and reset the winding numbers.

    Args:
        ray: The ray's index.
        progress: From ``advance_ray``.
        end: The ``SegmentEnd`` of the last segment.
        absorption: Power that the surface there absorbs.
        state: The state on the last segment.
    """
    at, power, min_power, spent_in = progress
    reset_winding(state)
    t = state.segment[T_START] + at
    if spent_in >= 0:
        record_event(state, ray, at, _SPENT, spent_in, 0.0, 0.0)
        return RayEnd(t, END_SPENT, spent_in, 0.0)
    part = np.int64(end.part)
    if part < 0:
        record_event(state, ray, at, _OUT_OF_RANGE, part, power, 0.0)
        return RayEnd(t, _END_NOTHING, part, power)
    if absorption > 0.0 and is_absorbed(power, min_power, absorption):
        record_event(state, ray, at, _ABSORBED, part, power, absorption)
        return RayEnd(t, _END_ABSORBED, part, 0.0)
    absorbed = min(absorption, power)  # rounding can make it greater
    record_event(state, ray, at, _HIT, part, power, absorbed)
    return RayEnd(t, END_HIT, part, power - absorbed)


@njit_inline
def is_absorbed(power: float, min_power: float, absorption: float) -> bool:
    """Return whether a surface absorbs all the power of a ray."""
    # An infinite power minus an infinite absorption would be NaN.
    return bool(np.isinf(absorption) or absorption - power > min_power)
