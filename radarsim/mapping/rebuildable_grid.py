"""A grid that is built anew when a loop closure moves the poses of its scans.

Building takes seconds, in which a robot would drive on blindly. Some old scans are
therefore added to the new grid with each new scan, which the old grid gets meanwhile;
the new one replaces it when it holds all scans.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from radarsim.geometry import Pose2, wrap_angle
from radarsim.mapping.occupancy_grid import OccupancyGrid
from radarsim.mapping.scan import BeamHits, PlanarScan
from radarsim.mapping.trajectory import Trajectory

SCANS_AT_ONCE: Final = 25  # old scans that are added with each new one
STANDING: Final = 0.02, 0.01  # m and rad within which a robot stands
SCANS_STANDING: Final = 20  # that are kept of a robot that stands


class RebuildableGrid:
    """A grid, and the scans that it consists of.

    Attributes:
        grid: The map; another object once it was built anew.
    """

    def __init__(self, resolution: float, robot_radius: float) -> None:
        """Create an empty map.

        Args:
            resolution: Side of a cell, m.
            robot_radius: Radius of the disc around the robot that is marked free, m; 0
                for none.
        """
        self.grid = OccupancyGrid(resolution)
        self._robot_radius = robot_radius
        self._scans: list[tuple[int, PlanarScan]] = []
        self._last: Pose2 | None = None  # of the last scan that was taken while driving
        self._standing = 0
        self._next: OccupancyGrid | None = None
        self._added = 0  # scans that the next grid holds

    def add(self, trajectory: Trajectory, scan: PlanarScan) -> None:
        """Add a scan at the last pose of a trajectory."""
        pose = trajectory.poses[-1]
        self._add(self.grid, pose, scan)
        if self._is_worth_keeping(pose):
            self._scans.append(
                (len(trajectory) - 1, _converted(scan, np.int32, np.float32))
            )
        self._continue(trajectory, SCANS_AT_ONCE)

    def rebuild(self) -> None:
        """Begin to build the grid anew, as the trajectory has changed."""
        self._next, self._added = OccupancyGrid(self.grid.frame.resolution), 0

    def finish(self, trajectory: Trajectory) -> None:
        """Build the rest of the new grid, if one was begun."""
        self._continue(trajectory, len(self._scans))

    def _continue(self, trajectory: Trajectory, count: int) -> None:
        if self._next is None:
            return
        for number, scan in self._scans[self._added : self._added + count]:
            exact = _converted(scan, np.int64, np.float64)
            self._add(self._next, trajectory.poses[number], exact)
            self._added += 1
        if self._added == len(self._scans):
            self.grid, self._next = self._next, None

    def _add(self, grid: OccupancyGrid, pose: Pose2, scan: PlanarScan) -> None:
        grid.add(pose, scan)
        if self._robot_radius:
            grid.clear_disc(pose, self._robot_radius)

    def _is_worth_keeping(self, pose: Pose2) -> bool:
        """Count the scans of a robot that stands, and return whether these are few."""
        distance, angle = STANDING
        if (
            self._last is None
            or np.hypot(pose.x - self._last.x, pose.y - self._last.y) > distance
            or abs(wrap_angle(pose.yaw - self._last.yaw)) > angle
        ):
            self._last, self._standing = pose, 0
        self._standing += 1
        return self._standing <= SCANS_STANDING


def _converted(scan: PlanarScan, whole: Any, real: Any) -> PlanarScan:
    """Return a scan whose numbers are of other types."""
    hits = scan.hits
    converted = BeamHits(
        hits.beams.astype(whole), hits.near.astype(real), hits.far.astype(real), hits[3]
    )
    return replace(scan, known_range=scan.known_range.astype(real), hits=converted)
