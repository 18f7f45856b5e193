"""Mapper: combines the reports of one robot, from any connection, into a map.

A mapper is passed every report of a robot: echoes, ranges, and poses. It finds the pose
of each scan (``slam``) and adds the scan to the grid. Where a server sends echoes, a
scan without all of its own serves for finding the pose but not for the map: the range
of a radar alone does not tell foliage from a wall.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from radarsim.autonomy.mapping.motion_reports import MotionReports
from radarsim.autonomy.mapping.occupancy_grid import RESOLUTION, OccupancyGrid
from radarsim.autonomy.mapping.scan import (
    MAX_RANGE,
    Layer,
    PlanarScan,
    read_scan,
)
from radarsim.autonomy.mapping.scan_grid import RebuildableGrid
from radarsim.autonomy.mapping.slam import Slam, SlamSettings
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.autonomy.navigation.observation import (
    Observation,
    ScanClock,
)
from radarsim.client import ScannerInfo
from radarsim.client.robot_info import from_centre, same_name
from radarsim.client.robot_state import EchoCollector
from radarsim.geometry import Pose2
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
)

MAX_SCANS_WITHOUT_MOTION: Final = 50  # after which the motion counts as unknown
TRUTH_INTERVAL: Final = 0.05  # s; true poses in between are not stored

_MOTION_SOURCES: Final[dict[type[Report], str]] = {Ins: "ins", Odometry: "odometry"}


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperSettings:
    """How a map is made.

    Attributes:
        slam: How scans are matched, and by which motion source.
        resolution: Side of a cell, m.
        echo_wait: How long scans without echoes are not added to the map, since their
            echoes may still come, s; 0 if no client asked for echoes.
        map_range: Range of the scanner that is mapped, m; the pose is found with all of
            it.
        robot_radius: Radius of the disc around the robot that is marked free, m; 0 for
            none.
    """

    slam: SlamSettings = field(default_factory=SlamSettings)
    resolution: float = RESOLUTION
    echo_wait: float = 1.0
    map_range: float = math.inf
    robot_radius: float = 0.0


class Mapper:
    """Makes a map of what one scanner measures.

    Attributes:
        settings: How the map is made.
        scanner: The scanner that it is made with.
        slam: Estimates the robot's pose.
        truth: True poses, as far as the server sends them.
        scans: Number of scans on the map.
        left_out: Number of scans that are not, as nobody knew where the robot was, and
            as their echoes did not come.
        missing: Report that it needs before the next scan counts, for messages.
    """

    def __init__(
        self,
        scanner: ScannerInfo,
        settings: MapperSettings | None = None,
        *,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Create an empty map.

        Args:
            scanner: Scanner to map with.
            settings: How the map is made.
            clock: Returns the time in s, for servers without advancing time stamps.
        """
        self.settings = settings or MapperSettings()
        self._grid = RebuildableGrid(
            self.settings.resolution, self.settings.robot_radius
        )
        self.slam = Slam(self.settings.slam)
        self.truth = Trajectory()
        self.scans = 0
        self.left_out = {"no_pose": 0, "no_echoes": 0}
        self.scanner = scanner
        mount = scanner.mount
        self._mount = Pose2(mount.x, mount.y, mount.yaw)
        self._stamps = ScanClock(clock)
        self._echoes = EchoCollector()
        self._echoes_due = math.nan  # until when scans wait for their echoes, s
        self._spawn_pose: Pose2 | None = None
        self._motion = MotionReports()
        self._scans_since_report = 0
        self._sources: set[str] = set()  # that sent poses
        source = self.settings.slam.motion_source
        self.missing = self._missing_scan if source == "none" else self._missing_pose

    @property
    def grid(self) -> OccupancyGrid:
        """The map."""
        return self._grid.grid

    @property
    def seen_from_one_place(self) -> float:
        """The share of what is solid that was seen from only one place."""
        return self._grid.seen_from_one_place()

    @property
    def trajectory(self) -> Trajectory:
        """Estimated pose of the robot at each scan."""
        return self.slam.trajectory

    @property
    def _missing_scan(self) -> str:
        return f"scan of {self.scanner.name!r}"

    @property
    def _missing_pose(self) -> str:
        return f"pose from {self.settings.slam.motion_source}"

    @property
    def cure(self) -> str:
        """The motion sources that are left, if poses of the wanted one are missing."""
        if self.missing != self._missing_pose:
            return ""
        others = self._sources - {self.settings.slam.motion_source}
        return f"expected motion from {' or '.join([*sorted(others), 'none'])}"

    def take(self, report: Report) -> Observation | None:
        """Add a report.

        Returns:
            What is around the robot, after a scan that is on the map: the nearest thing
            on each beam that robots cannot enter. None otherwise.
        """
        if isinstance(report, EchoLine):
            if same_name(report.name, self.scanner.name):
                self._echoes.take(report)
        elif isinstance(report, RangeScan):
            if same_name(report.name, self.scanner.name):
                return self._take_scan(report)
        elif isinstance(report, Ins | GroundTruth | Odometry):
            self._take_pose(report)
        return None

    def finish(self) -> None:
        """Complete the map, if it is being built anew after a loop was closed."""
        self._grid.finish()

    def _take_pose(self, report: Ins | GroundTruth | Odometry) -> None:
        pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
        if not isinstance(report, Odometry):  # which counts from anywhere
            self._spawn_pose = self._spawn_pose or pose
        source = _MOTION_SOURCES.get(type(report))
        if source is not None:
            self._sources.add(source)
        if source == self.settings.slam.motion_source:
            self._motion.add(report.time, pose)
            self._scans_since_report = 0
            self.missing = self._missing_scan
        if isinstance(report, GroundTruth):
            last = self.truth.times[-1] if len(self.truth) else -math.inf
            # A pose that is due but for rounding is stored.
            if report.time > last + TRUTH_INTERVAL - 1e-9:
                self.truth.add(report.time, pose)

    def _take_scan(self, report: RangeScan) -> Observation | None:
        settings = self.settings
        source = settings.slam.motion_source
        if source != "none":
            self._scans_since_report += 1
        # By a source that has fallen silent all scans would be at one place.
        is_lost = self._scans_since_report > MAX_SCANS_WITHOUT_MOTION
        reported = self._motion.at(report.time)
        if source != "none" and (reported is None or is_lost):
            self.missing = self._missing_pose
            self.left_out["no_pose"] += 1
            return None
        time = self._stamps.time_of(report.time)
        if not len(self.trajectory):
            # An INS begins at its own first pose. All else begins at the first one that
            # an INS or the ground truth tells, which comes after the mapper is made.
            start = None if source == "ins" else self._spawn_pose
            self.slam = Slam(settings.slam, start)
            self._echoes_due = time + settings.echo_wait
        echoes = self._echoes.of(report)
        if echoes is not None:
            # A server that has sent echoes goes on to: without them a scan lost some.
            self._echoes_due = time + settings.echo_wait
        scan = read_scan(
            replace(report, time=time),
            echoes,
            max_range=min(self.scanner.max_range, MAX_RANGE),
            min_range=self.scanner.min_range,
            mount=self._mount,
        )
        revision = self.slam.revision
        pose = self.slam.step(scan, *(reported or ()))
        # A loop has closed, or the map was turned: all scans have other poses now.
        if self.slam.revision > revision:
            self._grid.rebuild()
        # The pose is found without them, so that the next scan has one to begin at.
        if echoes is None and time < self._echoes_due:
            self.missing = f"echoes of {self.scanner.name!r}"
            self.left_out["no_echoes"] += 1
            return None
        self._grid.add(self.trajectory, scan.within(settings.map_range))
        self.scans += 1
        self.missing = self._missing_scan
        return self._observation(pose, scan)

    def _observation(self, pose: Pose2, scan: PlanarScan) -> Observation:
        # what is nearest on each beam; robots pass smoke
        nearest = np.full(len(scan.angles), math.inf)
        hits = scan.hits
        blocks = hits.layer != Layer.SMOKE
        np.minimum.at(nearest, hits.beams[blocks], hits.near[blocks])
        bearings, ranges = from_centre(
            nearest, scan.angles, self.scanner.mount, math.inf
        )
        return Observation(scan.time, pose, bearings, ranges)
