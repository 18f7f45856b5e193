"""The map ``forest_edge``: its plants, what sensors see in it, and where robots fit."""

import time

import numpy as np
import pytest

import radarsim
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan
from radarsim.simulation.simulation import Simulation

FEET = Footprint(0.552, 0.497)  # of a P3AT
HEDGE = -5.0  # m, its x
BEHIND = HEDGE + 1.0  # the radius of a shrub


@pytest.fixture(scope="module")
def forest() -> Scene:
    return radarsim.load_map("forest_edge")


def test_map_is_moderate_in_size(forest: Scene) -> None:
    assert forest.triangles < 300_000
    start = time.process_time()
    radarsim.load_map("forest_edge")
    assert time.process_time() - start < 30
    low, high = forest.bounds
    assert (high - low)[:2] == pytest.approx([40.2, 30.2])


def test_robot_can_start_at_every_start(forest: Scene) -> None:
    simulation = Simulation(forest)
    names = [start.name for start in forest.starts]
    assert names == ["RobotStart1", "RobotStart2", "RobotStart3"]
    for start in forest.starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        vehicle = simulation.spawn(start.name, load_robot("P3AT"), wanted)
        assert vehicle is not None
        assert vehicle.robot.pose == wanted


def test_robot_fits_around_the_hedge_but_not_through_it(forest: Scene) -> None:
    obstacles = Obstacles.from_scene(forest)
    across = np.arange(-12, 12.01, 0.05)
    assert not any(obstacles.clear(FEET, Pose2(HEDGE, float(y))) for y in across)
    assert obstacles.clear(FEET, Pose2(HEDGE, 13.5))
    assert obstacles.clear(FEET, Pose2(HEDGE, -13.5))


def test_trunks_are_obstacles(forest: Scene) -> None:
    obstacles = Obstacles.from_scene(forest)
    trees = {
        part.object_name: part
        for part in forest.parts
        if part.material.name == "wood" and "tree" in part.object_name
    }
    assert len(trees) == 13
    for part in trees.values():
        x, y, _ = part.vertices[part.vertices[:, 2] < 0.02].mean(axis=0).tolist()
        assert not obstacles.clear(FEET, Pose2(x, y))


def scans_of(scene: Scene, preset: str) -> list[Scan]:
    sensor, rng = radarsim.load_sensor(preset), generator_for(0, preset)
    return [
        sensor.scan(scene, (start.pose.x + 0.2085, start.pose.y, 0.0), rng)
        for start in scene.starts
    ]


def seen_behind(scan: Scan) -> int:
    """Count the readings behind the hedge, of beams that go through it."""
    slope = np.tan(scan.angles)
    ahead = np.abs(scan.angles) < np.pi / 2 - 1e-6
    at_hedge = scan.pose.y + slope * (HEDGE - scan.pose.x)
    x = scan.pose.x + scan.ranges * np.cos(scan.angles)
    crosses = ahead & (np.abs(at_hedge) < 12) & np.isfinite(scan.ranges)
    return int(np.count_nonzero(crosses & (x > BEHIND)))


def test_radar_sees_things_behind_the_hedge_but_a_laser_does_not(forest: Scene) -> None:
    radar = [seen_behind(scan) for scan in scans_of(forest, "radar")]
    laser = [seen_behind(scan) for scan in scans_of(forest, "laser")]
    assert min(radar) >= 8
    assert max(laser) <= 3


@pytest.mark.slow
def test_radar_finds_the_things_in_the_clearing(forest: Scene) -> None:
    radar = radarsim.load_sensor("radar", return_mode="all", resolution_deg=0.5)
    rng = generator_for(0, "radar")
    found = set()
    for start in forest.starts:
        scan = radar.scan(forest, (start.pose.x + 0.2085, start.pose.y, 0.0), rng)
        echoes = scan.echoes
        found |= {echoes.targets[part].object for part in echoes.parts.tolist()}
    assert {"hut", "crate_low", "crate_high"} <= found
    assert any(name.startswith("pole_") for name in found)
