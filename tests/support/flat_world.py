"""Flat world of line segments, scanned exactly."""

import math

import numpy as np

from radarsim.autonomy.mapping.scan import PlanarScan, read_scan
from radarsim.autonomy.mapping.trajectory import (
    Trajectory,
    trajectory_errors,
)
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan, TargetEchoes

MAX_RANGE = 30.0
ANGLES: Floats = np.radians(np.arange(360) - 179.5)

Echo = tuple[int, float, str]  # beam, range, kind


def rectangle(west: float, south: float, east: float, north: float) -> Floats:
    """Return the four sides of a rectangle, (4, 2, 2) m."""
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def box(x: float, y: float, width: float, height: float) -> Floats:
    """Return the four sides of a box by its center, (4, 2, 2) m."""
    right, up = width / 2, height / 2
    return rectangle(x - right, y - up, x + right, y + up)


ROOM: Floats = np.concatenate([box(0, 0, 12, 8), box(2, 1, 1, 1), box(-3, -2, 0.6, 2)])
CORRIDOR: Floats = np.array([[[-99, -1], [99, -1]], [[-99, 1], [99, 1]]], np.float64)
NOWHERE: Floats = np.zeros((0, 2, 2))


def cast(walls: Floats, pose: Pose2, bearings: Floats) -> Floats:
    """Return the exact ranges of beams from a pose, m; infinite for a miss."""
    angles = bearings + pose.yaw
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    starts = walls[:, 0] - (pose.x, pose.y)
    sides = walls[:, 1] - walls[:, 0]
    across = np.outer(directions[:, 0], sides[:, 1]) - np.outer(
        directions[:, 1], sides[:, 0]
    )
    wide = starts[:, 0] * sides[:, 1] - starts[:, 1] * sides[:, 0]
    aside = np.outer(directions[:, 1], starts[:, 0]) - np.outer(
        directions[:, 0], starts[:, 1]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges, along = wide / across, aside / across
    is_hit = (ranges > 0) & (along >= 0) & (along <= 1)
    nearest: Floats = np.where(is_hit, ranges, math.inf).min(axis=1, initial=math.inf)
    return nearest


def ranges_of(walls: Floats, pose: Pose2) -> Floats:
    """Return the ranges of beams all around, (360,) m; the maximum range for a miss."""
    return np.minimum(cast(walls, pose, ANGLES), MAX_RANGE)


def look(walls: Floats, pose: Pose2, *, time: float = 0.0) -> PlanarScan:
    """Return the scan of a world from a pose."""
    ranges = ranges_of(walls, pose)
    fov = float(ANGLES[-1] - ANGLES[0])
    report = RangeScan(time, "lms200", math.radians(1), fov, ranges)
    return read_scan(report, max_range=MAX_RANGE)


def echoes_of(
    *echoes: Echo, name: str = "bush", material: str = "leaf", passes: bool = False
) -> TargetEchoes:
    """Return the echoes of an object."""
    columns = tuple(zip(*echoes, strict=True)) if echoes else ((), (), ())
    beams, ranges = np.array(columns[0], np.int64), np.array(columns[1], np.float64)
    ones = np.ones(len(beams))
    return TargetEchoes(
        *(name, material, 0.7, 0.3, False, passes),
        *(beams, ranges, columns[2], ones, ones),
    )


def look_through(
    near: float, far: float, end: float | None, *, passes: bool = False
) -> PlanarScan:
    """Scan a hedge across the view, from ``near`` to ``far`` m, and a wall at ``end``.

    Without a wall the beams are spent in the hedge.
    """
    slope = 1 / np.cos(np.radians(np.linspace(-30, 30, 61)))
    sides = ((near, "enter"), (far, "spent" if end is None else "leave"))
    hedge = [(k, t * s, kind) for k, s in enumerate(slope) for t, kind in sides]
    seen, ranges = [echoes_of(*hedge, name="hedge", passes=passes)], far * slope
    if end is not None:
        ranges = end * slope
        wall = [(k, t, "hit") for k, t in enumerate(ranges)]
        seen.append(echoes_of(*wall, name="wall"))
    report = RangeScan(0.0, "lms200", math.radians(1), math.radians(60), ranges)
    return read_scan(report, seen, max_range=20.0)


def errors_of(found: list[Pose2], true: list[Pose2]) -> dict[str, float]:
    """Return the errors of poses, one a second."""
    truth, estimate = Trajectory(), Trajectory()
    for time, (pose, other) in enumerate(zip(true, found, strict=True)):
        truth.add(float(time), pose)
        estimate.add(float(time), other)
    return trajectory_errors(estimate, truth)
