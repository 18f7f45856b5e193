"""A flat world of line segments, seen exactly, and reports of what is seen."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from radarsim.geometry import Floats, Pose2
from radarsim.mapping.scan import PlanarScan, read_scan
from radarsim.protocol.reports import RangeScan

MAX_RANGE = 30.0
ANGLES: Floats = np.radians(np.arange(360) - 179.5)

Look = Callable[..., PlanarScan]


def box(x: float, y: float, width: float, height: float) -> Floats:
    """Give the four sides, (4, 2, 2) m, of a box around a middle."""
    right, up = width / 2, height / 2
    corners = np.array([[-right, -up], [right, -up], [right, up], [-right, up]])
    corners += (x, y)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


ROOM: Floats = np.concatenate([box(0, 0, 12, 8), box(2, 1, 1, 1), box(-3, -2, 0.6, 2)])
CORRIDOR: Floats = np.array([[[-99, -1], [99, -1]], [[-99, 1], [99, 1]]], np.float64)
DEFAULT_MOUNT: Floats = np.zeros((0, 2, 2))


def ranges_of(walls: Floats, pose: Pose2) -> Floats:
    """Give what beams all around read, (360,) m; the greatest range for nothing."""
    ways = np.column_stack([np.cos(ANGLES + pose.yaw), np.sin(ANGLES + pose.yaw)])
    starts = walls[:, 0] - (pose.x, pose.y)
    sides = walls[:, 1] - walls[:, 0]
    across = np.outer(ways[:, 0], sides[:, 1]) - np.outer(ways[:, 1], sides[:, 0])
    wide = starts[:, 0] * sides[:, 1] - starts[:, 1] * sides[:, 0]
    beside = np.outer(ways[:, 1], starts[:, 0]) - np.outer(ways[:, 0], starts[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges, along = wide / across, beside / across
    met = (ranges > 0) & (along >= 0) & (along <= 1)
    nearest: Floats = np.where(met, ranges, MAX_RANGE).min(axis=1, initial=MAX_RANGE)
    return nearest


def look_around(walls: Floats, pose: Pose2, *, time: float = 0.0) -> PlanarScan:
    """Scan a world from a pose."""
    ranges = ranges_of(walls, pose)
    fov = float(ANGLES[-1] - ANGLES[0])
    report = RangeScan(time, "lms200", math.radians(1), fov, ranges)
    return read_scan(report, max_range=MAX_RANGE)


@pytest.fixture(scope="session")
def look() -> Look:
    return look_around


@pytest.fixture(scope="session")
def room() -> Floats:
    return ROOM


@pytest.fixture(scope="session")
def corridor() -> Floats:
    return CORRIDOR


@pytest.fixture(scope="session")
def nowhere() -> Floats:
    return DEFAULT_MOUNT
