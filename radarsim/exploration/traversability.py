"""Traversability map: where a robot may go by the map so far, and what is left to see.

Theory of operation
===================
Cells of the map are joined to tiles of about 0.1 m. At a distance beams are so far
apart that cells between them stay unknown, so a tile counts as unknown only where a
small disc fits in which nothing was sensed, and all other tiles as sensed. Open tiles
are sensed and keep the safety distance from what robots cannot enter. Frontiers are
open tiles next to unknown ones. Unvisited tiles are open ones that no beam has passed
at short range.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.mapping.distance_field import distance_field
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.navigation.grid_path import Cell, flood_fill, shortest_path

TILE_SIZE: Final = 0.1  # m, about
HOLE_RADIUS: Final = 0.25  # m, of the smallest hole that counts as unknown
MARGIN: Final = 0.12  # m that paths keep on top of the safety distance
COSTLY_MARGIN: Final = 0.4  # m beyond that, where paths lead only if others are longer
COSTLY_FACTOR: Final = 4.0  # added at its inner edge to the cost of a step, which is 1
ESCAPE_RADIUS: Final = 1.0  # m around a robot that is too near to something
ESCAPE_COST: Final = 10.0
_PADDING: Final = 4  # unknown tiles around the map

Point = tuple[float, float]


class TraversabilityMap:
    """Tiles of the map at one moment; masks of tiles are (R, C).

    Attributes:
        safety: Distance to keep from the robot's center, m.
        size: Side of a tile, m.
    """

    def __init__(self, grid: OccupancyGrid, safety: float) -> None:
        """Evaluate a map.

        Args:
            grid: The map.
            safety: Distance from the robot's center to what it cannot enter, m.
        """
        self.safety = safety
        frame = grid.frame
        self._factor = max(1, round(TILE_SIZE / frame.resolution))
        self.size = self._factor * frame.resolution
        x, y = frame.origin
        self._corner = x - _PADDING * self.size, y - _PADDING * self.size
        self._sensed = self._tiles(grid.sensed_cells())
        self._near = self._tiles(grid.short_range_cells())
        blocked = self._tiles(grid.blocked_cells())
        self._clearance = self._distances(blocked, safety + MARGIN + COSTLY_MARGIN)

    @cached_property
    def unknown(self) -> Mask:
        """Tiles in a disc in which nothing was sensed."""
        return self._opening(~self._sensed, HOLE_RADIUS)

    @cached_property
    def open(self) -> Mask:
        """Tiles where the robot may be."""
        is_clear = self._clearance > self.safety + MARGIN
        return np.asarray(is_clear & ~self.unknown)

    @cached_property
    def frontiers(self) -> Mask:
        """Open tiles next to unknown ones."""
        return self.open & self._dilated(self.unknown)

    @cached_property
    def unvisited(self) -> Mask:
        """Open tiles that were not seen at short range."""
        return self._opening(self.open & ~self._near, self.size)

    def tile_centers(self) -> tuple[Floats, Floats]:
        """Return the centers of columns, (C,) x, and of rows, (R,) y, m."""
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
        """Return only the tile that is nearest to a point, m, of some tiles."""
        columns, rows = self.tile_centers()
        distance = np.hypot(columns - x, rows[:, None] - y)
        chosen = np.zeros_like(tiles)
        chosen.flat[np.argmin(np.where(tiles, distance, math.inf))] = True
        return chosen & tiles

    def area(self, tiles: Mask) -> float:
        """Return the area of some tiles, m²."""
        return float(np.count_nonzero(tiles)) * self.size**2

    def is_open(self, x: float, y: float) -> bool:
        """Return whether the robot may be at a point, m."""
        tile = self._tile(x, y)
        return self._is_inside(tile) and bool(self.open[tile])

    def is_line_open(self, pose: Pose2, x: float, y: float) -> bool:
        """Return whether the straight line from the robot to a point, m, is open."""
        steps = max(2, math.ceil(math.hypot(x - pose.x, y - pose.y) / self.size * 2))
        along = np.linspace(0.0, 1.0, steps + 1)[1:]
        points = zip(
            pose.x + along * (x - pose.x), pose.y + along * (y - pose.y), strict=True
        )
        return all(self.is_open(*point) for point in points)

    def find_path(self, pose: Pose2, targets: Mask) -> Sequence[Point]:
        """Return the path to the nearest of some tiles, m; empty if there is none.

        A robot nearer to something than it should be may leave, as long as it gets no
        nearer.
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

    def outer_boundary(self, region: Mask) -> Mask:
        """Return the tiles at the outer edge of a region that run along obstacles.

        The edges around islands within the region do not count.
        """
        outside = flood_fill(~region, (0, 0))
        is_walled = self._clearance <= self.safety + MARGIN + 2 * self.size
        return np.asarray(region & self._dilated(outside) & is_walled)

    def _cost(self, pose: Pose2, start: Cell) -> Floats:
        """Return the cost of a step into each tile; inf where the robot may not be."""
        missing = (
            self.safety + MARGIN + COSTLY_MARGIN - np.minimum(self._clearance, 1e9)
        )
        extra = COSTLY_FACTOR * np.maximum(missing, 0.0) / COSTLY_MARGIN
        cost = np.where(self.open, 1.0 + extra, math.inf)
        if not self.open[start]:
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
        """Return the tiles that hold any of some cells, with padding."""
        factor = self._factor
        rows, columns = (-(-count // factor) for count in cells.shape)
        tiles = np.zeros((rows, columns), np.bool_)
        for i in range(factor):
            for j in range(factor):
                subset = cells[i::factor, j::factor]
                tiles[: subset.shape[0], : subset.shape[1]] |= subset
        return np.pad(tiles, _PADDING)

    def _distances(self, tiles: Mask, max_distance: float) -> Floats:
        """Return the distance to the nearest of some tiles, m; inf beyond the limit."""
        return distance_field(tiles, max_distance / self.size) * self.size

    def _dilated(self, tiles: Mask) -> Mask:
        """Return some tiles with their neighbors."""
        return np.isfinite(self._distances(tiles, 1.5 * self.size))

    def _opening(self, tiles: Mask, radius: float) -> Mask:
        """Return the morphological opening of some tiles by a disc."""
        inner = np.isinf(self._distances(~tiles, radius))
        return tiles & np.isfinite(self._distances(inner, radius))
