"""Revisit: wait until an obstacle that blocks a passage has moved away.

Theory of operation
===================
If floor that was reachable becomes unreachable, an object has moved into a passage, and
may leave it again. Such an object stands on cells that the robot has seen free, while a
wall that narrows a passage stands on cells that were never seen before. So the strategy
stores which floor was open and free. When another strategy is done and unexplored space
remains behind a blocked passage, the robot drives towards the passage, stops at a
distance that leaves the object room to leave, and waits. Once the passage is free, the
robot explores on. If nothing changes for a while, it gives up the passage, and the run
ends as ``incomplete``.

At the end moved objects are removed from the map. Open floor keeps the safety distance
from all obstacles seen so far. So an obstacle that appears within this distance has
moved there: a standing obstacle looks larger from far away, not smaller. Small groups
of cells are ignored, since they are errors of poses and beams.
"""

import math
from typing import Final

import numpy as np
from scipy import ndimage

from radarsim.autonomy.exploration.coverage import coverage_strategy, frontier_strategy
from radarsim.autonomy.exploration.path_follower import (
    GIVEN_UP_RADIUS,
    WAITING,
    ExplorationSettings,
    PathFollower,
    Strategy,
)
from radarsim.autonomy.exploration.strategies import is_enclosed
from radarsim.autonomy.exploration.traversability import FREE_RADIUS, TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid, distance_field
from radarsim.autonomy.navigation.control import STOP, Twist, distance
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Point

ROOM: Final = 1.5  # m between the robot and the obstacle in its path
NEAR: Final = 0.4  # m from the watching position, within which it is reached
LOOK_TIME: Final = 40.0  # s of watching at one position
MOST_LOOKS: Final = 30  # times that the robot resumes exploring
LEAST_AREA: Final = 0.25  # m² of floor; smaller pieces are not reported
SMALLEST: Final = 6  # least number of cells of an object on floor that was open
GAP: Final = 0.1  # m; half the gap between pieces of one object
MARGIN: Final = 0.13  # m of tolerance for the safety distance, from whole tiles


