"""What comes back along one ray: from the events on its way to power by range."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.range_lines import (
    Bins,
    Lines,
    Place,
    add_ground,
    add_surface,
    add_volume,
)
from radarsim.addons.fmcw.scattering import (
    GRAZING,
    Grazing,
    Scattering,
    gamma_at,
    grazing_at,
    is_level,
    over_ground,
)
from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.raycast.attenuation import EventKind, EventRow

_START_INSIDE, _ENTER, _LEAVE, _SHEET, _HIT = map(int, list(EventKind)[:5])
_MIRRORED, _OUT_OF_RANGE = int(EventKind.MIRRORED), int(EventKind.OUT_OF_RANGE)

OVERLAP: Final = 1.5  # by how much the ranges of a ray reach over those of the next
DENT_AREA: Final = 1.0  # m^2, of dents in a sheet of metal; estimate
_STRAIGHT_BACK: Final = 0.9  # cosine, beyond which no mirror glints
LONGEST_SPREAD: Final = 3.0  # m, over which a grazed surface is spread


class FanRays(NamedTuple):
    """The rays of a fan in a scene; M rays.

    Attributes:
        column: As in ``RayFan``.
        across: Likewise.
        weights: (M,) as there, times K over the noise.
        spread: As there.
        directions: (M, 3) unit vectors, map frame.
        shift: (M,) m, by how much all seems farther by Doppler's effect.
        ranges: (M,) m, to where each ends; inf if it meets nothing.
        incidence: (M,) cosine of the angle of incidence.
    """

    column: NDArray[np.int64]
    across: Floats
    weights: Floats
    spread: Floats
    directions: Floats
    shift: Floats
    ranges: Floats
    incidence: Floats


class TracedFan(NamedTuple):
    """The rays of a turn and all they met.

    Attributes:
        rays: The rays.
        events: Their events, in order.
        scattering: What the parts of the scene scatter.
        bins: The range bins.
    """

    rays: FanRays
    events: NDArray[np.void]
    scattering: Scattering
    bins: Bins


@njit_inline
def add_ray(
    fan: TracedFan,
    lines: Lines,
    inside: NDArray[np.int64],
    here: int,
    ray: int,
    event: int,
) -> int:
    """Add the power of one ray; return the first event of the next one.

    Args:
        fan: The ``TracedFan``.
        lines: The ``Lines`` of its column and the next.
        inside: (P + 1,) int64, overwritten: the volumes around the ray.
        here: Row of ``Lines`` of its column.
        ray: Number of the ray.
        event: Its first event.
    """
    rays, events, bins = fan.rays, fan.events, fan.bins
    place = Place(here, rays.across[ray], rays.weights[ray], rays.shift[ray], 0.0)
    per_power, first, count = bins.db_per_power, event, 0
    t, power, is_turned = 0.0, bins.full, False
    while event < len(events) and events[event].ray == ray:
        e = events[event]
        # Power can only fall; rounding must not make a volume return less than nothing.
        left = min(e.power, power)
        # The cross section of a cubic metre of all that is around the ray here.
        volume, sway = fan.scattering.air, 0.0
        for k in range(count):
            volume += fan.scattering.volume[inside[k]]
            sway = max(sway, fan.scattering.sway[inside[k]])
        if volume > 0.0 and e.t > t:
            loss = (bins.full - power) * per_power
            slope = (power - left) / (e.t - t) * per_power
            add_volume(lines, _swaying(place, sway), bins, t, e.t, volume, loss, slope)
        # In dB one way; the wave comes back, so that it loses twice as many.
        through = 10.0 ** (-0.2 * (bins.full - left) * per_power)
        if e.kind == _HIT:
            # Ground is spread by its own law, along the direction that the fan knows:
            # after a mirror it is a surface as any other.
            if not is_turned and is_level(rays.directions[ray], rays.incidence[ray]):
                _add_level(fan, lines, place, ray, event, through)
            else:
                _add_end(fan, lines, place, ray, event, through)
        elif e.kind == _OUT_OF_RANGE and not is_turned:
            _add_open_ground(fan, lines, place, ray, e, (t, power))
        elif e.kind == _SHEET:
            # It has no depth: what it scatters is a share of what it takes.
            taken = 1.0 - 10.0 ** (-0.1 * e.absorbed * per_power)
            row = _row(fan.scattering, e.part)
            gamma = fan.scattering.albedo[row] * taken
            leaves = _swaying(place, fan.scattering.sway[row])
            add_surface(lines, leaves, bins, e.t, gamma * through, 0.0)
        elif e.kind == _MIRRORED:
            cosine = _mirror_cosine(fan, ray, first, event)
            gamma = _surface_gamma(fan.scattering, e.part, cosine)
            add_surface(lines, place, bins, e.t, gamma * through, 0.0)
            if is_turned:
                _add_corner(fan, lines, place, ray, first, event, through)
            # From here on the ray has not the direction that it has in the fan.
            is_turned = True
        count = _count_inside(inside, count, e)
        t, power = e.t, left - e.absorbed
        event += 1
    return event


@njit_inline
def _swaying(place: Place, sway: float) -> Place:
    """Return the place of what the wind moves at an rms speed, m/s."""
    return Place(place.here, place.across, place.weight, place.shift, sway)


@njit_inline
def _row(scattering: Scattering, part: int) -> int:
    """Return the row of a part; robots share the last."""
    return min(part, len(scattering.gamma) - 1)


@njit_inline
def _surface_gamma(scattering: Scattering, part: int, cosine: float) -> float:
    row = _row(scattering, part)
    return gamma_at(
        cosine,
        scattering.gamma[row],
        scattering.exponent[row],
        scattering.glint[row],
        scattering.narrowness[row],
    )


@njit_inline
def _add_end(
    fan: TracedFan, lines: Lines, place: Place, ray: int, event: int, through: float
) -> None:
    """Add the surface that ends a ray; ``through`` is the share that comes there."""
    e = fan.events[event]
    cosine = max(fan.rays.incidence[ray], GRAZING)
    gamma = _surface_gamma(fan.scattering, e.part, cosine)
    # The tangent of the angle of incidence: how much farther the next ray meets it.
    slant = np.sqrt(1.0 - cosine * cosine) / cosine
    length = min(fan.rays.spread[ray] * e.t * slant, LONGEST_SPREAD)
    add_surface(lines, place, fan.bins, e.t, gamma * through, length)


@njit_inline
def _add_level(
    fan: TracedFan, lines: Lines, place: Place, ray: int, event: int, through: float
) -> None:
    """Add level ground that ends a ray; arguments as of ``_add_end``."""
    e, direction = fan.events[event], fan.rays.directions[ray]
    row = _row(fan.scattering, e.part)
    angle = OVERLAP * fan.rays.spread[ray]
    # The view over level ground ends where the next ray, which looks higher, meets
    # something upright.
    rays, after, end = fan.rays, ray + 1, np.inf
    if (
        after < len(rays.column)
        and rays.column[after] == rays.column[ray]
        and not is_level(rays.directions[after], rays.incidence[after])
    ):
        end = float(max(rays.ranges[after], rays.ranges[ray]))
    grazing = grazing_at(fan.scattering.ground, row, e, direction, angle, end)
    _add_ground(fan, lines, place, row, grazing, through)


@njit_inline
def _add_open_ground(
    fan: TracedFan,
    lines: Lines,
    place: Place,
    ray: int,
    end: EventRow,
    before: tuple[float, float],
) -> None:
    """Add the open ground that a ray meets beyond the edge of the map.

    Args:
        fan: The ``TracedFan``.
        lines: The ``Lines``.
        place: The ``Place``.
        ray: Number of the ray.
        end: The event at which it is out of range.
        before: Where it left what it met last, m, and the power that it had there.
    """
    ground, direction = fan.scattering.ground, fan.rays.directions[ray]
    if ground.open_part < 0 or direction[2] >= 0.0:
        return
    way, (t, power) = end.t + (ground.open_height - end.z) / direction[2], before
    if way <= t or way >= end.t:
        return
    lost = fan.bins.full - power + (power - end.power) * (way - t) / (end.t - t)
    through = 10.0 ** (-0.2 * lost * fan.bins.db_per_power)
    angle = OVERLAP * fan.rays.spread[ray]
    x, y = end.x - end.t * direction[0], end.y - end.t * direction[1]
    grazing = over_ground(x, y, direction, way, angle, 0.0, np.inf)
    _add_ground(fan, lines, place, ground.open_part, grazing, through)


@njit_inline
def _add_ground(
    fan: TracedFan,
    lines: Lines,
    place: Place,
    row: int,
    grazing: Grazing,
    through: float,
) -> None:
    """Add level ground of a part, or of all patches that the ray stands for."""
    scattering, exponent = fan.scattering, fan.scattering.exponent[row]
    gamma = 1.0
    if exponent != 0.0 or not scattering.ground.patches.size:
        cosine = max(grazing.depth / grazing.t, GRAZING)
        gamma = _surface_gamma(scattering, row, cosine)
    ground = scattering.ground
    add_ground(lines, place, fan.bins, grazing, gamma * through, exponent, ground)


@njit_inline
def _add_corner(
    fan: TracedFan,
    lines: Lines,
    place: Place,
    ray: int,
    first: int,
    event: int,
    through: float,
) -> None:
    """Add what comes straight back by several mirrors, as from a corner of two walls.

    They are one mirror that the ray meets head-on, as far away as half of its way out
    and back; its slopes are those of all of them.

    Args:
        fan: The ``TracedFan``.
        lines: The ``Lines``.
        place: The ``Place``.
        ray: Number of the ray.
        first: Its first event.
        event: That of the last mirror.
        through: Share that is left there.
    """
    events, ahead, bins = fan.events, fan.rays.directions[ray], fan.bins
    e, after, start = events[event], events[event + 1], events[first]
    run = after.t - e.t
    if run <= 0.0:
        return
    dx = start.x - start.t * ahead[0] - e.x
    dy = start.y - start.t * ahead[1] - e.y
    dz = start.z - start.t * ahead[2] - e.z
    straight = np.sqrt(dx * dx + dy * dy + dz * dz)
    back = (after.x - e.x) * dx + (after.y - e.y) * dy + (after.z - e.z) * dz
    back /= run * max(straight, 1e-9)
    if back < _STRAIGHT_BACK:
        return
    # Half the angle by which it misses the antenna is that of a mirror turned so.
    square = min(0.5 * (1.0 + back), 1.0)
    distance = 0.5 * (e.t + straight)
    share, spread, area = 1.0, 0.0, 0.0
    for k in range(first, event + 1):
        if events[k].kind == _MIRRORED:
            row = _row(fan.scattering, events[k].part)
            narrowness = fan.scattering.narrowness[row]
            if narrowness <= 0.0:
                return
            share *= fan.scattering.glint[row] / narrowness
            size = fan.scattering.area[row]
            # A piece that is smaller than its dents is as flat as a part of one.
            spread += 0.5 / narrowness * min(size / DENT_AREA, 1.0)
            area += size * _mirror_cosine(fan, ray, first, k)
    # What is small, or far, sends the wave into a lobe; no more of a large mirror than
    # the zone around the shortest way takes part.
    area = min(area, 0.5 * bins.wavelength * distance)
    spread += bins.wavelength**2 / (8.0 * np.pi * max(area, 1e-6))
    glint = share * 0.5 / spread
    gamma = gamma_at(np.sqrt(square), 0.0, 1.0, glint, 0.5 / spread)
    add_surface(lines, place, bins, distance, gamma * through, 0.0)


@njit_inline
def _mirror_cosine(fan: TracedFan, ray: int, first: int, event: int) -> float:
    """Return the cosine of the angle of incidence on a mirror.

    It is half the length by which the direction changes.

    Args:
        fan: The ``TracedFan``.
        ray: Number of the ray.
        first: Its first event.
        event: That of the mirror.
    """
    events, directions = fan.events, fan.rays.directions
    before = first - 1  # the mirror before this one; of the first one there is none
    for k in range(first, event):
        if events[k].kind == _MIRRORED:
            before = k
    # Events know places, but no directions. A mirror is never the last event of a ray.
    here, after = events[event], events[event + 1]
    run = after.t - here.t
    if run <= 0.0:
        return 1.0
    ux, uy, uz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
    if before >= first:
        last = events[before]
        way = max(here.t - last.t, 1e-9)
        ux, uy, uz = (
            (here.x - last.x) / way,
            (here.y - last.y) / way,
            (here.z - last.z) / way,
        )
    dx, dy, dz = (
        (after.x - here.x) / run,
        (after.y - here.y) / run,
        (after.z - here.z) / run,
    )
    change = np.sqrt((dx - ux) ** 2 + (dy - uy) ** 2 + (dz - uz) ** 2)
    return float(min(max(0.5 * change, GRAZING), 1.0))


@njit_inline
def _count_inside(inside: NDArray[np.int64], count: int, event: EventRow) -> int:
    """Keep the list of volumes around a ray; return their number after an event."""
    if event.kind in (_ENTER, _START_INSIDE):
        inside[count] = event.part
        return count + 1
    if event.kind == _LEAVE:
        kept = 0
        for k in range(count):
            if inside[k] != event.part:
                inside[kept] = inside[k]
                kept += 1
        return kept
    # After a mirror the volumes are entered anew.
    return 0 if event.kind == _MIRRORED else count
