"""Mapper: builds a map from the reports of one robot, over any connection.

A mapper is passed every report of a robot: echoes, ranges, and poses. It finds the pose
of each scan (``slam``) and adds the scan to the grid. If a server sends echoes, a scan
with missing echoes is used to find the pose but not for the map, since the range of a
radar alone does not distinguish foliage from a wall.

When a loop closes, the poses of all scans change, and the grid is rebuilt from the
scans. A rebuild takes seconds, in which a robot would drive on blindly. So it is done
in steps: each new scan is added to the old grid, and with it some stored scans are
added to the new grid. The new grid replaces the old grid once it contains all scans.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

from radarsim.autonomy.mapping.occupancy_grid import (
    RESOLUTION,
    CellClass,
    OccupancyGrid,
)
from radarsim.autonomy.mapping.scan import BeamHits, Layer, PlanarScan, scan_of
from radarsim.autonomy.mapping.slam import MotionReports, Slam
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.navigation.observation import Observation, ScanReader
from radarsim.autonomy.plans import MotionSource
from radarsim.client import ScannerInfo
from radarsim.client.robot_info import from_centre
from radarsim.geometry import Floats, Point, Pose2, rotation_matrix
from radarsim.protocol.reports import (
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)

MAX_SCANS_WITHOUT_MOTION: Final = 50  # scans without a motion report
TRUTH_INTERVAL: Final = 0.05  # s; ground truth poses in between are not stored

SCANS_AT_ONCE: Final = 25  # old scans added to the new grid with each new scan
STANDING: Final = 0.02, 0.01  # m and rad; a robot that moves less is standing
SCANS_STANDING: Final = 20  # scans stored of a robot at one standing position
PLACE: Final = 1.0  # m between two viewpoints
SQUARE: Final = 0.25  # m; larger than a cell, since noise spreads beam ends over cells
_MOTION_SOURCES: Final[dict[type[Report], str]] = {Ins: "ins", Odometry: "odometry"}


class RebuildableGrid:
    """An occupancy grid that stores its scans, so that it can be rebuilt.

    Attributes:
        grid: The map; a new object after a rebuild.
    """

    def __init__(
        self, trajectory: Trajectory, resolution: float, radius: float
    ) -> None:
        """Create an empty map.

        Args:
            trajectory: Trajectory of the robot, with a pose for each scan.
            resolution: Side of a cell, m.
            radius: Radius of the disc around the robot that is marked free, m; 0 for no
                disc.
        """
        self.grid = OccupancyGrid(resolution)
        self._trajectory = trajectory
        self._radius = radius
        # all scans, each with the number of its pose in the trajectory
        self._scans: list[tuple[int, PlanarScan]] = []
        self._last: Pose2 | None = None  # pose of the last scan while driving
        self._standing = 0
        self._next: OccupancyGrid | None = None
        self._added = 0  # number of scans added to the next grid

    def add(self, scan: PlanarScan) -> None:
        """Add a scan to the map, at the last pose of the trajectory."""
        number = len(self._trajectory) - 1
        self._add(self.grid, number, scan)
        # Scans of a standing robot are all alike, so only some of them are stored.
        pose = self._trajectory.poses[-1]
        if self._last is None or pose.is_apart(self._last, *STANDING):
            self._last, self._standing = pose, 0
        self._standing += 1
        if self._standing <= SCANS_STANDING:
            # All scans of a run are kept, so their
            # numbers are stored in half the memory.
            self._scans.append((number, _converted(scan, np.int32, np.float32)))
        self._continue(SCANS_AT_ONCE)

    def rebuild(self) -> None:
        """Start to rebuild the grid, since the poses of earlier scans have changed."""
        # If a rebuild is already in progress, it starts again with the new poses.
        self._next, self._added = OccupancyGrid(self.grid.frame.resolution), 0

    def finish(self) -> None:
        """Complete the rebuild of the grid, if one is in progress."""
        self._continue(len(self._scans))

    def seen_from_one_place(self) -> float:
        """Return the share of solid squares that were seen from only one position.

        Viewpoints are at least 1 m apart. Squares have sides of 0.25 m.
        """
        seen: dict[Point, list[NDArray[np.int64]]] = {}
        for number, scan in self._scans:
            pose = self._trajectory.poses[number]
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
        for number, scan in self._scans[self._added : self._added + count]:
            # The engine expects 64-bit numbers.
            self._add(self._next, number, _converted(scan, np.int64, np.float64))
            self._added += 1
        if self._added == len(self._scans):
            self.grid, self._next = self._next, None

    def _add(self, grid: OccupancyGrid, number: int, scan: PlanarScan) -> None:
        pose = self._trajectory.poses[number]
        grid.add(pose, scan)
        if self._radius:
            grid.clear_disc(pose, self._radius)


def _squares(points: Floats) -> NDArray[np.int64]:
    """Return the numbers of the map squares that contain points, each once."""
    column, row = np.floor(points / SQUARE).astype(np.int64).T
    return np.unique((column << 32) + row)


def _converted(scan: PlanarScan, whole: DTypeLike, real: DTypeLike) -> PlanarScan:
    """Return a scan with its integers and its real numbers converted to other types."""
    beams, near, far, layer = scan.hits
    hits = BeamHits(beams.astype(whole), near.astype(real), far.astype(real), layer)
    return replace(scan, known_range=scan.known_range.astype(real), hits=hits)


class Mapper(ScanReader):
    """Builds a map from the scans of one scanner and the robot's other reports.

    Attributes:
        slam: Estimates the robot's pose.
        truth: Ground truth poses, if the server sends them.
        scans: Number of scans on the map.
        left_out: Number of scans not on the map, by reason: the robot's pose was
            unknown (``no_pose``), or echoes were missing (``no_echoes``).
    """

    def __init__(
        self,
        scanner: ScannerInfo,
        *,
        motion_source: MotionSource = "ins",
        resolution: float = RESOLUTION,
        echo_wait: float = 1.0,
        map_range: float = math.inf,
        robot_radius: float = 0.0,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Create an empty map.

        Args:
            scanner: Scanner to map with.
            motion_source: Source of the robot's motion between scans.
            resolution: Side of a cell, m.
            echo_wait: Time for which scans without echoes are not mapped, since their
                echoes may still arrive, s; 0 if no client requested echoes.
            map_range: Range up to which scans are mapped, m; the pose is found with the
                full range.
            robot_radius: Radius of the disc around the robot that is marked free, m; 0
                for no disc.
            clock: Returns the time in s, for servers without advancing time stamps.
        """
        super().__init__(scanner, clock, echo_wait)
        self.slam = Slam(motion_source)
        self._grid = RebuildableGrid(self.trajectory, resolution, robot_radius)
        self._map_range = map_range
        self.truth = Trajectory()
        self.scans = 0
        self.left_out = {"no_pose": 0, "no_echoes": 0}
        self._spawn_pose: Pose2 | None = None
        self._motion = MotionReports()
        self._scans_since_report = 0
        self._sources: set[str] = set()  # sources that sent poses
        self._missing_scan = f"scan of {scanner.name!r}"
        self._missing_pose = f"pose from {motion_source}"
        has_source = motion_source != "none"
        self.missing = self._missing_pose if has_source else self._missing_scan

    @property
    def grid(self) -> OccupancyGrid:
        """The occupancy grid built so far."""
        return self._grid.grid

    @property
    def seen_from_one_place(self) -> float:
        """The share of solid squares that were seen from only one position."""
        return self._grid.seen_from_one_place()

    @property
    def trajectory(self) -> Trajectory:
        """Estimated poses of the robot, one for each scan."""
        return self.slam.trajectory

    @property
    def hint(self) -> str:
        """Motion sources to use instead, if the requested one has sent no poses."""
        if self.missing != self._missing_pose:
            return ""
        others = self._sources - {self.slam.motion_source}
        return f"set the motion source to {' or '.join([*sorted(others), 'none'])}"

    def finish(self) -> None:
        """Complete the map, if it is being rebuilt after a loop closure."""
        self._grid.finish()

    def _take_other(self, report: Report) -> None:
        if not isinstance(report, Ins | GroundTruth | Odometry):
            return
        pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
        if not isinstance(report, Odometry):  # odometry starts at an arbitrary pose
            self._spawn_pose = self._spawn_pose or pose
        source = _MOTION_SOURCES.get(type(report))
        if source is not None:
            self._sources.add(source)
        if source == self.slam.motion_source:
            self._motion.add(report.time, pose)
            self._scans_since_report = 0
            self.missing = self._missing_scan
        if isinstance(report, GroundTruth):
            last = self.truth.times[-1] if len(self.truth) else -math.inf
            # The tolerance prevents rounding errors from delaying a pose.
            if report.time > last + TRUTH_INTERVAL - 1e-9:
                self.truth.add(report.time, pose)

    def _take_scan(self, report: RangeScan) -> Observation | None:
        source = self.slam.motion_source
        if source != "none":
            self._scans_since_report += 1
        # If the motion source stops, all later scans would be placed at one position.
        is_lost = self._scans_since_report > MAX_SCANS_WITHOUT_MOTION
        reported = self._motion.at(report.time)
        if source != "none" and (reported is None or is_lost):
            self.missing = self._missing_pose
            self.left_out["no_pose"] += 1
            return None
        if not len(self.trajectory):
            # With an INS, the map starts at the first INS pose. With other sources it
            # starts at the first pose from an INS or the ground truth, which arrives
            # after the mapper is created.
            self.slam.start = None if source == "ins" else self._spawn_pose
        time, echoes, lacks_echoes = self._time_and_echoes(report)
        scan = scan_of(self.scanner, replace(report, time=time), echoes)
        revision = self.slam.revision
        pose = self.slam.step(scan, *(reported or ()))
        # A loop closure or a rotation of the map has changed the poses of all scans.
        if self.slam.revision > revision:
            self._grid.rebuild()
        # A scan without echoes is not mapped, but its pose helps to find the next pose.
        if lacks_echoes:
            self.missing = f"echoes of {self.scanner.name!r}"
            self.left_out["no_echoes"] += 1
            return None
        self._grid.add(scan.within(self._map_range))
        self.scans += 1
        self.missing = self._missing_scan
        return self._observation(pose, scan)

    def _observation(self, pose: Pose2, scan: PlanarScan) -> Observation:
        # For each beam, only the nearest hit that
        # blocks robots counts, so smoke is ignored.
        nearest = np.full(len(scan.angles), math.inf)
        hits = scan.hits
        blocks = hits.layer != Layer.SMOKE
        np.minimum.at(nearest, hits.beams[blocks], hits.near[blocks])
        bearings, ranges = from_centre(
            nearest, scan.angles, self.scanner.mount, math.inf
        )
        return Observation(scan.time, pose, bearings, ranges)
