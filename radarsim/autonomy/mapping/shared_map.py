"""A map that several robots make together.

Theory of operation
===================
Each robot finds its poses on a map of points of its own, as it does alone. Where that
map is on the shared one is found by matching their points (``map_alignment``); until
then the robot's scans are in a grid of its own, and after that, those before included,
in the shared one. The first robot's map is the shared one.

Robots see each other. What is beside the pose of another robot at the time of a scan is
left out of the map, as nothing that moves is part of it.
"""

from bisect import bisect_right
from dataclasses import replace
from typing import Final

import numpy as np

from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.rebuildable_grid import RebuildableGrid, StoredScan
from radarsim.autonomy.mapping.scan import BeamEnd, Layer, PlanarScan
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.geometry import Floats, Pose2

ROBOT_SIZE: Final = 0.65  # m around a robot's center within which it may be seen
ORIGIN: Final = Pose2(0.0, 0.0)


class SharedMap(RebuildableGrid):
    """One grid of the scans of several robots.

    Attributes:
        robots: The maps of the robots, in the order in which they joined.
    """

    def __init__(self, resolution: float) -> None:
        """Create an empty map.

        Args:
            resolution: Side of a cell, m.
        """
        super().__init__(resolution, 0.0)
        self.robots: list[RobotMap] = []

    @property
    def is_rebuilding(self) -> bool:
        """Whether the grid is not yet what the scans make."""
        return self._next is not None

    def join(self, robot_radius: float) -> "RobotMap":
        """Return the map of a further robot; the first one's is aligned.

        Args:
            robot_radius: Radius of the disc around a robot that is marked free, m.
        """
        self._robot_radius = robot_radius
        robot = RobotMap(self, None if self.robots else ORIGIN)
        self.robots.append(robot)
        return robot

    def new_grid(self) -> RebuildableGrid:
        """Return an empty grid like this one."""
        return RebuildableGrid(self.grid.frame.resolution, self._robot_radius)

    def place(self, stored: StoredScan) -> tuple[Pose2, PlanarScan]:
        """Return where a robot took a scan, and what of it is on the map."""
        (robot,) = (r for r in self.robots if r.trajectory is stored.trajectory)
        pose = stored.trajectory.poses[stored.number]
        return robot.frame_pose.compose(pose), robot.without_robots(pose, stored.scan)


class RobotMap:
    """The map of one robot, and where it is on the shared one.

    Attributes:
        frame: Pose of its origin on the shared map; None before it is known.
        trajectory: The robot's poses on its own map; None before its first scan.
        is_merged: Whether the robot's scans are on the shared map.
    """

    def __init__(self, shared: SharedMap, frame: Pose2 | None) -> None:
        self.frame = frame
        self.trajectory: Trajectory | None = None
        self._shared = shared
        self._own = shared.new_grid()
        self.is_merged = frame is not None

    @property
    def frame_pose(self) -> Pose2:
        """``frame``, or the first guess: that the start poses are right."""
        return self.frame or ORIGIN

    @property
    def grid(self) -> OccupancyGrid:
        """The shared map, once this robot's scans are on it; before its own."""
        return (self._shared if self.is_merged else self._own).grid

    def on_map(self, pose: Pose2) -> Pose2:
        """Return a pose of the trajectory, on the map."""
        return self.frame_pose.compose(pose) if self.is_merged else pose

    def pose_at(self, time: float) -> Pose2 | None:
        """Return where the robot was on the shared map; None if it is not known."""
        if self.frame is None or self.trajectory is None:
            return None
        number = max(bisect_right(self.trajectory.times, time) - 1, 0)
        return self.frame.compose(self.trajectory.poses[number])

    def without_robots(self, pose: Pose2, scan: PlanarScan) -> PlanarScan:
        """Return a scan, taken at a pose, without what is known to be other robots."""
        if self.frame is None:
            return scan
        others = [each for each in self._shared.robots if each is not self]
        poses = [each.pose_at(scan.time) for each in others]
        here = self.frame.compose(pose)
        near = [each.relative_to(here) for each in poses if each is not None]
        centers = np.array([(each.x, each.y) for each in near]).reshape(-1, 2)
        return without_discs(scan, centers, ROBOT_SIZE)

    def add(self, trajectory: Trajectory, scan: PlanarScan) -> None:
        """Add a scan at the last pose of a trajectory."""
        self.trajectory = trajectory
        if self.frame is None:
            self._own.add(trajectory, scan)
            return
        self._shared.add(trajectory, scan)
        self.is_merged = self.is_merged or not self._shared.is_rebuilding

    def align(self, frame: Pose2) -> None:
        """Set where the robot's map is on the shared one, and merge both."""
        if self.frame is None:
            self._shared.scans.extend(self._own.scans)
        self.frame = frame
        self._shared.rebuild()

    def rebuild(self) -> None:
        """Begin to build the map anew, as the trajectory has changed."""
        (self._own if self.frame is None else self._shared).rebuild()

    def finish(self) -> None:
        """Build the rest of the new map, if one was begun."""
        self._own.finish()
        self._shared.finish()
        self.is_merged = self.frame is not None


def without_discs(scan: PlanarScan, centers: Floats, radius: float) -> PlanarScan:
    """Return a scan without what is solid in some discs, nor what is behind it.

    Args:
        scan: The scan.
        centers: (M, 2) m, in the robot's frame.
        radius: m.
    """
    hits, mount = scan.hits, scan.mount
    angles = scan.angles[hits.beams] + mount.yaw
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    places = along * hits.near[:, None] + (mount.x, mount.y)
    offsets = places[:, None, :] - centers
    is_inside = (np.hypot(offsets[..., 0], offsets[..., 1]) < radius).any(axis=1)
    is_inside &= hits.layer == Layer.SOLID
    if not is_inside.any():
        return scan
    ended = hits.beams[is_inside]
    known, ends = scan.known_range.copy(), scan.ends.copy()
    np.minimum.at(known, ended, hits.near[is_inside])
    ends[ended] = BeamEnd.NOTHING
    is_left = ~is_inside & (hits.near <= known[hits.beams])
    left = hits.chosen(is_left)
    left = left._replace(far=np.minimum(left.far, known[left.beams]))
    return replace(scan, known_range=known, ends=ends, hits=left)
