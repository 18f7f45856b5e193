"""Grids that scans are added to: of one robot, or shared by several.

Theory of operation
===================
When a loop closes, all scans have other poses, and the grid is built anew from them.
That takes seconds, in which a robot would drive on blindly. Some old scans are
therefore added to the new grid with each new scan, which the old grid gets meanwhile;
the new one replaces it when it holds all scans.

Several robots make one map. Each finds its poses on a map of points of its own, as it
does alone. Where that map is on the shared one is found by matching their points
(``map_alignment``); until then the robot's scans are in a grid of its own, and after
that, those before included, in the shared one. If that turns out to be wrong, all of
them go back to a grid of its own. The first robot's map is the shared one.

Robots see each other. What is beside the pose of another robot at the time of a scan is
left out of the map, as nothing that moves is part of it.
"""

from bisect import bisect_right
from dataclasses import replace
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import DTypeLike

from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.mapping.scan import BeamEnd, BeamHits, Layer, PlanarScan
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.geometry import Floats, Pose2, wrap_angle

SCANS_AT_ONCE: Final = 25  # old scans that are added with each new one
STANDING: Final = 0.02, 0.01  # m and rad within which a robot stands
SCANS_STANDING: Final = 20  # that are kept of a robot that stands
ROBOT_SIZE: Final = 0.65  # m around a robot's center within which it may be seen
ORIGIN: Final = Pose2(0.0, 0.0)


class ScanGrid(Protocol):
    """What a mapper adds its scans to."""

    @property
    def grid(self) -> OccupancyGrid:
        """The map; another object once it was built anew."""

    def on_map(self, pose: Pose2) -> Pose2:
        """Return a pose of the trajectory, on the map."""

    def without_robots(self, pose: Pose2, scan: PlanarScan) -> PlanarScan:
        """Return a scan, taken at a pose, without what is known to be other robots."""

    def add(self, trajectory: Trajectory, scan: PlanarScan) -> None:
        """Add a scan at the last pose of a trajectory."""

    def rebuild(self) -> None:
        """Begin to build the map anew, as a trajectory has changed."""

    def finish(self) -> None:
        """Build the rest of the new map, if one was begun."""


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
        self._last: dict[int, Pose2] = {}  # of each robot's last scan while driving
        self._standing: dict[int, int] = {}
        self._next: OccupancyGrid | None = None
        self._added = 0  # scans that the next grid holds

    def on_map(self, pose: Pose2) -> Pose2:
        """Return a pose of the trajectory, on the map: the same."""
        return pose

    def without_robots(
        self,
        pose: Pose2,  # noqa: ARG002 - shared maps need it
        scan: PlanarScan,
    ) -> PlanarScan:
        """Return the same scan: no other robots are known."""
        return scan

    def add(self, trajectory: Trajectory, scan: PlanarScan) -> None:
        """Add a scan at the last pose of a trajectory."""
        number = len(trajectory) - 1
        self._add(self.grid, StoredScan(trajectory, number, scan))
        # A robot that stands sees the same again and again: some of its scans will do.
        # Scans of several robots come in turn, and each robot stands for itself.
        robot, pose = id(trajectory), trajectory.poses[-1]
        last, (distance, angle) = self._last.get(robot), STANDING
        if (
            last is None
            or np.hypot(pose.x - last.x, pose.y - last.y) > distance
            or abs(wrap_angle(pose.yaw - last.yaw)) > angle
        ):
            self._last[robot], self._standing[robot] = pose, 0
        self._standing[robot] += 1
        if self._standing[robot] <= SCANS_STANDING:
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

    def place(self, stored: StoredScan) -> tuple[Pose2, PlanarScan]:
        """Return where a robot took a scan, and what of it is on the map."""
        return stored.trajectory.poses[stored.number], stored.scan

    def _continue(self, count: int) -> None:
        if self._next is None:
            return
        for stored in self.scans[self._added : self._added + count]:
            # In the types that kernels are compiled for, and not once more for others.
            exact = _converted(stored.scan, np.int64, np.float64)
            self._add(self._next, stored._replace(scan=exact))
            self._added += 1
        if self._added == len(self.scans):
            self.grid, self._next = self._next, None

    def _add(self, grid: OccupancyGrid, stored: StoredScan) -> None:
        pose, scan = self.place(stored)
        grid.add(pose, scan)
        if self._robot_radius:
            grid.clear_disc(pose, self._robot_radius)


def _converted(scan: PlanarScan, whole: DTypeLike, real: DTypeLike) -> PlanarScan:
    """Return a scan whose numbers are of other types."""
    hits = scan.hits
    converted = BeamHits(
        hits.beams.astype(whole), hits.near.astype(real), hits.far.astype(real), hits[3]
    )
    return replace(scan, known_range=scan.known_range.astype(real), hits=converted)


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
        # At each rebuild anew, since more is known by then of where the others were.
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
        # robots scan at different times; the latest pose before is near enough
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
        # The frame is known some seconds before the shared grid holds this robot's
        # scans. Until then it drives by its own.
        self.is_merged = self.is_merged or not self._shared.is_rebuilding

    def align(self, frame: Pose2) -> None:
        """Set where the robot's map is on the shared one, and merge both."""
        if self.frame is None:
            # Only once: from now on its scans go to the shared grid themselves.
            self._shared.scans.extend(self._own.scans)
        self.frame = frame
        self._shared.rebuild()

    def undo_alignment(self) -> None:
        """Take the robot's scans off the shared map; it goes on with its own map."""
        self.frame, self.is_merged = None, False
        shared, own = self._shared, self._own
        own.scans = [
            each for each in shared.scans if each.trajectory is self.trajectory
        ]
        shared.scans = [
            each for each in shared.scans if each.trajectory is not self.trajectory
        ]
        shared.rebuild()
        # At once, since it needs a map of its own to drive by.
        own.rebuild()
        own.finish()

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
    # Up to the robot all was free; what is behind it was hidden.
    np.minimum.at(known, ended, hits.near[is_inside])
    ends[ended] = BeamEnd.NOTHING
    is_left = ~is_inside & (hits.near <= known[hits.beams])
    left = hits.chosen(is_left)
    left = left._replace(far=np.minimum(left.far, known[left.beams]))
    return replace(scan, known_range=known, ends=ends, hits=left)
