"""Odometry by what a turning radar sees, along a way whose poses are known."""

import math

import numpy as np
import pytest
from radar_odometry import RadarOdometry, Turn, cen2018_peaks, follow, turns_along

import radarsim
from radarsim.geometry import Pose2, Pose3

HEIGHT, SPEED = 0.546, 0.8  # m, m/s
LONG, RADIUS, MIDDLE = 16.0, 3.5, -13.0  # m, of the oval, and its x


def oval(time: float) -> Pose3:
    """Return the pose on an oval in the meadow of ``forest_edge``."""
    half = LONG + math.pi * RADIUS
    halves, way = divmod(SPEED * time, half)
    side = 1 if halves % 2 == 0 else -1  # of the oval, which is the same turned round
    bend = max(way - LONG, 0.0) / RADIUS
    x = side * RADIUS * math.cos(bend)
    y = side * (min(way, LONG) - LONG / 2 + RADIUS * math.sin(bend))
    yaw = side * math.pi / 2 + bend
    return Pose3(MIDDLE + x, y, HEIGHT, 0.0, 0.0, yaw)


@pytest.mark.slow("alone")  # takes minutes
def test_drift_along_a_meadow_is_small() -> None:
    scene = radarsim.load_map("forest_edge")
    radar = radarsim.load_sensor("navtech_cts350x").fmcw
    rng = radarsim.generator_for(0)
    found = follow(turns_along(radar, scene, oval, 61 / SPEED, rng))
    assert found.length >= 60
    assert found.drift < 0.03
    assert 100 < found.peaks.mean() < 5000


def test_points_seen_in_a_curve_give_its_motion() -> None:
    """Places in a square, each seen from where the robot was by then."""
    side = np.linspace(-10, 10, 101)
    ends = np.full_like(side, 10.0)
    walls = np.concatenate(
        [
            *(np.column_stack([side, sign * ends]) for sign in (1, -1)),
            *(np.column_stack([sign * ends, side]) for sign in (1, -1)),
        ]
    )
    motion = Pose2(0.2, 0.0, 0.1)

    def turn_from(begin: Pose2, end: Pose2) -> Turn:
        angle = -np.arctan2(walls[:, 1], walls[:, 0]) % (2 * np.pi)
        shares = angle / (2 * np.pi)
        yaw = begin.yaw + shares * (end.yaw - begin.yaw)
        x = begin.x + shares * (end.x - begin.x)
        y = begin.y + shares * (end.y - begin.y)
        dx, dy = walls[:, 0] - x, walls[:, 1] - y
        places = np.column_stack(
            [np.cos(yaw) * dx + np.sin(yaw) * dy, np.cos(yaw) * dy - np.sin(yaw) * dx]
        )
        return Turn(places, shares, np.zeros((1, 1), np.uint8), end)

    begin = Pose2(-1.0, 0.5, 0.3)
    odometry = RadarOdometry(begin)
    for moved in [Pose2(0.0, 0.0)] * 2 + [motion] * 8:
        end = begin.compose(moved)
        found = odometry.step(turn_from(begin, end))
        begin = end
    assert found.x == pytest.approx(end.x, abs=0.05)
    assert found.y == pytest.approx(end.y, abs=0.05)
    assert found.yaw == pytest.approx(end.yaw, abs=0.01)


def test_lone_peaks_over_flat_noise_are_counted() -> None:
    rng = np.random.default_rng(0)
    counts = rng.integers(16, 19, (40, 1000)).astype(np.uint8)
    assert cen2018_peaks(counts) < 5
    for start in (200, 500, 800):
        counts[::2, start : start + 6] = 90
    assert 60 <= cen2018_peaks(counts) < 66


def test_peaks_are_about_as_many_as_in_real_images() -> None:
    """467 and 478 in two images of RADIATE; within a factor of two."""
    scene = radarsim.load_map("forest_edge")
    radar = radarsim.load_sensor("navtech_cts350x_radiate")
    start = scene.starts[0].pose
    place = (start.x, start.y, start.yaw)
    counts = radar.spectrum(scene, place, radarsim.generator_for(0)).counts
    assert 236 < cen2018_peaks(counts, smoothing=5, nearest=15) < 944
