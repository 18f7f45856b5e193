"""Odometry along a drive through the town, by our own and by a published algorithm."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from cfear import Cfear
from radar_odometry import Estimate, RadarOdometry, Turn, turns_along
from town_maps import town_yaml

import radarsim
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.scene.scene import Scene

ROOF, SPEED = 1.9, 4.0  # m, m/s
STRAIGHT, BEND = 55.0, 20.0  # m, before the turn to the left, and of it
STEP = 0.01  # m
START = 4.0  # s until it drives at that speed
FRAMES = 120


def drive_through(scene: Scene) -> Callable[[float], Pose3]:
    """Return the pose at a time: along one street, to the left into the other."""
    way = np.arange(0.0, SPEED * FRAMES / 4 + 10, STEP)
    bend = np.clip((way - STRAIGHT) / BEND, 0.0, 1.0)
    yaw = math.pi / 2 * bend**2 * (3 - 2 * bend)  # as one turns a wheel
    x, y = np.cumsum(np.cos(yaw)) * STEP, np.cumsum(np.sin(yaw)) * STEP
    x += scene.starts[13].pose.x - x[-1]
    y += scene.starts[0].pose.y - y[0]

    def pose_at(time: float) -> Pose3:
        begun = min(time, START)
        driven = SPEED * (begun**2 / (2 * START) + time - begun)
        found = (float(np.interp(driven, way, each)) for each in (x, y, yaw))
        ahead, left, turned = found
        return Pose3(ahead, left, ROOF, 0.0, 0.0, turned)

    return pose_at


def heading_bias(found: Estimate) -> float:
    """Return the mean error of the change of heading, degrees a frame."""
    errors = [
        wrap_angle((b.yaw - a.yaw) - (d.yaw - c.yaw))
        for (a, b), (c, d) in zip(
            pairwise(found.estimated), pairwise(found.truth), strict=True
        )
    ]
    return math.degrees(float(np.mean(errors)))


@pytest.fixture(scope="module")
def turns(tmp_path_factory: pytest.TempPathFactory) -> list[Turn]:
    path = tmp_path_factory.mktemp("town") / "town.yaml"
    path.write_text(town_yaml(1))
    scene = radarsim.load_map(path)
    radar = radarsim.load_sensor("navtech_cts350x_radiate").fmcw
    seconds = (FRAMES + 1.2) / radar.settings.rotation_hz
    way = drive_through(scene)
    return list(turns_along(radar, scene, way, seconds, radarsim.generator_for(0)))


def estimate(turns: list[Turn], step: Callable[[Turn], Pose2]) -> Estimate:
    truth = [turn.end for turn in turns]
    return Estimate(truth, [step(turn) for turn in turns], np.zeros(0, np.int64))


@pytest.mark.slow("alone")  # takes minutes
def test_published_odometry_finds_its_way_through_the_town(turns: list[Turn]) -> None:
    settings = radarsim.load_sensor("navtech_cts350x_radiate").fmcw.settings
    found = estimate(turns, Cfear(turns[0].end, settings).step)
    assert len(turns) >= FRAMES - 1
    assert found.length > 105
    assert found.drift <= 0.01
    assert abs(heading_bias(found)) <= 0.05


@pytest.mark.slow("alone")
def test_own_odometry_finds_its_way_through_the_town(turns: list[Turn]) -> None:
    found = estimate(turns, RadarOdometry(turns[0].end, unrollings=4).step)
    assert found.drift <= 0.01
    assert abs(heading_bias(found)) <= 0.05
