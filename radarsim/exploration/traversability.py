"""What a robot that explores makes of the map: where it may go, and what is left to do.

Theory of operation
===================
The map's cells are joined to tiles of about a hand's breadth. Beams are so far apart
at a distance that cells between them stay unsensed; so a tile counts as unknown only
where there is room for a small disc that nothing has been sensed in, and all other
tiles as sensed. Open is what is sensed and keeps away from what robots cannot enter. A
frontier is where open floor and the unknown meet. Floor is seen well once beams have
gone through it at short range.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np

from radarsim.exploration.shortest_path import Cell, flood_fill, shortest_path
from radarsim.geometry import Floats, Pose2
from radarsim.mapping.distance_field import distance_field
from radarsim.mapping.occupancy_grid import Mask, OccupancyGrid

TILE: Final = 0.1  # m, about
GAP: Final = 0.25  # m, radius of the least hole that counts as unknown
MARGIN: Final = 0.12  # m that a way keeps on top of the safety distance
SHY: Final = 0.4  # m beyond that in which a way goes only if others are much longer
LEAVING: Final = 1.0  # m around the robot where it may get away from what is too near
_PADDING: Final = 4  # tiles of the unknown around the map

Point = tuple[float, float]


class TraversabilityMap:
    """The floor by the map of one moment.

    Attributes:
        safety: Distance that is kept, m.
        size: Side of a tile, m.
    """

    def __init__(self, grid: OccupancyGrid, safety: float) -> None:
        """Look at a map.

        Args:
            grid: What is known.
            safety: From the robot's centre to what it cannot enter, m.
        """
        self.safety = safety
        frame = grid.frame
        self._factor = max(1, round(TILE / frame.resolution))
        self.size = self._factor * frame.resolution
        x, y = frame.origin
        self._corner = x - _PADDING * self.size, y - _PADDING * self.size
        self._sensed = self._joined(grid.sensed_cells())
        self._near = self._joined(grid.short_range_cells())
        away = safety + MARGIN + SHY
        self._room = self._distances(self._joined(grid.blocked_cells()), away)

    @cached_property
    def unknown(self) -> Mask:
        """Where a disc fits that nothing has been sensed in, (R, C)."""
        return self._opened(~self._sensed, GAP)

    @cached_property
    def open(self) -> Mask:
        """Where the robot may be, (R, C)."""
        return np.asarray((self._room > self.safety + MARGIN) & ~self.unknown)

    @cached_property
    def frontiers(self) -> Mask:
        """Open floor that the unknown is next to, (R, C)."""
        beside = np.isfinite(self._distances(self.unknown, 1.5 * self.size))
        return np.asarray(self.open & beside)

    @cached_property
    def unvisited(self) -> Mask:
        """Open floor that has not been seen at short range, (R, C)."""
        return self._opened(self.open & ~self._near, self.size)

    def cell_centers(self) -> tuple[Floats, Floats]:
        """Give the middles of columns, (C,) x, and of rows, (R,) y, m."""
        rows, columns = self._room.shape
        x, y = self._corner
        across: Floats = x + (np.arange(columns, dtype=np.float64) + 0.5) * self.size
        up: Floats = y + (np.arange(rows, dtype=np.float64) + 0.5) * self.size
        return across, up

    def within(self, x: float, y: float, radius: float) -> Mask:
        """Give what is at most so far from a place, (R, C)."""
        across, up = self.cell_centers()
        return np.asarray(np.hypot(across - x, up[:, None] - y) <= radius)

    def nearest(self, tiles: Mask, x: float, y: float) -> Mask:
        """Give the one of some tiles that is nearest to a place, (R, C)."""
        across, up = self.cell_centers()
        away = np.where(tiles, np.hypot(across - x, up[:, None] - y), math.inf)
        chosen = np.zeros_like(tiles)
        chosen.flat[np.argmin(away)] = True
        return chosen & tiles

    def area(self, tiles: Mask) -> float:
        """Give the area of some tiles, m²."""
        return float(np.count_nonzero(tiles)) * self.size**2

    def is_open(self, x: float, y: float) -> bool:
        """Tell whether the robot may be at a place."""
        tile = self._tile(x, y)
        return self._is_inside(tile) and bool(self.open[tile])

    def is_straight(self, pose: Pose2, x: float, y: float) -> bool:
        """Tell whether the straight way from the robot to a place is open."""
        steps = max(2, math.ceil(math.hypot(x - pose.x, y - pose.y) / self.size * 2))
        along = np.linspace(0.0, 1.0, steps + 1)[1:]
        places = zip(
            pose.x + along * (x - pose.x), pose.y + along * (y - pose.y), strict=True
        )
        return all(self.is_open(*place) for place in places)

    def find_path(self, pose: Pose2, targets: Mask) -> Sequence[Point]:
        """Give the way to the nearest of some tiles, m; none if nothing leads there.

        A robot that stands nearer to something than it should may leave, as long as it
        gets no nearer.
        """
        start = self._tile(pose.x, pose.y)
        if not self._is_inside(start):
            return ()
        way = shortest_path(self._cost(pose, start), start, targets)
        across, up = self.cell_centers()
        return [(float(across[column]), float(up[row])) for row, column in way]

    def reachable(self, pose: Pose2) -> Mask:
        """Give the open floor that the robot can get to, (R, C)."""
        start = self._tile(pose.x, pose.y)
        if not self._is_inside(start):
            return np.zeros_like(self.open)
        passable = np.isfinite(self._cost(pose, start))
        return np.asarray(flood_fill(passable, start) & self.open)

    def outer_boundary(self, region: Mask) -> Mask:
        """Give the part of a region beside which something keeps the robot out, (R, C).

        Only its outer edge counts, and not what goes round islands within it.
        """
        outside = flood_fill(~region, (0, 0))
        beside = np.isfinite(self._distances(outside, 1.5 * self.size))
        walled = self._room <= self.safety + MARGIN + 2 * self.size
        return np.asarray(region & beside & walled)

    def _cost(self, pose: Pose2, start: Cell) -> Floats:
        shy = self.safety + MARGIN + SHY - np.minimum(self._room, 1e9)
        cost = np.where(self.open, 1.0 + 4.0 * np.maximum(shy, 0.0) / SHY, math.inf)
        if not self.open[start]:
            leaving = self.within(pose.x, pose.y, LEAVING) & ~self.open
            leaving &= (self._room >= self._room[start]) & ~self.unknown
            cost[leaving] = 10.0
        return cost

    def _tile(self, x: float, y: float) -> Cell:
        row = math.floor((y - self._corner[1]) / self.size)
        return row, math.floor((x - self._corner[0]) / self.size)

    def _is_inside(self, tile: Cell) -> bool:
        inside = np.less((-1, -1), tile) & np.less(tile, self._room.shape)
        return bool(inside.all())

    def _joined(self, cells: Mask) -> Mask:
        """Give tiles with any such cell, and a frame without."""
        factor = self._factor
        rows, columns = (-(-count // factor) for count in cells.shape)
        tiles = np.zeros((rows, columns), np.bool_)
        for down in range(factor):
            for across in range(factor):
                part = cells[down::factor, across::factor]
                tiles[: part.shape[0], : part.shape[1]] |= part
        return np.pad(tiles, _PADDING)

    def _distances(self, tiles: Mask, reach: float) -> Floats:
        """Give how far each tile is from the nearest of some, m; inf out of reach."""
        distances: Floats = distance_field(tiles, reach / self.size) * self.size
        return distances

    def _opened(self, tiles: Mask, radius: float) -> Mask:
        """Leave out of some tiles where no disc fits in."""
        inner = np.isinf(self._distances(~tiles, radius))
        return tiles & np.isfinite(self._distances(inner, radius))
