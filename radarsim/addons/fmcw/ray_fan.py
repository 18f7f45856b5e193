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

from radarsim.addons.fmcw.radar_equation import elevation_limits, elevation_pattern
from radarsim.engine import engine
from radarsim.geometry import Floats
from radarsim.presets.fmcw_settings import FmcwSettings


class Extents(NamedTuple):
    """What directions things take up, seen from a sensor; N things.

    Attributes:
        azimuth: (N,) rad, of the right edge, clockwise from straight ahead.
        width: (N,) rad.
        low: (N,) rad, elevation of the lower edge.
        high: (N,) rad, of the upper edge.
        distance: (N,) m, to the middle.
    """

    azimuth: Floats
    width: Floats
    low: Floats
    high: Floats
    distance: Floats


def extents_from(position: Floats, rotation: Floats, bounds: Floats) -> Extents:
    """Return what directions bounding boxes take up.

    Args:
        position: (3,) m, of the sensor, map frame.
        rotation: (3, 3) of the sensor.
        bounds: (N, 2, 3) m, lower and upper corners, map frame.
    """
    extents = np.zeros((5, len(bounds)))
    engine.measure_extents(bounds, position, rotation, extents)
    return Extents._make(extents)


def turned_directions(
    directions: Floats, rotations: Floats, which: NDArray[np.int64]
) -> Floats:
    """Return the directions of rays in the map frame, (M, 3) unit vectors.

    Args:
        directions: (M, 3) sensor frame.
        rotations: (N, 3, 3) of the sensor.
        which: (M,) which of these rotations each has.
    """
    turned = np.empty_like(directions)
    # Not a product of matrices, which rounds by how many rows there are.
    engine.turn_directions(directions, rotations, which, turned)
    return turned


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

    def cut(self, first: int, last: int) -> "RayFan":
        """Return the rays from one up to another."""
        return RayFan._make(column[first:last] for column in self)


class Cells(NamedTuple):
    """The grid of cells of a radar.

    Attributes:
        columns: Their number in a turn.
        edges: (E + 1,) rad, elevations at which the cells begin and end.
    """

    columns: int
    edges: Floats

    @property
    def rows(self) -> int:
        """The number of cells in a column."""
        return len(self.edges) - 1


@lru_cache(maxsize=16)
def cells_of(settings: FmcwSettings) -> Cells:
    """Return the cells of a radar: of even steps in azimuth, and by pattern upwards."""
    low, high = elevation_limits(settings)
    elevations = np.linspace(low, high, _EDGE_STEPS)
    # By the square root of the one-way power, so that the weak fan gets some of them.
    density = np.sqrt(elevation_pattern(settings, elevations)) + 0.02
    share = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    places = np.linspace(0.0, share[-1], settings.rays_up + 1)
    edges = np.interp(places, share, elevations)
    return Cells(settings.azimuths * settings.rays_across, edges)


@lru_cache(maxsize=16)
def plain_fan(settings: FmcwSettings) -> RayFan:
    """Return the fan of a radar, one ray in each cell."""
    cells = cells_of(settings)
    ones = np.ones(cells.columns * cells.rows, np.int64)
    return _fill_cells(settings, np.arange(len(ones)), ones, ones)


def refined_fan(
    settings: FmcwSettings, extents: Extents, rows: range | None = None
) -> RayFan:
    """Return the fan with more rays where things are thinner than a few cells.

    Args:
        settings: The radar.
        extents: What directions things take up.
        rows: Directions of the radar whose rays are returned; None for a whole turn.
            They are the same rays as those of the turn.
    """
    cells = cells_of(settings)
    rows = range(settings.azimuths) if rows is None else rows
    columns = range(rows.start * settings.rays_across, rows.stop * settings.rays_across)
    first, last = columns.start * cells.rows, columns.stop * cells.rows
    # Most turns meet nothing thin: then the fan is that of all turns, not a copy.
    fan = plain_fan(settings).cut(first, last)
    across, up = _divisions(settings, cells, extents, columns)
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
    cells = cells_of(settings)
    counts = across * up
    owner = np.repeat(np.arange(len(cell)), counts)
    part = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    column, row = np.divmod(cell[owner], cells.rows)
    # The sequence goes on along the columns of a row, from another start in each row.
    number = (column + 1) * 1.0 + 0.5 * row * cells.columns + part * 1.0
    beside = (part % across[owner] + _fraction(number * _FILL_ACROSS)) / across[owner]
    inside = _fraction((number // 2) * _FILL_UP)
    # Every other ray is mirrored: a pattern that rises within a cell evens out.
    inside = np.where(number % 2 >= 1, 1.0 - inside, inside)
    above = (part // across[owner] + inside) / up[owner]
    heights = np.diff(cells.edges)[row]
    elevation = cells.edges[row] + above * heights
    width = 2 * math.pi / cells.columns
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


def _fraction(numbers: Floats) -> Floats:
    return np.asarray(numbers - np.floor(numbers))


def _divisions(
    settings: FmcwSettings, cells: Cells, extents: Extents, columns: range
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return into how many parts cells of some columns are divided, across and up.

    A thing that few rays would meet divides the rectangle of cells around it, as far
    as ``MOST_RAYS`` permits.
    """
    width = 2 * math.pi / cells.columns
    in_beam = math.radians(settings.beamwidth_az_deg) / width
    rows = np.arange(cells.rows + 1)
    low, high = (
        np.interp(edge, cells.edges, rows) for edge in (extents.low, extents.high)
    )
    wide, tall = extents.width / width, high - low
    # A thing that is wider than the beam has the rays of one beam in each direction.
    few = np.minimum(wide, in_beam) * tall < ENOUGH_RAYS
    thin = few & (tall > 0) & (extents.width < math.pi) & np.isfinite(wide)
    some = np.flatnonzero(thin)[np.argsort(extents.distance[thin])]
    edges = extents.azimuth[some], extents.azimuth[some] + extents.width[some]
    # The first column may lie in the turn before, the last one in the turn after.
    first, last = (np.floor(each / width).astype(np.int64) for each in edges)
    bottom, top = low[some].astype(np.int64), np.ceil(high[some]).astype(np.int64)
    across, up = (
        np.minimum(np.ceil(wanted / np.maximum(size[some], 1e-9)), MOST_PARTS).astype(
            np.int64
        )
        for wanted, size in ((RAYS_ACROSS, wide), (RAYS_UP, tall))
    )
    added = np.cumsum((last - first + 1) * (top - bottom) * across * up)
    within = np.arange(len(some)) < np.searchsorted(added, MOST_RAYS, side="right")
    divided_across = np.ones((len(columns), cells.rows), np.int64)
    divided_up = np.ones_like(divided_across)
    # Where each rectangle begins, counted from the first of these columns.
    begin = (first - columns.start) % cells.columns
    reach = begin + last - first
    seen = (begin < len(columns)) | (reach >= cells.columns)
    for i in np.flatnonzero(within & seen).tolist():
        places = np.arange(begin[i], reach[i] + 1) % cells.columns
        places = places[places < len(columns)]
        patch = np.ix_(places, np.arange(bottom[i], top[i]))
        divided_across[patch] = np.maximum(divided_across[patch], across[i])
        divided_up[patch] = np.maximum(divided_up[patch], up[i])
    return divided_across.ravel(), divided_up.ravel()
