import math

import numpy as np
import pytest
from flat_world import CORRIDOR, ROOM, look
from hypothesis import given
from hypothesis import strategies as st

from radarsim.autonomy.mapping.scan import PlanarScan
from radarsim.autonomy.mapping.scan_matching import (
    PointMap,
    ScanPoints,
    best_start,
    fit,
    inward_normals,
)
from radarsim.geometry import Floats, Pose2
from radarsim.rng import generator_for

LOOSE: Floats = np.array([0.3, 0.3, 0.2])
HERE = Pose2(1.0, -0.5, 0.4)
offsets = st.floats(-0.1, 0.1)
turns = st.floats(-0.08, 0.08)


def points_of(scan: PlanarScan, *, spread: float = 0.0) -> ScanPoints:
    places, along = scan.points()
    return ScanPoints(places, along, inward_normals(places, along), spread, True)


def on_the_map(places: Floats, pose: Pose2) -> Floats:
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    placed: Floats = places @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
    return placed


def map_from(walls: Floats, pose: Pose2) -> PointMap:
    """Create a map of exact scans from poses around a pose."""
    known = PointMap()
    for dx, dy in [(-0.4, 0.0), (0.0, 0.3), (0.3, -0.2), (0.0, 0.0)]:
        near = Pose2(pose.x + dx, pose.y + dy, pose.yaw + dx)
        known.add(on_the_map(look(walls, near).points()[0], near))
    return known


def off_by(pose: Pose2, dx: float, dy: float, turn: float) -> Pose2:
    return Pose2(pose.x + dx, pose.y + dy, pose.yaw + turn)


@pytest.fixture(scope="module")
def known() -> PointMap:
    return map_from(ROOM, HERE)


@given(dx=offsets, dy=offsets, turn=turns)
def test_pose_is_found_from_a_start_nearby(
    known: PointMap, dx: float, dy: float, turn: float
) -> None:
    start = off_by(HERE, dx, dy, turn)
    found, score, *_ = fit(
        known.table, points_of(look(ROOM, HERE)), start, start, LOOSE
    )
    assert math.hypot(found.x - HERE.x, found.y - HERE.y) < 0.01
    assert found.yaw == pytest.approx(HERE.yaw, abs=0.002)
    assert score > 200


def test_scan_without_points_leaves_the_prediction(known: PointMap) -> None:
    none: Floats = np.zeros((0, 2))
    nothing = ScanPoints(none, none, none, 0.0, True)
    start, predicted = off_by(HERE, 0.2, 0.1, 0.1), HERE
    found, score, *_ = fit(known.table, nothing, start, predicted, LOOSE)
    assert (found.x, found.y, found.yaw) == pytest.approx((1.0, -0.5, 0.4))
    assert score == 0


def test_points_far_from_the_map_leave_the_prediction(known: PointMap) -> None:
    away = Pose2(80.0, 80.0, 0.0)
    found, *_ = fit(known.table, points_of(look(ROOM, HERE)), away, away, LOOSE)
    assert (found.x, found.y, found.yaw) == (80.0, 80.0, 0.0)


@given(ahead=st.floats(-0.2, 0.2))
def test_along_a_corridor_the_prediction_decides(ahead: float) -> None:
    middle = Pose2(0.0, 0.0, 0.0)
    known = map_from(CORRIDOR, middle)
    start = Pose2(ahead, 0.02, 0.01)
    points, sure = points_of(look(CORRIDOR, middle)), np.full(3, 0.02)
    found, *_ = fit(known.table, points, start, start, sure)
    assert found.x == pytest.approx(ahead, abs=0.02)
    assert found.y == pytest.approx(0.0, abs=0.005)
    assert found.yaw == pytest.approx(0.0, abs=0.005)