class Revisit(Strategy):
    """Waits near obstacles that block passages, after another strategy has finished.

    Attributes:
        unreached: A point in each piece of floor that borders on unknown space and
            stayed closed off until the end, m.
    """

    min_scans = 0

    def __init__(
        self, settings: ExplorationSettings, strategy: Strategy, *, fills: bool
    ) -> None:
        """Create the strategy; it runs the given other strategy first.

        Args:
            settings: Settings of the exploration.
            strategy: The other strategy.
            fills: Whether the robot also covers floor not seen at short range.
        """
        super().__init__(settings)
        self.unreached: list[Point] = []
        self._strategy = strategy
        self._create = coverage_strategy if fills else frontier_strategy
        self._grid: OccupancyGrid | None = None
        self._floor: TraversabilityMap
        self._was_open: Mask = np.zeros((0, 0), np.bool_)
        self._may_open: Mask = self._was_open  # except given-up passages
        self._was_free: Mask = self._was_open
        self._since: float | None = None  # start of watching; None while exploring
        self._left: list[Point] = []  # targets that strategies have not explored
        self._looks = 0
        self._has_looked = False

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        twist = self._explore_or_look(observation, grid)
        self.activity = self._strategy.activity if self._since is None else WAITING
        return twist

    def _explore_or_look(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        is_new = self._path_follower.update_map(observation, grid)
        if is_new:
            self._remember(grid)
        if self._since is None:
            twist = self._strategy.step(observation, grid)
            if not self._strategy.is_done:
                return twist
            # The map is evaluated for this scan, since
            # an obstacle may just have closed a passage.
            self._path_follower = PathFollower(self._settings)
            self._path_follower.update_map(observation, grid)
            self._remember(grid)
            self._begin_to_look(observation)
        elif is_new:
            self._look(observation)
        if self.is_done or self._since is None:
            return STOP
        end = self._path_follower.end
        if end is None or distance(observation.pose, *end) < NEAR:
            return STOP
        return self._path_follower.step(observation)

    def find_unexplored(
        self, observation: Observation, grid: OccupancyGrid
    ) -> tuple[list[Point], list[Point]]:
        """Find floor left to explore; in an open area, only within the plan's radius.

        Args:
            observation: The newest observation.
            grid: The map.

        Returns:
            A point on each frontier that the robot can reach, and in each piece of
            floor where it would fit but that no passage leads to, m, map frame.
        """
        floor = self._settings.traversability(grid)
        reachable = floor.reachable(observation.pose)
        frontiers = floor.frontiers & reachable & self._near_start(observation, floor)
        cut_off = floor.open & ~reachable & self._near_start(observation, floor)
        return floor.places_of(frontiers, 0.0), floor.places_of(cut_off, LEAST_AREA)

    def forget_moved(self, grid: OccupancyGrid) -> None:
        """Remove from the final map the obstacles that have moved onto open floor.

        If the robot never had to wait, nothing is removed: no passage was blocked, so
        the few such cells are errors of poses and beams.
        """
        if not self._has_looked:
            return
        floor = self._settings.traversability(grid)
        was_open = floor.cells_of(floor.tiles_of(self._floor, self._was_open))
        rows, columns = grid.frame.shape
        safety = self._settings.bumpers.safety_distance
        grid.free(moved_things(grid, was_open[:rows, :columns], safety))

    def _remember(self, grid: OccupancyGrid) -> None:
        """Store which floor tiles have ever been open or free."""
        floor = self._path_follower.floor
        masks = [floor.open, floor.open, floor.free]
        # A rebuilt map shows the floor at new positions, so old masks are not used.
        if grid is self._grid:
            before = (self._was_open, self._may_open, self._was_free)
            masks = [
                mask | floor.tiles_of(self._floor, tiles)
                for mask, tiles in zip(masks, before, strict=True)
            ]
        self._was_open, self._may_open, self._was_free = masks
        self._grid, self._floor = grid, floor

    def _begin_to_look(self, observation: Observation) -> None:
        floor = self._floor
        reachable = floor.reachable(observation.pose)
        targets = self._targets(observation, self._was_open)
        if not (targets & ~reachable).any():
            self.is_done = True
            return
        self._left += floor.places_of(targets & reachable, 0.0)
        self._since, self._has_looked = observation.time, True
        self._look(observation)

    def _look(self, observation: Observation) -> None:
        """Choose where to wait for a passage to open, explore further, or finish."""
        floor, pose = self._floor, observation.pose
        assert self._since is not None
        beyond = self._reopened(self._may_open)
        targets = self._targets(observation, self._may_open)
        for place in self._left:
            targets = targets & ~floor.disc(*place, GIVEN_UP_RADIUS)
        path = beyond.find_path(pose, targets)
        at = next(
            (k for k, point in enumerate(path) if not floor.is_open(*point)), None
        )
        if not path or (at is None and self._looks >= MOST_LOOKS):
            self.is_done = True
            hidden = self._targets(observation, self._was_open)
            hidden &= ~floor.reachable(pose)
            self.unreached = floor.places_of(hidden, 0.0)
        elif at is None:
            self._looks += 1
            self._since = None
            self._strategy = self._create(self._settings)
        elif observation.time > self._since + LOOK_TIME:
            # The robot has waited long enough, so it
            # ignores the passage until the passage opens.
            shut = self._may_open & ~floor.open
            labels, _ = ndimage.label(shut, np.ones((3, 3)))
            number = labels[floor.nearest(shut, *path[at])]
            self._may_open = self._may_open & ~np.isin(labels, number)
            self._since = observation.time
        else:
            away = [p for p in path[:at] if math.dist(p, path[at]) >= ROOM]
            target = floor.nearest(floor.reachable(pose), *(away or path[:1])[-1])
            self._path_follower.plan(observation, target)

    def _targets(self, observation: Observation, also_open: Mask) -> Mask:
        """Return the frontiers that would be reachable if the tiles were open, too."""
        floor = self._reopened(also_open)
        targets = floor.frontiers & floor.reachable(observation.pose)
        return targets & self._near_start(observation, floor)

    def _near_start(self, observation: Observation, floor: TraversabilityMap) -> Mask:
        """Return the tiles to explore: in an open area, only those near the start."""
        start = self._start
        if start is None or is_enclosed(observation):
            return np.ones_like(floor.open)
        return floor.disc(start.x, start.y, self._settings.plan.radius)

    def _reopened(self, tiles: Mask) -> TraversabilityMap:
        """Return the map as if no moved obstacle stood on the given tiles."""
        floor = self._floor
        labels, _ = ndimage.label(tiles & ~floor.open, np.ones((3, 3)))
        came = labels[self._was_free & floor.nearer_than(FREE_RADIUS - MARGIN)]
        return floor.reopened((labels > 0) & np.isin(labels, came))


def moved_things(grid: OccupancyGrid, was_open: Mask, safety: float) -> Mask:
    """Return the cells of objects that have moved onto open floor, (R, C).

    Args:
        grid: The map.
        was_open: Cells of floor where the robot could have been, (R, C).
        safety: Safety distance between the robot's centre and obstacles, m.
    """
    blocked, size = grid.blocked_cells(), grid.frame.resolution
    reach = max(safety - MARGIN, 0.0) / size
    near = blocked & np.isfinite(distance_field(was_open, reach))
    # Gaps between beams split objects, so pieces near each other count as one object.
    joined = np.isfinite(distance_field(near, GAP / size))
    labels, count = ndimage.label(joined, np.ones((3, 3)))
    sizes = np.bincount(labels[blocked & was_open], minlength=count + 1)
    return np.asarray(near & (sizes[labels] >= SMALLEST))
