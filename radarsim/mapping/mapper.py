"""The echoes of one scan, which come in several lines before it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from radarsim.client import ScannerInfo
from radarsim.client.robot_info import same_name
from radarsim.geometry import Pose2
from radarsim.mapping.occupancy_grid import (
    RESOLUTION,
    OccupancyGrid,
)
from radarsim.mapping.scan import (
    Layer,
    PlanarScan,
    read_scan,
)
from radarsim.mapping.slam import Slam, SlamSettings
from radarsim.mapping.trajectory import Trajectory
from radarsim.navigation.observation import Observation, ScanClock, from_centre
from radarsim.protocol.reports import (
    EchoLine,
    GroundTruth,
    Ins,
    Odometry,
    RangeScan,
    Report,
    TargetEchoes,
)


class EchoCollector:
    """Collects the lines that belong together; holds those of one scan at a time."""

    def __init__(self) -> None:
        self._time = math.nan
        self._lines: dict[int, TargetEchoes] = {}
        self._count = -1

    def take(self, line: EchoLine) -> None:
        """Take in a line; one of another time begins anew."""
        if not _is_same(line.time, self._time):
            self._time, self._lines = line.time, {}
        self._count = line.lines
        if line.echoes is not None and 0 < line.line <= line.lines:
            self._lines[line.line] = line.echoes

    def of(self, scan: RangeScan) -> Sequence[TargetEchoes] | None:
        """Give all echoes of a scan; None where none, or not all, were told."""
        if not _is_same(scan.time, self._time) or len(self._lines) != self._count:
            return None
        seen, self._lines, self._count = list(self._lines.values()), {}, -1
        return seen


def _is_same(one: float, other: float) -> bool:
    """Compare time stamps; some servers send none."""
    return one == other or (math.isnan(one) and math.isnan(other))


# Section from mapping.mapper.
# Reports of a robot put together to a map, as they come in from any connection.
#
# A mapper is shown every report of a robot: echoes, ranges, and what tells where it
# is.
# Of each scan it finds the pose (``slam``), and lays it into the grid. Where a server
# tells echoes, a scan whose own are missing, in whole or in part, is good for finding
# the
# pose but not for the map: a radar's range alone does not tell foliage from a wall.

STALE: Final = 50  # scans without a word on the motion; it is not known any more
FARTHEST: Final = 200.0  # m; a beam is not followed farther, whatever a server says
TRUTH_EVERY: Final = 0.05  # s; true poses in between are not kept


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperSettings:
    """How a map is made.

    Attributes:
        slam: How scans are matched, and what seeds that.
        resolution: Side of a cell, m.
        echo_wait: For so many s without echoes scans are held back from the map, since
            some may still come; 0 if nobody has asked for any.
        body: Radius around the robot that is free where it stands, m; 0 for none.
    """

    slam: SlamSettings = field(default_factory=SlamSettings)
    resolution: float = RESOLUTION
    echo_wait: float = 1.0
    body: float = 0.0


class Mapper:
    """Makes a map of what one scanner sees.

    Attributes:
        settings: How it is made.
        scanner: The one that it is made by.
        grid: The map.
        slam: Knows where the robot is, and was.
        truth: Where it really was, as far as the server tells.
        scans: How many are on the map.
        missing: What it waits for before the next scan counts.
    """

    def __init__(
        self,
        scanner: ScannerInfo,
        settings: MapperSettings | None = None,
        *,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Begin with an empty map.

        Args:
            scanner: The one to map by.
            settings: How.
            clock: Gives s, for servers whose time stamps stand still or are missing.
        """
        self.settings = settings or MapperSettings()
        self.grid = OccupancyGrid(self.settings.resolution)
        self.slam = Slam(self.settings.slam)
        self.truth = Trajectory()
        self.scans = 0
        mount = scanner.mount
        self.scanner = scanner
        self._mount = Pose2(mount.x, mount.y, mount.yaw)
        self._stamps = ScanClock(clock)
        self._echoes = EchoCollector()
        self._echoes_due = math.nan
        self._spawned: Pose2 | None = None
        self._seed: Pose2 | None = None
        self._since_seed = 0  # scans
        seed = self.settings.slam.motion_source
        self.missing = f"scan of {scanner.name!r}"
        if seed != "none":
            self.missing = f"pose from {seed}"

    @property
    def trajectory(self) -> Trajectory:
        """Where the robot was at each scan, by its own reckoning."""
        return self.slam.trajectory

    def take(self, report: Report) -> Observation | None:
        """Take in a report.

        Returns:
            What is around the robot, after a scan that is on the map: the nearest on
            each beam that robots cannot enter.
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

    def _take_pose(self, report: Ins | GroundTruth | Odometry) -> None:
        pose = Pose2(report.pose.x, report.pose.y, report.pose.yaw)
        told_by: dict[type, str] = {Ins: "ins", Odometry: "odometry"}
        if not isinstance(report, Odometry):
            self._spawned = self._spawned or pose
        if told_by.get(type(report)) == self.settings.slam.motion_source:
            self._seed, self._since_seed = pose, 0
            self.missing = f"scan of {self.scanner.name!r}"
        if isinstance(report, GroundTruth):
            last = self.truth.times[-1] if len(self.truth) else -math.inf
            if report.time > last + TRUTH_EVERY - 1e-9:
                self.truth.add(report.time, pose)

    def _take_scan(self, report: RangeScan) -> Observation | None:
        settings = self.settings
        if settings.slam.motion_source != "none" and not self._is_seeded():
            self.missing = f"pose from {settings.slam.motion_source}"
            return None
        time = self._stamps.time_of(report.time)
        if not len(self.trajectory):
            self.slam = Slam(settings.slam, self._start())
            self._echoes_due = time + settings.echo_wait
        seen = self._echoes.of(report)
        if seen is not None:
            self._echoes_due = time + settings.echo_wait
        scan = read_scan(
            replace(report, time=time),
            seen,
            max_range=min(self.scanner.max_range, FARTHEST),
            min_range=self.scanner.min_range,
            mount=self._mount,
        )
        pose = self.slam.step(scan, self._seed)
        if seen is None and time < self._echoes_due:
            self.missing = f"echoes of {self.scanner.name!r}"
            return None
        self._draw(pose, scan)
        return self._sensed(pose, scan)

    def _is_seeded(self) -> bool:
        """Tell whether the motion until this scan is known."""
        self._since_seed += 1
        return self._seed is not None and self._since_seed <= STALE

    def _start(self) -> Pose2 | None:
        """Give where the map begins, for a seed that counts from anywhere."""
        return None if self.settings.slam.motion_source == "ins" else self._spawned

    def _draw(self, pose: Pose2, scan: PlanarScan) -> None:
        self.grid.add(pose, scan)
        if self.settings.body:
            self.grid.stand(pose, self.settings.body)
        self.scans += 1
        self.missing = f"scan of {self.scanner.name!r}"

    def _sensed(self, pose: Pose2, scan: PlanarScan) -> Observation:
        nearest = np.full(len(scan.angles), math.inf)
        hits = scan.hits
        solid = hits.what != Layer.SMOKE
        np.minimum.at(nearest, hits.beams[solid], hits.near[solid])
        bearings, ranges = from_centre(
            nearest, scan.angles, self.scanner.mount, math.inf
        )
        return Observation(scan.time, pose, bearings, ranges)
