"""The grid that a robot's scans are added to, which can be built again.

Theory of operation
===================
When a loop closes, all scans have other poses, and the grid is built anew from them.
That takes seconds, in which a robot would drive on blindly. Some old scans are
therefore added to the new grid with each new scan, which the old grid gets meanwhile;
the new one replaces it when it holds all scans.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.scan import BeamHits, PlanarScan
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.geometry import Floats, Pose2, rotation_matrix, wrap_angle

SCANS_AT_ONCE: Final = 25  # old scans that are added with each new one
STANDING: Final = 0.02, 0.01  # m and rad within which a robot stands
SCANS_STANDING: Final = 20  # that are kept of a robot that stands
PLACE: Final = 1.0  # m between places from which something is seen
SQUARE: Final = 0.25  # m; noise spreads the ends of beams over cells

_Squares: TypeAlias = NDArray[np.int64]


class StoredScan(NamedTuple):
    """A scan that a grid consists of.

    Attributes:
        trajectory: Trajectory of the robot that took it.
        number: Number of its pose.
        scan: The scan.
    """

    trajectory: Trajectory
    number: int
    scan: PlanarScan


class RebuildableGrid:
    """A grid, and the scans that it consists of.

    Attributes:
        grid: The map; another object once it was built anew.
        scans: The scans.
    """

    def __init__(self, resolution: float, robot_radius: float) -> None:
        """Create an empty map.

        Args:
            resolution: Side of a cell, m.
            robot_radius: Radius of the disc around the robot that is marked free, m; 0
                for none.
        """
        self.grid = OccupancyGrid(resolution)
        self.scans: list[StoredScan] = []
        self._robot_radius = robot_radius
        self._last: Pose2 | None = None  # of the last scan while driving
        self._standing = 0
        self._next: OccupancyGrid | None = None
        self._added = 0  # scans that the next grid holds

    def add(self, trajectory: Trajectory, scan: PlanarScan) -> None:
        """Add a scan at the last pose of a trajectory."""
        number = len(trajectory) - 1
        self._add(self.grid, StoredScan(trajectory, number, scan))
        # A robot that stands sees the same again and again: some of its scans will do.
        pose = trajectory.poses[-1]
        last, (distance, angle) = self._last, STANDING
        if (
            last is None
            or np.hypot(pose.x - last.x, pose.y - last.y) > distance
            or abs(wrap_angle(pose.yaw - last.yaw)) > angle
        ):
            self._last, self._standing = pose, 0
        self._standing += 1
        if self._standing <= SCANS_STANDING:
            # in half the memory, since all scans of a run are kept
            compact = _converted(scan, np.int32, np.float32)
            self.scans.append(StoredScan(trajectory, number, compact))
        self._continue(SCANS_AT_ONCE)

    def rebuild(self) -> None:
        """Begin to build the grid anew, as a trajectory has changed."""
        # If another grid was being built, it is dropped: its poses are no longer right.
        self._next, self._added = OccupancyGrid(self.grid.frame.resolution), 0

    def finish(self) -> None:
        """Build the rest of the new grid, if one was begun."""
        self._continue(len(self.scans))

    def seen_from_one_place(self) -> float:
        """Return the share of what is solid that was seen from only one place.

        Places are at least 1 m from each other. Squares of 0.25 m are counted.
        """
        seen: dict[tuple[float, float], list[_Squares]] = {}
        for trajectory, number, scan in self.scans:
            pose = trajectory.poses[number]
            here = pose.x, pose.y
            near = (place for place in seen if math.dist(place, here) < PLACE)
            points = scan.points()[0] @ rotation_matrix(0.0, 0.0, pose.yaw)[:2, :2].T
            squares = _squares(points + np.array(here))
            seen.setdefault(next(near, here), []).append(squares)
        all_squares = [np.unique(np.concatenate(each)) for each in seen.values()]
        found, counts = np.unique(np.concatenate(all_squares), return_counts=True)
        x, y = self.grid.frame.cell_centers()
        rows, columns = np.nonzero(self.grid.classes() == CellClass.OBSTACLE)
        solid = _squares(np.column_stack([x[columns], y[rows]]))
        once = np.isin(solid, found[counts > 1], invert=True)
        return float(np.count_nonzero(once)) / max(len(once), 1)

    def _continue(self, count: int) -> None:
        if self._next is None:
            return
        for stored in self.scans[self._added : self._added + count]:
            # in the types that the engine takes
            exact = _converted(stored.scan, np.int64, np.float64)
            self._add(self._next, stored._replace(scan=exact))
            self._added += 1
        if self._added == len(self.scans):
            self.grid, self._next = self._next, None

    def _add(self, grid: OccupancyGrid, stored: StoredScan) -> None:
        pose = stored.trajectory.poses[stored.number]
        grid.add(pose, stored.scan)
        if self._robot_radius:
            grid.clear_disc(pose, self._robot_radius)


def _squares(points: Floats) -> _Squares:
    """Return the numbers of the squares that points are in, each once."""
    column, row = np.floor(points / SQUARE).astype(np.int64).T
    return np.unique((column << 32) + row)


def _converted(scan: PlanarScan, whole: DTypeLike, real: DTypeLike) -> PlanarScan:
    """Return a scan whose numbers are of other types."""
    hits = scan.hits
    converted = BeamHits(
        hits.beams.astype(whole), hits.near.astype(real), hits.far.astype(real), hits[3]
    )
    return replace(scan, known_range=scan.known_range.astype(real), hits=converted)
