from pathlib import Path

import numpy as np
import pytest

from radarsim.lab.bench import robots
from radarsim.lab.bench.robots import (
    DrivingRobots,
    decoding,
    driving_robots,
    growth_of_robots,
    write_hall,
)
from radarsim.scene.map_file import load_map


@pytest.fixture
def driving(tmp_path: Path) -> DrivingRobots:
    return DrivingRobots(load_map(write_hall(tmp_path, poles=0)), robots=3)


def test_all_robots_drive(driving: DrivingRobots) -> None:
    vehicles = driving.host.simulation.vehicles
    before = [vehicle.robot.pose for vehicle in vehicles]
    driving.tenth()
    after = [vehicle.robot.pose for vehicle in vehicles]
    moved = [np.hypot(a.x - b.x, a.y - b.y) for a, b in zip(after, before, strict=True)]
    assert len(moved) == 3
    assert min(moved) > 0.02


def test_rays_are_those_of_a_scan_of_each_robot(driving: DrivingRobots) -> None:
    origins, directions = driving.rays()
    assert origins.shape == directions.shape == (3 * 181, 3)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1)
    pose = driving.host.simulation.vehicles[0].robot.pose
    ahead = directions[90]
    assert ahead == pytest.approx([np.cos(pose.yaw), np.sin(pose.yaw), 0])


def test_robots_are_compared_with_first_hits_with_and_without_poles() -> None:
    rows = list(driving_robots(0.0, robots=2))
    assert [row.limit for row in rows] == [4, 8]
    assert all(row.value > 0 for row in rows)


def test_growth_is_that_of_one_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots, "GROWTH_LIMITS", {4: 1.3})
    (row,) = growth_of_robots(0.2, robots=4)
    assert row.name == "0.1 s simulated of a robot among 4, by one among 4"
    assert row.limit == 1.3
    assert 0.3 < row.value < 3


@pytest.mark.slow
def test_lines_of_a_client_are_decoded() -> None:
    (row,) = decoding(0.1)
    assert row.group == "q"
    assert row.value > 0.0
    assert "us against" in row.note
