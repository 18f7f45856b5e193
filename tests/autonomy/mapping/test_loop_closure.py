"""A robot that goes once around a block of corridors, longer than it can see."""

import math
from itertools import pairwise

import numpy as np
import pytest
from flat_world import ANGLES, box, errors_of, look, ranges_of

from radarsim.autonomy.mapping.loop_closure import Keyframe, KeyframeMap
from radarsim.autonomy.mapping.mapper import RebuildableGrid
from radarsim.autonomy.mapping.scan import PlanarScan, read_scan
from radarsim.autonomy.mapping.scan_matching import Fit, ScanPoints, inward_normals
from radarsim.autonomy.mapping.slam import Slam
from radarsim.autonomy.mapping.trajectory import Trajectory
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan

REACH = 6.0  # m
STEP = 0.15  # m between two scans
BLOCK = np.concatenate([box(0, 0, 22.4, 14.4), box(0, 0, 17.6, 9.6)])  # around a ring
EMPTY_ROOM = box(0, 0, 12, 8)
CORNERS = [(10.0, -6.0), (10.0, 6.0), (-10.0, 6.0), (-10.0, -6.0), (10.0, -6.0)]


def around() -> list[Pose2]:
    """Drive around the block, and on to the corner that was passed first."""
    poses, x, y, yaw = [Pose2(0.0, -6.0)], 0.0, -6.0, 0.0
    for goal in CORNERS:
        bearing = math.atan2(goal[1] - y, goal[0] - x)
        while abs(turn := math.remainder(bearing - yaw, 2 * math.pi)) > 1e-9:
            yaw += max(-0.15, min(turn, 0.15))
            poses.append(Pose2(x, y, yaw))
        while (left := math.dist((x, y), goal)) > 1e-9:
            step = min(STEP, left)
            x, y = x + step * math.cos(bearing), y + step * math.sin(bearing)
            poses.append(Pose2(x, y, yaw))
    return poses


def slipping(path: list[Pose2]) -> list[Pose2]:
    """Return the odometry of wheels that slip on the northern side of the block."""
    poses = path[:1]
    for before, after in pairwise(path):
        step = after.relative_to(before)
        x = step.x * (1.06 if after.y > 5.9 else 1.0)
        poses.append(poses[-1].compose(Pose2(x, step.y, step.yaw)))
    return poses


def scan_from(pose: Pose2, time: float) -> PlanarScan:
    rng = np.random.Generator(np.random.PCG64(round(1000 * time)))
    ranges = ranges_of(BLOCK, pose) + rng.normal(0.0, 0.01, len(ANGLES))
    report = RangeScan(
        time, "laser", math.radians(1), 2 * ANGLES[-1], np.minimum(ranges, REACH)
    )
    return read_scan(report, max_range=REACH)


@pytest.mark.slow
def test_a_loop_of_corridors_closes_and_takes_the_drift_with_it() -> None:
    path = around()
    slam = Slam("odometry", path[0])
    live = []
    for i, (pose, odometry) in enumerate(zip(path, slipping(path), strict=True)):
        live.append(slam.step(scan_from(pose, 0.1 * i), odometry))
    motion = errors_of(slam.dead_reckoning.poses, path)
    as_driven = errors_of(live, path)
    found = errors_of(slam.trajectory.poses, path)
    assert slam.closures
    assert motion["ate"] > 0.4
    assert found["ate"] < 0.5 * as_driven["ate"]


def keyframe(pose: Pose2, station: float, least_x: float) -> Keyframe:
    """Return the seen points of a room east of some x."""
    places, along = look(EMPTY_ROOM, pose).points()
    is_seen = places[:, 0] + pose.x > least_x
    seen: tuple[Floats, Floats] = (places[is_seen], along[is_seen])
    points = ScanPoints(*seen, inward_normals(*seen), 0.0, True)
    return Keyframe(pose, points, station)


@pytest.mark.parametrize(
    ("x", "least_x", "closes"),
    [(2.8, -2.0, True), (0.5, -2.0, False), (0.5, -9.0, True)],
    ids=["same place", "near, half known", "near, all known"],
)
def test_a_loop_closes_beside_an_old_place_only_if_almost_all_fits(
    x: float, least_x: float, closes: bool
) -> None:
    known = KeyframeMap()
    known.add(keyframe(Pose2(4.0, -2.0), 0.0, least_x))
    known.keyframes[0].is_local = False
    known.add(keyframe(Pose2(x, -2.0), 40.0, -9.0))
    latest = Fit(Pose2(x, -2.0), 0.0, 1.0, np.diag([1e5, 1e5, 1e5]))
    closure = known.find_closure(latest)
    assert (closure is not None) == closes
    if closure is not None:
        number, pose, _ = closure
        assert number == 0
        assert (pose.x, pose.y) == pytest.approx((x, -2.0), abs=0.02)


def test_a_grid_follows_the_poses_when_these_move() -> None:
    path = around()[:40]
    drifted, known = Trajectory(), Trajectory()
    grid = RebuildableGrid(drifted, 0.05, 0.2)
    expected = RebuildableGrid(known, 0.05, 0.2)
    for i, pose in enumerate(path):
        scan = scan_from(pose, 0.1 * i)
        drifted.add(0.1 * i, Pose2(pose.x, pose.y + 0.01 * i, pose.yaw))
        known.add(0.1 * i, pose)
        grid.add(scan)
        expected.add(scan)
    drifted.poses = known.poses
    grid.rebuild()
    grid.finish()
    assert grid.grid.frame == expected.grid.frame
    assert np.mean(grid.grid.classes() != expected.grid.classes()) < 1e-4
