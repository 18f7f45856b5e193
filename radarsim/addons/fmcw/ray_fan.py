"""The rays of a turn: one set for all directions, finer where things are thin.

Theory of operation
===================
The circle is divided into narrow columns, several for each direction of the radar, and
each column from the lower edge of the beam to the upper one into cells, which are
smaller where the pattern is stronger. Each cell has one ray. Within the cells the rays
follow a sequence of low discrepancy: a fixed grid would draw rings on the ground that
are not there, and random places would let a pole flicker. The same radar has the same
rays in every turn.

What is narrower than a few cells would be met by few rays or none. So the cells in
which something thin stands are divided further, in both angles, until enough rays meet
it. A ray stands for the solid angle of its cell, so that the sum over all of them
stays that over the beam. Where things stand is measured by their bounding boxes, as the
antenna sees them.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.addons.fmcw.antenna import elevation_limits, elevation_pattern
from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings

# Multiples of these, without their integers, fill a square evenly: powers of the
# inverse of the plastic number. Source: M. Roberts, "The Unreasonable Effectiveness of
# Quasirandom Sequences".
_FILL_ACROSS: Final = 0.5698402909980532
_FILL_UP: Final = 0.7548776662466927
_EDGE_STEPS: Final = 2001

WIDEST_GAP: Final = 2.5  # of mean gaps between the elevations of the rays of a beam
ENOUGH_RAYS: Final = 32  # on a thing in one beam: its power is right within 1 dB
RAYS_ACROSS: Final = 10  # on the bounding box of a thing that has fewer
RAYS_UP: Final = 8
MOST_PARTS: Final = 40  # of a cell, in each angle
MOST_RAYS: Final = 100_000  # that are added; the nearest things come first
THINGS_AT_ONCE: Final = 256

# (6, K) of things: the first and last column, the lowest row of cells and that above
# the highest, and into how many parts these cells are divided across and up.
Divisions = NDArray[np.int64]


class RayFan(NamedTuple):
    """The rays of a turn, ordered by their column; M rays.

    Attributes:
        directions: (M, 3) unit vectors, sensor frame.
        column: (M,) int64, the column of each, clockwise from straight ahead.
        across: (M,) how far into its column each is, 0 to 1.
        weights: (M,) sr, the solid angle of its cell times the two-way pattern in
            elevation.
        spread: (M,) rad, the greatest distance to the next ray of the same beam.
    """

    directions: Floats
    column: NDArray[np.int64]
    across: Floats
    weights: Floats
    spread: Floats


@lru_cache(maxsize=16)
def cell_edges(settings: FmcwSettings) -> Floats:
    """Return the elevations at which the cells of a column begin and end, rad."""
    low, high = elevation_limits(settings)
    elevations = np.linspace(low, high, _EDGE_STEPS)
    # By the square root of the one-way power, so that the weak fan gets some of them.
    density = np.sqrt(elevation_pattern(settings, elevations)) + 0.02
    share = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    places = np.linspace(0.0, share[-1], settings.rays_up + 1)
    return np.interp(places, share, elevations)


@lru_cache(maxsize=16)
def plain_fan(settings: FmcwSettings) -> RayFan:
    """Return the fan of a radar, one ray in each cell."""
    columns = settings.azimuths * settings.rays_across
    ones = np.ones(columns * settings.rays_up, np.int64)
    return _fill_cells(settings, np.arange(len(ones)), ones, ones)


def refined_fan(
    settings: FmcwSettings,
    bounds: Floats,
    position: Floats,
    rotation: Floats,
    rows: range,
) -> RayFan:
    """Return the rays of directions, more where things are thinner than a few cells.

    They are the same rays as those of a whole turn.

    Args:
        settings: The radar.
        bounds: (N, 2, 3) m, the bounding boxes of things, map frame.
        position: (3,) m, the antenna, map frame.
        rotation: (3, 3) from its frame to that of the map.
        rows: The directions.
    """
    columns = range(rows.start * settings.rays_across, rows.stop * settings.rays_across)
    first, last = columns.start * settings.rays_up, columns.stop * settings.rays_up
    # Most turns meet nothing thin: then the fan is that of all turns, not a copy.
    fan = RayFan._make(column[first:last] for column in plain_fan(settings))
    things = _thin_things(settings, bounds, position, rotation)
    across, up = _divisions(settings, things, columns)
    divided = np.flatnonzero((across > 1) | (up > 1))
    if not len(divided):
        return fan
    added = _fill_cells(settings, divided + first, across[divided], up[divided])
    kept = (across == 1) & (up == 1)
    filled = [
        np.concatenate([plain[kept], new])
        for plain, new in zip(fan, added, strict=True)
    ]
    order = np.argsort(filled[1], kind="stable")
    return RayFan._make(column[order] for column in filled)


def _fill_cells(
    settings: FmcwSettings,
    cell: NDArray[np.int64],
    across: NDArray[np.int64],
    up: NDArray[np.int64],
) -> RayFan:
    """Return the rays of cells, each divided into ``across`` times ``up`` parts."""
    edges, columns = cell_edges(settings), settings.azimuths * settings.rays_across
    counts = across * up
    owner = np.repeat(np.arange(len(cell)), counts)
    part = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    column, row = np.divmod(cell[owner], settings.rays_up)
    # The sequence goes on along the columns of a row, from another start in each row.
    number = (column + 1) * 1.0 + 0.5 * row * columns + part * 1.0
    beside = (part % across[owner] + number * _FILL_ACROSS % 1.0) / across[owner]
    inside = (number // 2) * _FILL_UP % 1.0
    # Every other ray is mirrored: a pattern that rises within a cell evens out.
    inside = np.where(number % 2 >= 1, 1.0 - inside, inside)
    above = (part // across[owner] + inside) / up[owner]
    heights = np.diff(edges)[row]
    elevation = edges[row] + above * heights
    width = 2 * math.pi / columns
    azimuth = (column + beside) * width
    level = np.cos(elevation)
    directions = np.stack(
        [level * np.cos(azimuth), -level * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    solid = width * heights * level / counts[owner]
    weights = solid * elevation_pattern(settings, elevation) ** 2
    # The rays of all columns in the beam fill up the gaps between those of one column.
    in_beam = math.radians(settings.beamwidth_az_deg) / width
    spread = np.maximum(WIDEST_GAP * heights / up[owner] / max(in_beam, 1.0), width)
    return RayFan(directions, column, beside, weights, spread)


def _thin_things(
    settings: FmcwSettings, bounds: Floats, position: Floats, rotation: Floats
) -> Divisions:
    """Return the things that few rays would meet, the nearest first.

    There are as many as ``MOST_RAYS`` permits. Arguments are those of ``refined_fan``.
    """
    distances = np.linalg.norm(bounds.mean(axis=1) - position, axis=1)
    nearest = np.argsort(distances, kind="stable")
    found, added = [np.zeros((6, 0), np.int64)], [0]
    for start in range(0, len(nearest), THINGS_AT_ONCE):
        boxes = bounds[nearest[start : start + THINGS_AT_ONCE]]
        extents = np.zeros((4, len(boxes)))
        engine.measure_extents(boxes, position, rotation, extents)
        thin = _divide_around(settings, extents)
        first, last, bottom, top, across, up = thin
        sums = added[-1] + np.cumsum((last - first + 1) * (top - bottom) * across * up)
        found.append(thin[:, sums <= MOST_RAYS])
        added += sums.tolist()
        if added[-1] > MOST_RAYS:
            break
    return np.concatenate(found, axis=1)


def _divide_around(settings: FmcwSettings, extents: Floats) -> Divisions:
    """Return the cells around the thin ones of things, and how these are divided.

    Args:
        settings: The radar.
        extents: (4, N) rad, what directions things take up, seen from the antenna: the
            azimuth of the right edge, clockwise from straight ahead, the width, and the
            elevations of the lower and the upper edge.
    """
    width = 2 * math.pi / (settings.azimuths * settings.rays_across)
    in_beam = math.radians(settings.beamwidth_az_deg) / width
    azimuths, widths, lowest, highest = extents
    edges, rows = cell_edges(settings), np.arange(settings.rays_up + 1)
    low, high = (np.interp(edge, edges, rows) for edge in (lowest, highest))
    wide, tall = widths / width, high - low
    # A thing that is wider than the beam has the rays of one beam in each direction.
    few = np.minimum(wide, in_beam) * tall < ENOUGH_RAYS
    some = few & (tall > 0) & (widths < math.pi) & np.isfinite(wide)
    sides = azimuths[some], azimuths[some] + widths[some]
    found = (
        # The first column may lie in the turn before, the last one in the turn after.
        *(np.floor(each / width) for each in sides),
        np.floor(low[some]),
        np.ceil(high[some]),
        *(
            np.minimum(np.ceil(wanted / np.maximum(size[some], 1e-9)), MOST_PARTS)
            for wanted, size in ((RAYS_ACROSS, wide), (RAYS_UP, tall))
        ),
    )
    return np.array(found).astype(np.int64)


def _divisions(
    settings: FmcwSettings, things: Divisions, columns: range
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return into how many parts the cells of some columns are divided, across and up.

    Things divide the rectangles of cells around them.
    """
    count = settings.azimuths * settings.rays_across
    first, last, bottom, top, across, up = things
    divided_across = np.ones((len(columns), settings.rays_up), np.int64)
    divided_up = np.ones_like(divided_across)
    # Where each rectangle begins, counted from the first of these columns.
    begin = (first - columns.start) % count
    reach = begin + last - first
    seen = (begin < len(columns)) | (reach >= count)
    for i in np.flatnonzero(seen).tolist():
        places = np.arange(begin[i], reach[i] + 1) % count
        places = places[places < len(columns)]
        patch = np.ix_(places, np.arange(bottom[i], top[i]))
        divided_across[patch] = np.maximum(divided_across[patch], across[i])
        divided_up[patch] = np.maximum(divided_up[patch], up[i])
    return divided_across.ravel(), divided_up.ravel()
