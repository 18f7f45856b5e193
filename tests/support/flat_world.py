"""Flat world of line segments, scanned exactly."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from radarsim.autonomy.mapping.scan import PlanarScan, read_scan
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan

MAX_RANGE = 30.0
ANGLES: Floats = np.radians(np.arange(360) - 179.5)

Look = Callable[..., PlanarScan]


def box(x: float, y: float, width: float, height: float) -> Floats:
    """Return the four sides of a box by its center, (4, 2, 2) m."""
    right, up = width / 2, height / 2
    corners = np.array([[-right, -up], [right, -up], [right, up], [-right, up]])
    corners += (x, y)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


ROOM: Floats = np.concatenate([box(0, 0, 12, 8), box(2, 1, 1, 1), box(-3, -2, 0.6, 2)])
CORRIDOR: Floats = np.array([[[-99, -1], [99, -1]], [[-99, 1], [99, 1]]], np.float64)
EMPTY_WORLD: Floats = np.zeros((0, 2, 2))


def ranges_of(
    walls: Floats, pose: Pose2, angles: Floats = ANGLES, missed: float = MAX_RANGE
) -> Floats:
    """Return the ranges of beams at angles, m."""
    directions = np.column_stack([np.cos(angles + pose.yaw), np.sin(angles + pose.yaw)])
    starts = walls[:, 0] - (pose.x, pose.y)
    sides = walls[:, 1] - walls[:, 0]
    across = np.outer(directions[:, 0], sides[:, 1]) - np.outer(
        directions[:, 1], sides[:, 0]
    )
    wide = starts[:, 0] * sides[:, 1] - starts[:, 1] * sides[:, 0]
    beside = np.outer(directions[:, 1], starts[:, 0]) - np.outer(
        directions[:, 0], starts[:, 1]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges, along = wide / across, beside / across
    is_hit = (ranges > 0) & (along >= 0) & (along <= 1)
    nearest: Floats = np.where(is_hit, ranges, missed).min(axis=1, initial=missed)
    return nearest


def look_around(walls: Floats, pose: Pose2, *, time: float = 0.0) -> PlanarScan:
    """Return the scan of a world from a pose."""
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
    return EMPTY_WORLD
