"""Next-best view: to where much unknown area should be seen for a short way.

Theory of operation
===================
From a place q on open floor the robot would see A(q), the unknown area that straight
lines from there reach before they meet what blocks robots. The way there over open
floor has the length L(q). The robot drives to the place with the greatest
A(q) exp(-lambda L(q)), looks from there, and chooses again; it also does so as soon as
the place that it drives to would show nothing more.

Source: González-Baños and Latombe, "Navigation strategies for exploring indoor
environments", International Journal of Robotics Research 21 (2002). They draw places
at random near the edges of the map; here these are on a lattice and at frontiers, so
that a run can be repeated.
"""

import math
from typing import Final

import numpy as np

from radarsim.autonomy.exploration.coverage import FULL_TURN, TurnOnSpot
from radarsim.autonomy.exploration.path_follower import (
    ExplorationSettings,
    Strategy,
)
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.navigation.control import STOP, Twist, distance
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Floats, Point

DECAY: Final = 0.2  # 1/m; lambda: 5 m of way weigh as much as a factor e of area
VIEW_RANGE: Final = 10.0  # m around a place within which unknown area counts
LEAST_GAIN: Final = 0.25  # m² of unknown area that is worth a way
SPACING: Final = 1.0  # m between places on the lattice
ARRIVED: Final = 0.3  # m from a place from which it looks
APART: Final = 0.5  # m around where it has looked from, where it does not again
RAYS: Final = 90  # all round
GAP: Final = 0.4  # m; narrower gaps in walls are closed to sight


class NextBestView(Strategy):
    """Drives to the place with the greatest gain for its way."""

    activity = "viewing"

    def __init__(self, settings: ExplorationSettings) -> None:
        super().__init__(settings)
        self._turn = TurnOnSpot(FULL_TURN, settings.speed_limits)
        self._place: Point | None = None  # where it drives to, m
        self._looked_from: list[Point] = []  # m

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        if (turn := self._turn.step(observation)) is not None:
            return turn
        follower, place = self._path_follower, self._place
        has_arrived = place is not None and distance(observation.pose, *place) < ARRIVED
        if follower.update_map(observation, grid) or has_arrived:
            if has_arrived and place is not None:
                self._looked_from.append(place)
                self._place = None
            self.is_done = not self._plan(observation)
        return STOP if self.is_done else follower.step(observation)

    def _plan(self, observation: Observation) -> bool:
        """Plan the way to the place, or to another one; return whether there is one."""
        floor = self._path_follower.floor
        if self._place is not None:
            tile = floor.nearest(floor.open, *self._place)
            has_gain = gains(floor, tile)[0] >= LEAST_GAIN
            if has_gain and self._path_follower.plan(observation, tile):
                return True
        best = self._best_tile(observation, floor)
        if best is None:
            return False
        x, y = floor.tile_centers()
        row, column = np.argwhere(best)[0]
        self._place = float(x[column]), float(y[row])
        return self._path_follower.plan(observation, best)

    def _best_tile(
        self, observation: Observation, floor: TraversabilityMap
    ) -> Mask | None:
        """Return the tile with the greatest gain for its way; None if there is none."""
        tiles = self._candidates(observation, floor)
        areas, cells = gains(floor, tiles), np.argwhere(tiles)
        x, y = floor.tile_centers()
        pose = observation.pose
        straight = np.hypot(x[cells[:, 1]] - pose.x, y[cells[:, 0]] - pose.y)
        # No way is shorter than the straight line: most need not be planned.
        bounds = areas * np.exp(-DECAY * straight)
        most, best = 0.0, None
        for k in np.argsort(-bounds, kind="stable").tolist():
            if bounds[k] <= most:
                break
            if areas[k] < LEAST_GAIN:
                continue
            tile = np.zeros_like(tiles)
            tile[tuple(cells[k])] = True
            path = self._path_follower.find_path(floor, pose, tile)
            if not path:
                continue
            length = float(np.hypot(*np.diff(np.array(path), axis=0).T).sum())
            score = float(areas[k]) * math.exp(-DECAY * length)
            if score > most:
                most, best = score, tile
        return best

    def _candidates(self, observation: Observation, floor: TraversabilityMap) -> Mask:
        """Return the tiles from which the robot may look, (R, C)."""
        reachable = floor.reachable(observation.pose)
        tiles = np.zeros_like(reachable)
        step = max(1, round(SPACING / floor.size))
        tiles[::step, ::step] = True
        for place in floor.places_of(floor.frontiers & reachable, 0.0):
            tiles |= floor.nearest(reachable, *place)
        for place in self._looked_from:
            tiles &= ~floor.disc(*place, APART)
        return tiles & reachable


def gains(floor: TraversabilityMap, tiles: Mask) -> Floats:
    """Return the unknown area that should be seen from each of some tiles, (N,) m²."""
    # Beams leave gaps in far walls, and lines would slip through these.
    walls = floor.nearer_than(GAP / 2)
    area = visible_area(floor.unknown, walls, tiles, round(VIEW_RANGE / floor.size))
    return area * floor.size**2


def visible_area(unknown: Mask, walls: Mask, tiles: Mask, reach: int) -> Floats:
    """Return the unknown area that straight lines from some tiles reach.

    Args:
        unknown: (R, C) tiles that count, as do all outside of the map.
        walls: (R, C) tiles at which lines end.
        tiles: (R, C) where lines begin; N of them.
        reach: Length of a line, tiles.

    Returns:
        (N,) tiles.
    """
    # All outside of the map is like its padded border.
    unknown = np.pad(unknown, 1, constant_values=True)
    walls = np.pad(walls, 1)
    centres = np.argwhere(tiles)[:, None, :] + 1.5
    angles = np.linspace(0.0, 2 * math.pi, RAYS, endpoint=False)
    steps = np.column_stack([np.sin(angles), np.cos(angles)])
    most = np.array(unknown.shape) - 1
    areas = np.zeros(len(centres))
    is_open = np.ones((len(centres), RAYS), np.bool_)
    for away in range(1, reach + 1):
        cells = np.floor(centres + away * steps).astype(np.int64)
        rows, columns = np.moveaxis(np.clip(cells, 0, most), -1, 0)
        is_open &= ~walls[rows, columns]
        seen = np.count_nonzero(is_open & unknown[rows, columns], axis=1)
        # a sector of a ring of the width of a tile
        areas += seen * away * 2 * math.pi / RAYS
    return areas
