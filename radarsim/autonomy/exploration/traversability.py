"""Traversability map: floor that a robot can drive on, and its unexplored edges.

Theory of operation
===================
Cells of the map are joined to tiles of about 0.1 m. Far from the robot, cells between
beams stay unknown. So a tile is unknown only if it is part of a small disc without any
sensed tile, and all other tiles are sensed. Open tiles are sensed tiles that keep the
safety distance from obstacles. Frontiers are open tiles next to unknown ones. Unvisited
tiles are open tiles that no beam has passed at short range.
"""

import math
from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid, distance_field
from radarsim.autonomy.navigation.grid_search import (
    CHEAP,
    COSTLY,
    COSTLY_FACTOR,
    ESCAPE_COST,
    ESCAPE_RADIUS,
    Cell,
    flood_fill,
    shortest_path,
    step_cost,
)
from radarsim.geometry import Floats, Point, Pose2

TILE_SIZE: Final = 0.1  # m, approximately
HOLE_RADIUS: Final = 0.25  # m; radius of the smallest unknown hole
FREE_RADIUS: Final = 0.25  # m; radius around a free tile
_PADDING: Final = 4  # unknown tiles around the map


class TraversabilityMap:
    """A map divided into square tiles: where the robot can drive; masks are (R, C).

    Attributes:
        safety: Safety distance from the robot's centre, m.
        size: Side of a tile, m.
    """

    def __init__(self, grid: OccupancyGrid, safety: float) -> None:
        """Evaluate an occupancy grid.

        Args:
            grid: The map.
            safety: Safety distance between the robot's centre and obstacles, m.
        """
        self.safety = safety
        frame = grid.frame
        self._factor = max(1, round(TILE_SIZE / frame.resolution))
        self.size = self._factor * frame.resolution
        x, y = frame.origin
        self._corner = x - _PADDING * self.size, y - _PADDING * self.size
        self._sensed = self._tiles(grid.sensed_cells())
        self._near = self._tiles(grid.short_range_cells())
        self._clearance = self._tile_clearance(grid.blocked_cells(), frame.resolution)
        self._step_cost = step_cost(self._clearance, safety)

    @cached_property
    def unknown(self) -> Mask:
        """Unknown tiles: those in discs of ``HOLE_RADIUS`` without any sensed tile."""
        return self._opening(~self._sensed, HOLE_RADIUS)

    @cached_property
    def open(self) -> Mask:
        """Tiles where the robot may be."""
        return np.asarray(np.isfinite(self._step_cost) & ~self.unknown)

    @cached_property
    def free(self) -> Mask:
        """Tiles that have only sensed tiles and no obstacle within ``FREE_RADIUS``."""
        is_sensed = np.isinf(self._distances(~self._sensed, FREE_RADIUS))
        return np.asarray(is_sensed & ~self.nearer_than(FREE_RADIUS))

    @cached_property
    def frontiers(self) -> Mask:
        """Frontiers: open tiles next to unknown tiles."""
        return self.open & self._dilated(self.unknown)

    @cached_property
    def unvisited(self) -> Mask:
        """Open tiles that the robot has not yet seen at short range."""
        return self._opening(self.open & ~self._near, self.size)

    def reopened(self, tiles: Mask) -> "TraversabilityMap":
        """Return a map on which the given tiles are open, too."""
        other = copy(self)
        other.__dict__ |= {"open": self.open | tiles}
        other.__dict__.pop("frontiers", None)
        other.__dict__.pop("unvisited", None)
        inner = 1.0 + COSTLY_FACTOR
        is_shut = tiles & np.isinf(self._step_cost)
        other._step_cost = np.where(is_shut, inner, self._step_cost)
        return other

    def tiles_of(self, other: "TraversabilityMap", tiles: Mask) -> Mask:
        """Convert a mask of tiles from another map to this map, by their positions."""
        left, bottom = self._corner
        column = round((other._corner[0] - left) / self.size)
        row = round((other._corner[1] - bottom) / self.size)
        result = np.zeros_like(self.open)
        # A rebuilt map may be smaller, so tiles outside it are cropped from the mask.
        tiles = tiles[max(-row, 0) :, max(-column, 0) :]
        place = result[max(row, 0) :, max(column, 0) :]
        rows, columns = np.minimum(place.shape, tiles.shape)
        place[:rows, :columns] = tiles[:rows, :columns]
        return result

    def cells_of(self, tiles: Mask) -> Mask:
        """Return the cells of tiles, including cells beyond the edge of the grid."""
        inner = tiles[_PADDING:-_PADDING, _PADDING:-_PADDING]
        return inner.repeat(self._factor, axis=0).repeat(self._factor, axis=1)

    def tile_centers(self) -> tuple[Floats, Floats]:
        """Return the x of the centers of columns, (C,) m, and the y of rows, (R,) m."""
        rows, columns = self._clearance.shape
        left, bottom = self._corner
        x: Floats = left + (np.arange(columns, dtype=np.float64) + 0.5) * self.size
        y: Floats = bottom + (np.arange(rows, dtype=np.float64) + 0.5) * self.size
        return x, y

    def disc(self, x: float, y: float, radius: float) -> Mask:
        """Return the tiles within a radius of a point, m."""
        columns, rows = self.tile_centers()
        return np.asarray(np.hypot(columns - x, rows[:, None] - y) <= radius)

    def nearest(self, tiles: Mask, x: float, y: float) -> Mask:
        """Return a mask of one tile: the given tile that is nearest to a point, m."""
        columns, rows = self.tile_centers()
        distance = np.hypot(columns - x, rows[:, None] - y)
        chosen = np.zeros_like(tiles)
        chosen.flat[np.argmin(np.where(tiles, distance, math.inf))] = True
        return chosen & tiles

    def nearer_than(self, distance: float) -> Mask:
        """Return the tiles nearer to an obstacle than a given distance, m."""
        return np.asarray(self._clearance < distance)

    def area(self, tiles: Mask) -> float:
        """Return the area of some tiles, m²."""
        return float(np.count_nonzero(tiles)) * self.size**2

    def is_open(self, x: float, y: float) -> bool:
        """Return whether the robot may be at a point, m."""
        tile = self._tile(x, y)
        return self._is_inside(tile) and bool(self.open[tile])

    def is_line_cheap(self, pose: Pose2, x: float, y: float) -> bool:
        """Return whether the straight line to a point, m, stays away from obstacles."""
        if not self.is_open(x, y):
            return False
        # The line has two samples per tile length, so it misses only tile corners.
        steps = max(2, math.ceil(math.hypot(x - pose.x, y - pose.y) / self.size * 2))
        points = np.linspace((pose.x, pose.y), (x, y), steps + 1)
        tiles = np.array([self._tile(*point) for point in points.tolist()])
        inside = np.all((tiles >= 0) & (tiles < self.open.shape), axis=1)
        rows, columns = tiles.T
        if not inside.all() or self.unknown[rows, columns].any():
            return False
        # The first tile is excluded, so that a robot
        # too close to an obstacle can drive away.
        costs = self._step_cost[rows, columns]
        return bool(costs[1:].max() <= max(CHEAP, costs[-1]))

    def find_path(self, pose: Pose2, targets: Mask) -> Sequence[Point]:
        """Return the path, m, to the nearest of the given tiles; empty without a path.

        A path from a position too close to an obstacle may lead away from the obstacle.
        """
        start = self._tile(pose.x, pose.y)
        if not self._is_inside(start):
            return ()
        path = shortest_path(self._cost(pose, start), start, targets)
        x, y = self.tile_centers()
        return [(float(x[column]), float(y[row])) for row, column in path]

    def reachable(self, pose: Pose2) -> Mask:
        """Return the open tiles that the robot can reach."""
        start = self._tile(pose.x, pose.y)
        if not self._is_inside(start):
            return np.zeros_like(self.open)
        passable = np.isfinite(self._cost(pose, start))
        return np.asarray(flood_fill(passable, start) & self.open)

    def places_of(self, tiles: Mask, least_area: float) -> list[Point]:
        """Return the position of the middle tile, m, of each group of connected tiles.

        Args:
            tiles: (R, C).
            least_area: m²; smaller pieces are skipped.
        """
        labels, count = ndimage.label(tiles, np.ones((3, 3)))
        x, y = self.tile_centers()
        places = []
        for number in range(1, count + 1):
            rows, columns = np.nonzero(labels == number)
            if len(rows) * self.size**2 >= least_area:
                middle = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
                places.append((float(x[columns[middle]]), float(y[rows[middle]])))
        return places

    def outer_boundary(self, region: Mask) -> Mask:
        """Return the tiles near obstacles at the outer edge of a region of tiles.

        Edges around islands within the region are excluded.
        """
        # The map has a border of padding, so a fill from
        # one corner reaches all tiles outside the region.
        outside = flood_fill(~region, (0, 0))
        is_walled = self._clearance <= self.safety + 2 * self.size
        return np.asarray(region & self._dilated(outside) & is_walled)

    def _cost(self, pose: Pose2, start: Cell) -> Floats:
        """Return the cost of driving into each tile, (R, C); inf for closed tiles."""
        cost = np.where(self.open, self._step_cost, math.inf)
        if not self.open[start]:
            # A robot too close to an obstacle may drive away from the obstacle over
            # closed tiles, but not into unknown tiles.
            escape = self.disc(pose.x, pose.y, ESCAPE_RADIUS) & ~self.open
            escape &= (self._clearance >= self._clearance[start]) & ~self.unknown
            cost[escape] = ESCAPE_COST
        return cost

    def _tile(self, x: float, y: float) -> Cell:
        row = math.floor((y - self._corner[1]) / self.size)
        return row, math.floor((x - self._corner[0]) / self.size)

    def _is_inside(self, tile: Cell) -> bool:
        is_inside = np.less((-1, -1), tile) & np.less(tile, self._clearance.shape)
        return bool(is_inside.all())

    def _tiles(self, cells: Mask) -> Mask:
        # One sensed cell makes a tile sensed, since
        # the gaps between beams leave cells unknown.
        tiles = _blocks(cells, self._factor).any(axis=(1, 3))
        # A border of unknown tiles is added, so that
        # floor at the edge of the map is a frontier.
        return np.pad(tiles, _PADDING)

    def _tile_clearance(self, blocked: Mask, resolution: float) -> Floats:
        """Return each tile's least distance from an obstacle, m; inf beyond a limit."""
        # Distances beyond the limit do not change costs, so they are not computed.
        limit = self.safety + COSTLY + self.size
        cells = np.pad(blocked, _PADDING * self._factor)
        near = distance_field(cells, limit / resolution) * resolution
        tiles: Floats = _blocks(near, self._factor, math.inf).min(axis=(1, 3))
        return tiles

    def _distances(self, tiles: Mask, max_distance: float) -> Floats:
        """Return each tile's distance, m, to the nearest given tile; inf if too far."""
        return distance_field(tiles, max_distance / self.size) * self.size

    def _dilated(self, tiles: Mask) -> Mask:
        # A limit of 1.5 tiles includes diagonal neighbours, which are 1.41 tiles away,
        # but no tile beyond the neighbours.
        return np.isfinite(self._distances(tiles, 1.5 * self.size))

    def _opening(self, tiles: Mask, radius: float) -> Mask:
        # An opening (erosion, then dilation) keeps the
        # tiles of all discs that fit into the mask.
        inner = np.isinf(self._distances(~tiles, radius))
        return tiles & np.isfinite(self._distances(inner, radius))


def _blocks(cells: NDArray[Any], factor: int, fill: float = 0) -> NDArray[Any]:
    """Reshape a grid of cells into square tiles, (R, factor, C, factor)."""
    cells = np.pad(
        cells, [(0, -count % factor) for count in cells.shape], constant_values=fill
    )
    rows, columns = cells.shape
    return cells.reshape(rows // factor, factor, columns // factor, factor)
