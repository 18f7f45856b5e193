"""Compiling what maps are made by, before a robot moves.

The first use of a compiled function on a machine takes seconds. A robot that has been
told to go would go on blindly for as long.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from radarsim.client import ScannerFacts
from radarsim.geometry import Pose2, Pose3
from radarsim.mapping.floor import Floor
from radarsim.mapping.mapper import Mapper, MapperSettings
from radarsim.mapping.pointmap import PointMap
from radarsim.mapping.slam import SlamSettings
from radarsim.protocol.reports import EchoLine, Ins, RangeScan, Report, Seen

_BEAMS = 90
_FOV = math.radians(356)
_SCANNER = ScannerFacts("x", Pose3(0, 0, 0), 0.1, 6.0, math.radians(4), _FOV, _BEAMS)
_SCANS = 3
_MANY = 1000  # points, more than a new map has room for


def warm_up() -> None:
    """Make a little map, with and without a seed, and plan on it."""
    PointMap().add(np.zeros((_MANY, 2)))
    for settings in (SlamSettings(), SlamSettings(seed="none")):
        mapper = Mapper(_SCANNER, MapperSettings(slam=settings, body=0.2))
        for report in _drive():
            mapper.take(report)
        floor = Floor(mapper.grid, 0.4)
        middle = Pose2(0.0, 0.0)
        floor.way_to(middle, floor.frontiers | floor.unvisited)
        floor.rim(floor.reachable(middle))
        mapper.grid.drivable_cells(0.4)


def _drive() -> Iterator[Report]:
    """Tell of a robot inside a wall all round, with a hedge before it on one side."""
    beams = np.arange(_BEAMS // 2)
    for k in range(_SCANS):
        time = 0.1 * k
        yield Ins(time, "x", Pose3(0.3 * k, 0.0, 0.0))
        yield EchoLine(time, "x", 1, 2, _seen("wall", np.arange(_BEAMS), 5.0, "hit"))
        yield EchoLine(time, "x", 2, 2, _seen("hedge", beams, 3.0, "enter"))
        ranges = np.full(_BEAMS, 5.0)
        yield RangeScan(time, "x", math.radians(4), _FOV, ranges)


def _seen(name: str, beams: NDArray[np.int64], range_: float, kind: str) -> Seen:
    ones = np.ones(len(beams))
    kinds, flags = (kind,) * len(beams), (False, False)
    return Seen(name, name, 1.0, 0.5, *flags, beams, range_ * ones, kinds, ones, ones)
