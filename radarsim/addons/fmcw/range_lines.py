"""Power by range: where a ray adds what comes back along it.

A surface that is grazed takes up more than one bin, as the next ray of the beam meets
it farther off: its power is spread over that distance. From level ground at a depth h
below the antenna, which rays meet metres apart, elevations of d theta return at ranges

    dR = R^2 / h sqrt(1 - h^2 / R^2) d theta.

A volume adds to every bin that
the ray passes, less and less as it takes from the wave.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.scattering import (
    NEPER_DB,
    Grazing,
    Ground,
    patch_gamma,
)
from radarsim.geometry import Floats
from radarsim.jit import njit_inline

_STEEPEST: Final = 0.999  # square of h / R, at which the formula for ground ends
NEAREST: Final = 0.3  # m; nearer the far field, and 1 / R^2, do not hold

Power = NDArray[np.float32]


class Bins(NamedTuple):
    """The range bins.

    Attributes:
        size: m.
        per_square: (B,) 1 / R^2 of each, 1/m^2; 0 where it is too near.
        full: Power with which rays start.
        db_per_power: dB one way in a unit of it.
        wavelength: m.
    """

    size: float
    per_square: Floats
    full: float
    db_per_power: float
    wavelength: float


class Lines(NamedTuple):
    """Power by range, of one column and the next.

    Attributes:
        power: (2, B) float32.
        sway: (2, 2, B) float32, the part of it that comes from what the wind moves, and
            that times its rms speed, m/s; (2, 2, 0) if nothing does.
        spans: (2, 2) int64, the first and the last bin with power in each.
    """

    power: Power
    sway: Power
    spans: NDArray[np.int64]


class Place(NamedTuple):
    """Where a ray's power goes.

    Attributes:
        here: Row of ``Lines`` of its column.
        across: Share of the next column.
        weight: Power at 1 m from a gamma of 1.
        shift: m, added to ranges.
        sway: Rms speed at which the wind moves what returns it, m/s.
    """

    here: int
    across: float
    weight: float
    shift: float
    sway: float


@njit_inline
def add_surface(
    lines: Lines, place: Place, bins: Bins, t: float, gamma: float, length: float
) -> None:
    """Add what a surface returns, evenly over a length, and at least over one bin.

    Args:
        lines: The ``Lines``.
        place: The ``Place``.
        bins: The ``Bins``.
        t: Its distance, m.
        gamma: The share of the wave that it returns, less the losses on the way.
        length: m along the ray.
    """
    if gamma <= 0.0 or t < NEAREST:
        return
    power = place.weight * gamma / (t * t)
    size, count = bins.size, len(bins.per_square)
    # At least a bin: else its power would jump from one to the next as the radar moves.
    half = 0.5 * max(length, size)
    middle = t + place.shift
    # Bin b is from (b - 1/2) to (b + 1/2) bin sizes.
    start, end = (middle - half) / size + 0.5, (middle + half) / size + 0.5
    low, high = max(int(np.floor(start)), 0), min(int(np.floor(end)), count - 1)
    if high < low:
        return
    density = power / (end - start)
    for b in range(low, high + 1):
        share = min(end, b + 1.0) - max(start, float(b))
        add_to_bin(lines, place, b, density * share)
    widen(lines, low, high)


@njit_inline
def add_ground(
    lines: Lines,
    place: Place,
    bins: Bins,
    grazing: Grazing,
    gamma: float,
    exponent: float,
    ground: Ground,
) -> None:
    """Add what level ground returns.

    Args:
        lines: The ``Lines``.
        place: The ``Place``.
        bins: The ``Bins``.
        grazing: The ``Grazing``.
        gamma: Its gamma where the ray meets it, less the losses on the way; only these
            losses if it has patches.
        exponent: Of the cosine by which gamma falls off: 0 or 1.
        ground: The ``Ground``, of whose patches those with an exponent of 0 are.
    """
    is_patched = exponent == 0.0 and ground.patches.size > 0
    depth, size, count = grazing.depth, bins.size, len(bins.per_square)
    # The ray stands for elevations of half the angle to either side of its own.
    here = np.arcsin(min(depth / grazing.t, 1.0))
    half = 0.5 * grazing.angle
    # Beyond straight down, 1.57 rad, ranges would grow again.
    start = max(depth / np.sin(min(here + half, 1.5)), grazing.near, NEAREST)
    end = grazing.far
    # Rays nearer the horizon than that stand for directions that meet no ground.
    if here > half:
        end = min(end, depth / np.sin(here - half))
    # The share of the ray's power in a radian; what lies beyond the last bin is lost.
    angle = np.arcsin(min(depth / start, 1.0)) - np.arcsin(min(depth / end, 1.0))
    first = (start + place.shift) / size + 0.5
    last = min((end + place.shift) / size + 0.5, float(count))
    low, high = max(int(np.floor(first)), 0), min(int(np.floor(last)), count - 1)
    if high < low or angle <= 0.0:
        return
    scale = place.weight * gamma * depth * size / angle
    widen(lines, low, high)
    # The first and the last bin are passed in part.
    for b in (low, high):
        share = min(last, b + 1.0) - max(first, float(b))
        power = _ground_at(bins.per_square[b], depth, scale * share)
        if exponent != 0.0:
            # Lambert's gamma falls with h / R; it is given for the range of the ray.
            power *= grazing.t * np.sqrt(bins.per_square[b])
        elif is_patched:
            power *= patch_gamma(ground, grazing, b * size - place.shift)
        if b == low or high > low:
            add_to_bin(lines, place, b, power)
    inside = bins.per_square[low + 1 : high]
    own = lines.power[place.here, low + 1 : high]
    beside = lines.power[1 - place.here, low + 1 : high]
    if is_patched:
        first_range = (low + 1) * size - place.shift
        _fill_patches(
            own, beside, inside, place, grazing, scale, ground, size, first_range
        )
    elif exponent == 0.0:
        _fill_even(own, beside, inside, place, grazing, scale)
    else:
        _fill_lambert(own, beside, inside, place, grazing, scale)


@njit_inline
def _fill_even(
    own: Power,
    beside: Power,
    inside: Floats,
    place: Place,
    grazing: Grazing,
    scale: float,
) -> None:
    """Add ground of one gamma to whole bins; without choices, several at once."""
    across, depth = place.across, grazing.depth
    for b in range(len(inside)):
        power = _ground_at(inside[b], depth, scale)
        own[b] += power * (1.0 - across)
        beside[b] += power * across


@njit_inline
def _fill_patches(
    own: Power,
    beside: Power,
    inside: Floats,
    place: Place,
    grazing: Grazing,
    scale: float,
    ground: Ground,
    size: float,
    first: float,
) -> None:
    """Add ground of patches to whole bins of a size, the first at a range, m."""
    across, depth = place.across, grazing.depth
    for b in range(len(inside)):
        power = _ground_at(inside[b], depth, scale)
        power *= patch_gamma(ground, grazing, first + b * size)
        own[b] += power * (1.0 - across)
        beside[b] += power * across


@njit_inline
def _fill_lambert(
    own: Power,
    beside: Power,
    inside: Floats,
    place: Place,
    grazing: Grazing,
    scale: float,
) -> None:
    """Add ground whose gamma falls with the cosine, likewise."""
    across, depth, t = place.across, grazing.depth, grazing.t
    for b in range(len(inside)):
        power = _ground_at(inside[b], depth, scale)
        power *= t * np.sqrt(inside[b])
        own[b] += power * (1.0 - across)
        beside[b] += power * across


@njit_inline
def _ground_at(inverse: float, depth: float, scale: float) -> float:
    """Return what level ground returns into a bin of 1 / R^2."""
    steep = min(depth * depth * inverse, _STEEPEST)
    return float(scale * inverse * inverse / np.sqrt(1.0 - steep))


@njit_inline
def add_volume(
    lines: Lines,
    place: Place,
    bins: Bins,
    near: float,
    far: float,
    volume: float,
    loss: float,
    slope: float,
) -> None:
    """Add what a volume returns along the way of a ray through it.

    Args:
        lines: The ``Lines``.
        place: The ``Place``.
        bins: The ``Bins``.
        near: Where it begins, m.
        far: Where it ends, m.
        volume: Cross section of a cubic metre, m^2/m^3.
        loss: dB one way up to there.
        slope: dB per metre one way within.
    """
    size, count = bins.size, len(bins.per_square)
    rate = 2.0 * slope / NEPER_DB  # nepers of power per metre, out and back
    start = (near + place.shift) / size + 0.5
    end = (far + place.shift) / size + 0.5
    low, high = max(int(np.floor(start)), 0), min(int(np.floor(end)), count - 1)
    if high < low:
        return
    # Most bins are passed as a whole: their share is computed once.
    fade = np.exp(-rate * size)
    whole = _mean_depth(rate, size)
    begin = max(start, float(low))
    left = place.weight * volume * 10.0 ** (-0.2 * loss)
    left *= np.exp(-rate * (begin - start) * size)
    for b in range(low, high + 1):
        depth = (min(end, b + 1.0) - begin) * size
        if depth < 0.999999 * size:
            returned = left * _mean_depth(rate, depth)
            left *= np.exp(-rate * depth)
        else:
            returned = left * whole
            left *= fade
        add_to_bin(lines, place, b, returned * bins.per_square[b])
        begin = b + 1.0
    widen(lines, low, high)


@njit_inline
def _mean_depth(rate: float, depth: float) -> float:
    """Return the integral of e^(-rate r) over a depth."""
    if rate * depth < 1e-6:  # where the difference below would lose its digits
        return depth
    return float((1.0 - np.exp(-rate * depth)) / rate)


@njit_inline
def add_to_bin(lines: Lines, place: Place, b: int, power: float) -> None:
    """Add power to a bin of a ray's column, and of the next one."""
    here, beside = place.here, 1 - place.here
    lines.power[here, b] += power * (1.0 - place.across)
    lines.power[beside, b] += power * place.across
    if place.sway > 0.0:
        for row, share in ((here, 1.0 - place.across), (beside, place.across)):
            lines.sway[row, 0, b] += power * share
            lines.sway[row, 1, b] += power * share * place.sway


@njit_inline
def widen(lines: Lines, low: int, high: int) -> None:
    """Note that bins from ``low`` to ``high`` have power."""
    for k in range(2):
        lines.spans[k, 0] = min(lines.spans[k, 0], low)
        lines.spans[k, 1] = max(lines.spans[k, 1], high)
