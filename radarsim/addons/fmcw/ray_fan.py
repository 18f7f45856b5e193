"""The rays of a revolution: a fan for all azimuths, with more rays at thin objects.

Theory of operation
===================
The circle is divided into narrow columns, several for each azimuth of the radar. Each
column is divided from the lower to the upper edge of the beam into cells, which are
smaller where the antenna pattern is stronger. Each cell has one ray. The positions of
rays in their cells are a low-discrepancy sequence: a fixed grid would give artificial
rings on the ground, and random positions would let thin poles flicker. The rays of a
radar are the same in every revolution.

Objects that are narrower than a few cells would be hit by few or no rays. So the cells
around thin objects are subdivided, in both angles, until enough rays hit the object.
The weight of a ray is the solid angle of its cell, so the sum over all rays does not
change. The directions of objects follow from their bounding boxes as seen from the
antenna.
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

# The fractional parts of multiples of these numbers, powers of the inverse of the
# plastic number, fill a square evenly. Source: M. Roberts, "The Unreasonable
# Effectiveness of Quasirandom Sequences".
_FILL_ACROSS: Final = 0.5698402909980532
_FILL_UP: Final = 0.7548776662466927
_EDGE_STEPS: Final = 2001

WIDEST_GAP: Final = 2.5  # ratio of the largest to the mean gap between a beam's rays


class RayFan(NamedTuple):
    """The M rays of a revolution, ordered by column.

    Attributes:
        directions: Unit vectors, (M, 3), sensor frame.
        column: Columns, clockwise from straight ahead, (M,) int64.
        across: Positions within the columns, 0 to 1, (M,).
        weights: Solid angles of the cells times the two-way pattern in elevation, (M,)
            sr.
        spread: Largest angle to the next ray of the same beam, (M,) rad.
    """

    directions: Floats
    column: NDArray[np.int64]
    across: Floats
    weights: Floats
    spread: Floats


@lru_cache(maxsize=16)
def cell_edges(settings: FmcwSettings) -> Floats:
    """Return the elevations of the borders between the cells of a column, rad."""
    low, high = elevation_limits(settings)
    elevations = np.linspace(low, high, _EDGE_STEPS)
    # The density of cells follows the square root of the one-way pattern. A constant is
    # added, so that elevations with a weak pattern also have cells.
    density = np.sqrt(elevation_pattern(settings, elevations)) + 0.02
    share = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    places = np.linspace(0.0, share[-1], settings.rays_up + 1)
    return np.interp(places, share, elevations)


@lru_cache(maxsize=16)
def plain_fan(settings: FmcwSettings) -> RayFan:
    """Return the fan of a radar without subdivided cells, with one ray per cell."""
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
    """Return the rays of azimuths, with subdivided cells around thin objects.

    The rays are the same as in the fan of a whole revolution.

    Args:
        settings: Settings of the radar.
        bounds: Bounding boxes of objects, (N, 2, 3) m, map frame.
        position: Position of the antenna, (3,) m, map frame.
        rotation: Rotation from the antenna to the map frame, (3, 3).
        rows: Indices of the azimuths.
    """
    columns = range(rows.start * settings.rays_across, rows.stop * settings.rays_across)
    first, last = columns.start * settings.rays_up, columns.stop * settings.rays_up
    # Without thin objects, the usual case, views of the plain fan are returned.
    fan = RayFan._make(column[first:last] for column in plain_fan(settings))
    parts = np.ones((2, len(columns), settings.rays_up), np.int64)
    beamwidth, count = math.radians(settings.beamwidth_az_deg), settings.azimuths
    numbers = beamwidth, columns.start, count * settings.rays_across
    place = bounds, position[None], rotation, cell_edges(settings)
    engine.divide_cells(*place, *numbers, *parts)
    across, up = parts.reshape(2, -1)
    is_divided = (across > 1) | (up > 1)
    divided, kept = np.flatnonzero(is_divided), np.flatnonzero(~is_divided)
    if not len(divided):
        return fan
    added = _fill_cells(settings, divided + first, across[divided], up[divided])
    filled = [
        np.concatenate([plain.take(kept, axis=0), new])
        for plain, new in zip(fan, added, strict=True)
    ]
    order = np.argsort(filled[1], kind="stable")
    return RayFan._make(column.take(order, axis=0) for column in filled)


def _fill_cells(
    settings: FmcwSettings,
    cell: NDArray[np.int64],
    across: NDArray[np.int64],
    up: NDArray[np.int64],
) -> RayFan:
    """Return the rays of cells, each subdivided into ``across`` times ``up`` parts."""
    edges, columns = cell_edges(settings), settings.azimuths * settings.rays_across
    counts = across * up
    owner = np.repeat(np.arange(len(cell)), counts)
    part = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    column, row = np.divmod(cell[owner], settings.rays_up)
    # The sequence continues along the columns of a row; each row has another start.
    number = (column + 1) * 1.0 + 0.5 * row * columns + part * 1.0
    beside = (part % across[owner] + number * _FILL_ACROSS % 1.0) / across[owner]
    inside = (number // 2) * _FILL_UP % 1.0
    # Every other ray is mirrored within its cell, so that the slope of the antenna
    # pattern within a cell averages out.
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
    # Rays of the other columns in the beam fill the gaps between rays of a column.
    in_beam = math.radians(settings.beamwidth_az_deg) / width
    spread = np.maximum(WIDEST_GAP * heights / up[owner] / max(in_beam, 1.0), width)
    return RayFan(directions, column, beside, weights, spread)
