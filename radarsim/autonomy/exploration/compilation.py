"""Compiles everything that maps are made with.

The first use of a compiled function on a machine takes seconds, during which a moving
robot would go on blindly.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.mapper import Mapper, MapperSettings
from radarsim.autonomy.mapping.point_map import PointMap
from radarsim.autonomy.mapping.slam import SlamSettings
from radarsim.client import ScannerInfo
from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.reports import EchoLine, Ins, RangeScan, Report, TargetEchoes

_BEAMS = 90
_FOV = math.radians(356)
_SCANNER = ScannerInfo("x", Pose3(0, 0, 0), 0.1, 6.0, math.radians(4), _FOV, _BEAMS)
_SCANS = 3
_POINTS = 1000  # more than a new map has rows for


def warm_up() -> None:
    """Make small maps, with and without a motion source, and plan on them."""
    PointMap().add(np.zeros((_POINTS, 2)))
    for settings in (SlamSettings(), SlamSettings(motion_source="none")):
        mapper = Mapper(_SCANNER, MapperSettings(slam=settings, robot_radius=0.2))
        for report in _reports():
            mapper.take(report)
        floor = TraversabilityMap(mapper.grid, 0.4)
        center = Pose2(0.0, 0.0)
        floor.find_path(center, floor.frontiers | floor.unvisited)
        floor.outer_boundary(floor.reachable(center))
        mapper.grid.drivable_cells(0.4)


def _reports() -> Iterator[Report]:
    """Return what a robot reports inside a round wall, with a hedge on one side."""
    beams = np.arange(_BEAMS // 2)
    for k in range(_SCANS):
        time = 0.1 * k
        yield Ins(time, "x", Pose3(0.3 * k, 0.0, 0.0))
        yield EchoLine(time, "x", 1, 2, _echoes("wall", np.arange(_BEAMS), 5.0, "hit"))
        yield EchoLine(time, "x", 2, 2, _echoes("hedge", beams, 3.0, "enter"))
        ranges = np.full(_BEAMS, 5.0)
        yield RangeScan(time, "x", math.radians(4), _FOV, ranges)


def _echoes(
    name: str, beams: NDArray[np.int64], range_: float, kind: str
) -> TargetEchoes:
    ones = np.ones(len(beams))
    kinds, flags = (kind,) * len(beams), (False, False)
    return TargetEchoes(
        name, name, 1.0, 0.5, *flags, beams, range_ * ones, kinds, ones, ones
    )
