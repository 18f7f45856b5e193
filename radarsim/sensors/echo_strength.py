"""What comes back of each event along rays.

Theory of operation
===================
The strength of an echo is its power as a share of what comes back from a rough wall
that the whole beam meets head-on, with nothing before it. Penetration power counts
decibels one way; the sensor's margin is what a beam can lose out and back. So of a ray
that has a share p of its power left, T = 10^(-margin (1 - p) / 10) would come back. An
opaque surface returns the T of what is left there; a volume the difference between its
two sides, and a sheet that before and behind it. Where volumes overlap, each is
credited with its share of the loss, in proportion to density. This holds for plants,
which scatter a fifth of what they take, before walls that return a tenth of what
arrives: the strengths of a ray that ends within range then add up to 1, and what does
not come back from the wall comes back from what is before it. What has another albedo
returns more or less than plants, and smoke nothing. A beam of unlimited power is
returned whole by what it hits. Power lost to the air, or to a volume around the ray's
start, returns no echo: there is no boundary.

A volume answers all along the ray's way through it, and its echo has one range: up to
there half of its power has come back. A sensor that keeps first echoes triggers on
their leading edge instead, which is where the ray enters.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind, EventRow, Events

NOTHING_LEFT: Final = 1e-12  # share of a ray's power
START_INSIDE, ENTER, LEAVE, SHEET, HIT, SPENT = map(int, list(EventKind)[:6])


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


class EventReturns(NamedTuple):
    """What comes back of V events, to be computed.

    Attributes:
        strengths: (V,) the strength of each event's echo, had its ray the whole beam.
        ranges: (V,) m, the range of the echo.
        losses: (V,) what does not come back from behind the stretch of the ray that
            ends at the event, of what would from before it.
        missing: (V,) what is missing to half of the strength.
        volumes: Work space.
    """

    strengths: Floats
    ranges: Floats
    losses: Floats
    missing: Floats
    volumes: EnclosingVolumes


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


def return_law(settings: SensorSettings) -> ReturnLaw:
    """Return the law of a sensor."""
    full = settings.penetration_power
    # There is no share of no power, nor of unlimited power.
    full = full if math.isfinite(full) else 0.0
    nepers = settings.margin_db * math.log(10) / 10
    return ReturnLaw(full, nepers, settings.return_mode != "first")


def returned_share(share: Floats | float, settings: SensorSettings) -> Floats:
    """Return what comes back of rays that have these shares of their power left."""
    returned = np.exp(return_law(settings).nepers * (np.asarray(share) - 1.0))
    return np.where(np.asarray(share) > NOTHING_LEFT, returned, 0.0)


@njit_inline
def _share_left(event: EventRow, law: ReturnLaw) -> float:
    """Return the share of its power that a ray has left on arrival."""
    if event.kind == SPENT:
        return 0.0
    return event.power / law.full if law.full > 0.0 else 1.0


@njit_inline
def _share_behind(event: EventRow, law: ReturnLaw) -> float:
    """Return the share of its power that a ray has left behind a sheet or a surface."""
    if event.kind == SPENT:
        return 0.0
    return (event.power - event.absorbed) / law.full if law.full > 0.0 else 1.0


@njit_inline
def _returned(share: float, law: ReturnLaw) -> float:
    """Return what comes back of a ray that has a share of its power left."""
    if share <= NOTHING_LEFT:
        return 0.0
    returned: float = np.exp(law.nepers * (share - 1.0))
    return returned


@njit_inline
def _total_density(
    densities: Densities, volumes: EnclosingVolumes, count: int
) -> float:
    total = densities.air
    for k in range(count):
        total += densities.parts[volumes.part[k]]
    return total


@njit_inline
def _credit_volumes(
    loss: float,
    densities: Densities,
    volumes: EnclosingVolumes,
    count: int,
    strengths: Floats,
) -> None:
    """Add a loss along a stretch to the echoes of the volumes around the ray.

    They share it in proportion to density. The echo of a volume is that of its near
    side.
    """
    total = _total_density(densities, volumes, count)
    if loss <= 0.0 or total <= 0.0:
        return
    # A volume around the start has no near side; its share, like the air's, returns no
    # echo.
    for k in range(count):
        entry = volumes.entry[k]
        if entry >= 0:
            part = volumes.part[k]
            share = densities.parts[part] / total * densities.scattering[part]
            strengths[entry] += loss * share


@njit_inline
def _find_middles(
    stretch: Stretch,
    densities: Densities,
    law: ReturnLaw,
    found: EventReturns,
    count: int,
) -> None:
    """Find the ranges up to which half of the power of volumes has come back.

    Args:
        stretch: The next stretch of the ray.
        densities: Densities of the parts and of the air.
        law: The ReturnLaw.
        found: The EventReturns, of which ranges are set.
        count: How many volumes there are around the ray.
    """
    volumes, missing, ranges = found.volumes, found.missing, found.ranges
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
def _update_volumes(
    events: Events, i: int, volumes: EnclosingVolumes, count: int
) -> int:
    """Enter or leave the volume of an event; return how many enclose the ray."""
    event: EventRow = events[i]
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


@njit_inline
def compute_strengths(
    events: Events, densities: Densities, law: ReturnLaw, found: EventReturns
) -> None:
    """Compute what each event returns of its ray.

    Args:
        events: (V,) EVENT of all rays, ray by ray.
        densities: Densities of the parts and of the air.
        law: The ReturnLaw.
        found: The EventReturns, zeros at first; ranges are not set.
    """
    volumes, strengths = found.volumes, found.strengths
    whole = _returned(1.0, law)
    ray, count, left = np.int64(-1), 0, whole
    for i in range(len(events)):
        event = events[i]
        if event.ray != ray:
            ray, count, left = event.ray, 0, whole
        share, behind = _share_left(event, law), _share_behind(event, law)
        arriving = _returned(share, law)
        found.losses[i] = left - arriving
        _credit_volumes(found.losses[i], densities, volumes, count, strengths)
        # Only sheets and surfaces take power at one point.
        left = arriving if behind == share else _returned(behind, law)
        if event.kind == HIT:
            strengths[i] = left
        elif event.kind == SHEET:
            strengths[i] = (arriving - left) * densities.scattering[event.part]
        count = _update_volumes(events, i, volumes, count)


@njit_inline
def find_ranges(
    events: Events, densities: Densities, law: ReturnLaw, found: EventReturns
) -> None:
    """Find the ranges of the echoes, when their strengths and losses are known.

    Args:
        events: As in ``compute_strengths``.
        densities: Densities of the parts and of the air.
        law: The ReturnLaw.
        found: The EventReturns, of which ranges are set.
    """
    volumes = found.volumes
    ray, count, near, before = np.int64(-1), 0, 0.0, 1.0
    for i in range(len(events)):
        event = events[i]
        found.ranges[i] = event.t
        if not law.spreads:
            continue
        if event.ray != ray:
            ray, count, near, before = event.ray, 0, 0.0, 1.0
        arriving = _share_left(event, law)
        stretch = Stretch(near, event.t, before, arriving, found.losses[i])
        _find_middles(stretch, densities, law, found, count)
        if event.kind == ENTER:
            found.missing[i] = found.strengths[i] / 2.0
        near, before = event.t, _share_behind(event, law)
        count = _update_volumes(events, i, volumes, count)