def test_thick_echoes_of_a_corridor_do_not_hold_the_robot_back() -> None:
    """Walls that a thick beam blurs are lines still, and say nothing along them."""
    rng = generator_for(2, "thick beam")

    def blurred(ahead: float) -> ScanPoints:
        points = points_of(look(CORRIDOR, Pose2(ahead, 0.0)), spread=0.08)
        across = np.column_stack([-points.along[:, 1], points.along[:, 0]])
        off = rng.normal(0.0, 0.05, len(across))[:, None]
        near = np.hypot(*points.places.T) < 6.0
        return points._replace(
            places=(points.places + off * across)[near],
            along=points.along[near],
            normals=points.normals[near],
        )

    known, pose, sigma = PointMap(), Pose2(0.0, 0.0), np.array([0.01, 0.01, 0.01])
    known.add(blurred(0.0).places)
    for k in range(1, 200):
        predicted = Pose2(pose.x + 0.05, pose.y, pose.yaw)
        points = blurred(0.05 * k)
        pose, *_ = fit(known.table, points, predicted, predicted, sigma)
        if k % 4 == 0:
            known.add(on_the_map(points.places, pose))
    assert pose.x == pytest.approx(0.05 * 199, abs=0.05)
    assert pose.y == pytest.approx(0.0, abs=0.1)


def test_prediction_with_less_variance_moves_less() -> None:
    known = map_from(ROOM, HERE)
    start = off_by(HERE, 0.08, 0.0, 0.0)
    points = points_of(look(ROOM, HERE))
    off = []
    for sigma in (1e-5, 1e-3, 1.0):
        found, *_ = fit(known.table, points, start, start, np.full(3, sigma))
        off.append(math.hypot(found.x - HERE.x, found.y - HERE.y))
    assert off == sorted(off, reverse=True)
    assert off[0] == pytest.approx(0.08, abs=0.001)


def test_a_third_of_outliers_does_not_move_the_pose(known: PointMap) -> None:
    points = points_of(look(ROOM, HERE))
    rng = generator_for(1, "wrong points")
    wrong = rng.random(len(points.places)) < 0.33
    off = rng.uniform(-1.5, 1.5, points.places.shape)
    places = np.where(wrong[:, None], points.places + off, points.places)
    start = off_by(HERE, 0.08, -0.05, 0.03)
    found, *_ = fit(known.table, points._replace(places=places), start, start, LOOSE)
    assert math.hypot(found.x - HERE.x, found.y - HERE.y) < 0.01


def test_sideways_errors_of_echoes_average_out(known: PointMap) -> None:
    points = points_of(look(ROOM, HERE), spread=0.08)
    side = generator_for(2, "sides").integers(-1, 2, len(points.places)) * 0.1
    across = np.column_stack([-points.along[:, 1], points.along[:, 0]])
    noisy = points._replace(places=points.places + side[:, None] * across)
    found, *_ = fit(known.table, noisy, HERE, HERE, LOOSE)
    assert math.hypot(found.x - HERE.x, found.y - HERE.y) < 0.02
    assert found.yaw == pytest.approx(HERE.yaw, abs=0.005)


def poles() -> tuple[PointMap, ScanPoints]:
    """Create a map of five poles in the open, and a scan of them."""
    rng = generator_for(3, "poles")
    cell_centers = np.array([[4, 1], [3, -3], [-2, 4], [-4, -2], [1, 5]], np.float64)
    spots = np.repeat(cell_centers, 40, axis=0) + rng.normal(0, 0.05, (200, 2))
    known = PointMap()
    known.add(spots)
    along = cell_centers / np.linalg.norm(cell_centers, axis=1)[:, None]
    return known, ScanPoints(cell_centers, along, np.zeros_like(along), 0.05, True)


def test_poles_fix_a_pose_in_both_directions() -> None:
    known, points = poles()
    start = Pose2(0.08, -0.06, 0.03)
    found, *_ = fit(known.table, points, start, start, LOOSE)
    assert math.hypot(found.x, found.y) < 0.03
    assert abs(found.yaw) < 0.01


def test_poles_count_only_if_they_are_dense() -> None:
    known, points = poles()
    start = Pose2(0.08, -0.06, 0.03)
    unsure = points._replace(spots=False)
    found, score, *_ = fit(known.table, unsure, start, start, LOOSE)
    assert score < 3
    assert math.hypot(found.x - start.x, found.y - start.y) < 0.12


def test_best_of_many_starts_is_the_nearest_one(known: PointMap) -> None:
    turns = np.radians([-60, -30, -12, 1, 14, 45])
    starts = np.array([[HERE.x, HERE.y, HERE.yaw + turn] for turn in turns])
    assert best_start(known.table, points_of(look(ROOM, HERE)), starts) == 3
